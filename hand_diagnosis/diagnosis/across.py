"""What several joints show together: partners, effects that few joints share, causes of the whole hand."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from hand_diagnosis.diagnosis.joint import JointDiagnosis, diagnose_joint
from hand_diagnosis.problem import (
    Task,
    bending_line,
    fit_part,
    likelihood_below_floor,
    log_evidence,
    model_accelerations,
    put_partner,
)
from hand_diagnosis.search import Cause, refit_below_floor, whole_hand_cause
from hand_diagnosis.settings import SETTINGS
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit, map_fit
from hand_model.arrays import Array
from hand_model.effects.effect import PARTNER


def next_to_models(task: Task, done: Sequence[JointDiagnosis]) -> list[JointDiagnosis]:
    """Joints of pairs in which one differs, diagnosed again where the partner's model explains more than its sensor."""
    at = {result.joint: result for result in done}
    renewed = list(done)
    for k, result in enumerate(done):
        other = at.get(task.partner(result.joint))
        if other is None or not any(_differs(each) for each in (result, other)):
            continue
        problem, own = other.whole, result.whole
        if problem is None or own is None or [p.name for p in problem.segments] != [p.name for p in own.segments]:
            continue
        partner = task.with_bending(result.joint, model_accelerations(problem, other.search.final))
        if _gained_below_floor(own, [result.search.final], partner) > SETTINGS.min_partner_gain:
            renewed[k] = diagnose_joint(task, result.wording, result.joint, k, 2, partner=partner)
    return renewed


def _differs(result: JointDiagnosis) -> bool:
    """Whether a joint has an effect, or more than its noise is left."""
    return bool(result.search.accepted) or _remains(result)


def with_bends(task: Task, done: Sequence[JointDiagnosis]) -> tuple[Task, list[str]]:
    """The task with an inertia that changes with the bend of the fingers, and a line, where the models found say so.

    A large effect hides the bend from the plain models. So where something remains, all joints are asked again, each
    with its best model or one of those that began best.
    """
    if task.bends or not any(_remains(each) for each in done):
        return task, []
    gains = {}
    for each in done:
        added, whole = task.added_by_bending(each.joint), each.whole
        if not added or whole is None or len(added) != len(whole.segments):
            continue
        moved = [segment.exogenous[:, PARTNER] + more for segment, more in zip(whole.segments, added, strict=True)]
        begun = each.search.rounds[0][: SETTINGS.bending_leaders] if each.search.rounds else []
        gained = _gained if _remains(each) else _gained_below_floor
        gains[each.joint] = gained(whole, [each.search.final, *(hypothesis.fit for hypothesis in begun)], moved)
    line = bending_line(gains)
    return (replace(task.with_tolerance(1.0), bends=True), [line]) if line else (task, [])


def _remains(result: JointDiagnosis) -> bool:
    """Whether more than the noise of a joint is left."""
    return any(stage.remains for stage in result.results)


def _gained(whole: JointProblem, fits: Sequence[MapFit], partner: Sequence[Array]) -> float:
    """Log evidence [nats] of all fitted data that the best of some models gains with accelerations of its partner."""
    problem, before, after = _both_ways(whole, fits, partner, lambda _, fit: fit)
    return log_evidence(problem, after) - log_evidence(problem, before)


def _gained_below_floor(whole: JointProblem, fits: Sequence[MapFit], partner: Sequence[Array]) -> float:
    """Log likelihood [nats] of the validation data that it gains, against white noise.

    What the joint lacks itself may be large, and the push of its partner small, so that only errors below the practical
    floor show it.
    """
    problem, before, after = _both_ways(whole, fits, partner, refit_below_floor)
    return likelihood_below_floor(problem, before, after) - likelihood_below_floor(problem, before, before)


def _both_ways(
    whole: JointProblem,
    fits: Sequence[MapFit],
    partner: Sequence[Array],
    ended: Callable[[JointProblem, MapFit], MapFit],
) -> tuple[JointProblem, MapFit, MapFit]:
    """The fitted part of a problem, and the best model with its own accelerations of the partner and with these.

    ended: how each of the two is fitted on.
    """
    measured = [segment.exogenous[:, PARTNER].copy() for segment in whole.segments]
    problem = fit_part(whole)  # its arrays are those of the whole problem
    found = []
    for accelerations in (measured, partner):
        put_partner(whole, accelerations)
        again = [map_fit(problem, fit.free, fit.z, SETTINGS.rough_iterations) for fit in fits]
        found.append(ended(problem, min(again, key=lambda fit: fit.cost)))
    put_partner(whole, measured)
    return problem, found[0], found[1]


def without_unshared(task: Task, done: list[JointDiagnosis]) -> list[JointDiagnosis]:
    """Effects of the whole hand that few of at least three joints show are none: diagnose these joints again."""
    if len(done) < 3:
        return done
    for name in [effect.name for effect in task.effects if effect.everywhere]:
        having = [k for k, each in enumerate(done) if any(h.effect.name == name for h in each.search.accepted)]
        if having and len(having) < SETTINGS.min_sharing_joints * len(done):
            for k in having:
                done[k] = diagnose_joint(task, done[k].wording, done[k].joint, k, 1, without=name)
    return done


def with_causes(task: Task, done: list[JointDiagnosis]) -> list[JointDiagnosis]:
    """Joints diagnosed again with causes of the whole hand, where one explains all of them better than each alone."""
    for number in range(SETTINGS.max_causes):
        if sum(_differs(each) for each in done) < 2:
            break
        have = {cause.effect for each in done for cause in each.causes}
        effects = [effect for effect in task.effects if effect not in have]
        rng = np.random.default_rng([task.seed, number])
        cause = whole_hand_cause([each.search for each in done], effects, rng)
        if cause is None:
            break
        done = [
            _again_with(task, each, k, cause) if each.joint in cause.starts else each for k, each in enumerate(done)
        ]
    return done


def _again_with(task: Task, result: JointDiagnosis, number: int, cause: Cause) -> JointDiagnosis:
    """A joint diagnosed again with a further cause, next to the same model of its partner."""
    whole = result.whole
    partner = () if whole is None else [segment.exogenous[:, PARTNER].copy() for segment in whole.segments]
    causes = (*result.causes, cause)
    return diagnose_joint(task, result.wording, result.joint, number, 3, partner=partner, causes=causes)
