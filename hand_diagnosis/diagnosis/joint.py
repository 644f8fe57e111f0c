"""The diagnosis of one joint: search, onset, confirmation on data that were not fitted, certificates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from hand_diagnosis.judgement import (
    CONTRADICTED,
    Certificate,
    JointResult,
    LeftOut,
    certify,
    confirm_laws,
    leave_one_out,
    search_with_onset,
    stage_results,
    tested,
    unswitched,
    with_onset,
    with_other_splits,
    with_stated_numbers,
    without_repeating,
)
from hand_diagnosis.problem import (
    Prepared,
    Task,
    evaluate_test,
    exchanged,
    fit_part,
    put_partner,
    redrawn,
    swings_freely,
)
from hand_diagnosis.search import (
    Cause,
    Isolability,
    JointSearch,
    isolability,
    on_everything,
    search_joint,
    second_look,
    with_cause,
    with_validation,
)
from hand_identification.joint_problem import JointProblem
from hand_model.arrays import Array
from hand_model.effects.effect import Effect
from hand_model.quantities import Wording


@dataclass(frozen=True, slots=True)
class JointDiagnosis(JointResult):
    """A joint: its search, its signals on validation data, and what its data can separate where something was found.

    withdrawn: effects that validation data confirm and that are not claimed, with the reason.  certificates: of an
    explained joint, the strongest attack on each signal.  left_out: errors on recordings of a machine that
    were left out of the fit, and effects that do not hold there.  causes: of the whole hand, which it has in any case.
    """

    isolability: Isolability | None = None
    withdrawn: tuple[tuple[str, str], ...] = ()
    certificates: tuple[Certificate, ...] = ()
    left_out: LeftOut | None = None
    causes: tuple[Cause, ...] = ()

    @property
    def is_contradicted(self) -> bool:
        """Whether test data contradict what was found; they may move as no other data do, and so show it better."""
        return any(reason == CONTRADICTED for _, reason in self.withdrawn)

    @property
    def broken(self) -> list[Certificate]:
        """Attacks that succeed on what the findings leave."""
        return [certificate for certificate in self.certificates if certificate.broken]


def diagnose_joint(
    task: Task,
    wording: Wording,
    joint: str,
    *seed: int,
    without: str = "",
    partner: Sequence[Array] = (),
    causes: tuple[Cause, ...] = (),
) -> JointDiagnosis:
    """One joint. partner: acceleration (T,) [rad/s^2] of its coupled partner in every segment, by the partner's model.

    without: an effect to leave out.  causes: of the whole hand, which the joint has in any case.
    """
    ready = task.prepare(joint)
    if partner:
        put_partner(ready.problem, partner)
    effects = [effect for effect in task.effects_beside(ready.problem) if effect.name != without]
    rng = np.random.default_rng([task.seed, *seed])
    found = _searched(task, wording, ready, ready.problem, effects, rng, causes)
    if any(stage.shows_held_out for stage in found.results):
        again = replace(ready, problem=redrawn(ready.problem))
        fitted = _searched(task, wording, again, again.problem, effects, rng, causes)
        if not any(stage.remains for stage in fitted.results):
            return fitted
    late = any(stage.shows_late for stage in found.results)
    other = exchanged(ready.problem) if late or found.is_contradicted else None
    if other is None:
        return found
    later = _searched(task, wording, task.with_test_data(ready, other), other, effects, rng, causes)
    explained = later.search.accepted and not any(stage.remains for stage in later.results)
    return later if explained or (late and later.search.accepted and not found.search.accepted) else found


def _searched(
    task: Task,
    wording: Wording,
    ready: Prepared,
    whole: JointProblem,
    effects: Sequence[Effect],
    rng: np.random.Generator,
    causes: tuple[Cause, ...],
) -> JointDiagnosis:
    """One joint by a search on the fitted part of a problem. whole: that of `ready`, perhaps with other test data."""
    joint, problem = whole.joint, fit_part(whole)

    def again(changed: JointProblem, laws: bool) -> JointSearch:
        begin = [partial(with_cause, cause) for cause in causes]
        free, start = unswitched(changed, ready.free, ready.start)
        return search_joint(changed, effects, free, rng, start, laws=laws, begin=begin)

    machine = task.signals[0].machine
    search = again(problem, laws=True)
    if machine:
        search = second_look(search, partial(again, laws=True))
        problem, whole = (replace(each, correlation_s=search.problem.correlation_s) for each in (problem, whole))
    results = stage_results(problem, search.nominal, search.final, len(search.accepted))
    switched, onset = search_with_onset(search, results, effects, again), None
    if switched is not None:
        search, onset = switched
        problem = search.problem
        whole = replace(with_onset(whole, onset, problem.switched), nominal=problem.nominal)
    free_axis = swings_freely(whole)
    withdrawn = () if machine else without_repeating(search)  # what repeats in a machine has a name: cogging
    confirm_laws(whole, search, free_axis=free_axis)
    last = search
    if search.accepted and not machine:
        nominal, accepted = with_validation(problem, search.nominal, search.accepted)
        last = replace(search, nominal=nominal, accepted=accepted)
    test, contradicted = tested(whole, search, last, rng, free_axis=free_axis)
    last = search if contradicted else last
    left_out = leave_one_out(whole, search) if machine and onset is None else None
    fits = (search.nominal, search.final)
    if left_out is not None and left_out.withdrawn:
        test = evaluate_test(whole, fits, free_axis=free_axis)
    results = stage_results(problem, *fits, len(search.accepted))
    results = with_other_splits(results, whole, fits, test, problem=problem, free_axis=free_axis)
    separable = [effect for effect in effects if effect.place != "force_sensor"]
    found = isolability(problem, search.nominal, separable) if search.accepted else None
    search.forget_sensitivities()
    last.forget_sensitivities()
    reported = _fitted_to_everything(whole, search, rng) if machine else last if search.accepted else None
    withdrawn += contradicted
    result = JointDiagnosis(
        joint=joint,
        search=search,
        results=tuple(results),
        wording=wording,
        test=test,
        onset=onset,
        whole=whole,
        last=reported,
        isolability=found,
        withdrawn=withdrawn,
        causes=causes,
    )
    if left_out is not None and left_out.stated_hold and len(result.claimed()) < max(len(search.accepted), 1):
        result = replace(result, last=with_stated_numbers(result.reported))
    return replace(result, certificates=_certified(result), left_out=left_out)


def _fitted_to_everything(whole: JointProblem, search: JointSearch, rng: np.random.Generator) -> JointSearch:
    """The search with its models fitted to all data, test data included; for the numbers that a machine keeps.

    Laws are completed only where a whole recording, and perhaps its condition, took no part in the search.
    """
    laws = search.laws and len(whole.segments) > len(search.problem.segments)
    problem, nominal, accepted = on_everything(whole, search.nominal, search.accepted, rng, laws=laws)
    return replace(search, problem=problem, nominal=nominal, accepted=accepted)


def _certified(result: JointDiagnosis) -> tuple[Certificate, ...]:
    """The certificates of a joint whose findings leave nothing that is probably other physics."""
    search, whole = result.search, result.whole
    if not search.accepted or whole is None or any(stage.remains for stage in result.results):
        return ()
    free_axis = swings_freely(whole)
    return certify(search.problem, whole, search.final, result.results, free_axis=free_axis)
