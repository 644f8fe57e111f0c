"""The diagnosis of a hand or machine: data check, every joint, findings that concern the whole hand, verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hand_diagnosis.judgement import (
    Certificate,
    Finding,
    JointResult,
    LeftOut,
    Remainder,
    bound_notes,
    certify,
    confirm_laws,
    exchange_notes,
    leave_one_out,
    ranked_findings,
    remainders,
    search_with_onset,
    stage_results,
    tested,
    verdict,
    with_onset,
    with_other_splits,
    withdrawn_rows,
    without_repeating,
)
from hand_diagnosis.problem import (
    Prepared,
    Task,
    check,
    effects_not_offered,
    effects_without,
    evaluate_test,
    exchanged,
    fit_part,
    initial_rest_angle,
    likelihood_below_floor,
    model_accelerations,
    moving_joints,
    not_judged,
    put_partner,
    repeatability,
    spared_last,
    swings_freely,
    tolerant,
)
from hand_diagnosis.search import (
    Isolability,
    JointSearch,
    isolability,
    on_everything,
    refit_below_floor,
    rough_evidence,
    search_joint,
    with_validation,
)
from hand_diagnosis.settings import SETTINGS
from hand_identification.free_parameters import FreeParameter, nominal_free_parameters
from hand_identification.joint_data import joint_problem
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit, map_fit
from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.effects.effect import PARTNER, Effect
from hand_model.joint_model import JointModel
from hand_model.quantities import HAND, Wording
from hand_recording.hand_signals import without_sensor_curve
from hand_recording.signals import Signals


@dataclass(frozen=True, slots=True)
class JointDiagnosis(JointResult):
    """A joint: its search, its signals on validation data, and what its data can separate where something was found.

    withdrawn: effects that validation data confirm and that are not claimed, with the reason.  certificates: of an
    explained joint, the strongest attack on each signal.  left_out: errors on recordings of a machine that
    were left out of the fit, and effects that do not hold there.
    """

    isolability: Isolability | None = None
    withdrawn: tuple[tuple[str, str], ...] = ()
    certificates: tuple[Certificate, ...] = ()
    left_out: LeftOut | None = None

    @property
    def broken(self) -> list[Certificate]:
        """Attacks that succeed on what the findings leave."""
        return [certificate for certificate in self.certificates if certificate.broken]


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosis:
    """All of it. verdict: agrees, explained, partly_explained or unknown_physics.  check: lines of the data check.

    remainder: what is left that is probably other physics.  not_judged: joints without a diagnosis, and why.
    starts_s: first stamp of each recording since 1970 [s]; None where its stamps do not give the date.
    """

    verdict: str
    findings: tuple[Finding, ...]
    remainder: tuple[Remainder, ...]
    not_judged: tuple[tuple[str, str], ...]
    joints: tuple[JointDiagnosis, ...]
    check: tuple[str, ...]
    sensor_curve: bool
    wording: Wording = HAND
    starts_s: tuple[float | None, ...] = ()


def diagnose(
    signals: Sequence[Signals],
    model: JointModel,
    *,
    tolerance: float,
    seed: int,
    joints: Sequence[str] = (),
    without: Sequence[str] = (),
    sensor_curve: bool | None = None,
    reruns: Sequence[Signals] = (),
    wording: Wording = HAND,
    progress: Callable[[str], None] = lambda _: None,
) -> Diagnosis:
    """Diagnose recordings of a hand or machine.

    tolerance: relative standard deviation of the nominal numbers [-].  without: names of effects left out.
    sensor_curve: whether angles are readings of the described Hall sensors; None: what fits better.
    reruns: recordings of the same commands; what differs between them is never claimed.
    wording: units and words of findings.  progress: called with each joint that is done.
    Raises ValueError for joints or effects that do not exist, and for a re-run of other commands.
    """
    effects = effects_without(without, model)
    starts_s = tuple(recording.start_s for recording in signals)
    checked = [check(recording, model) for recording in signals]
    signals = spared_last([each.signals for each in checked])
    unusable = frozenset().union(*(each.unusable for each in checked))
    checked_reruns = [check(rerun, model) for rerun in reruns]
    reruns = [each.without_unusable() for each in checked_reruns]
    wanted = moving_joints(signals, model, joints, unusable)
    if sensor_curve is None:  # all moving joints vote, also those that are not asked for
        voters = moving_joints(signals, model, (), unusable)
        sensor_curve = isinstance(model, Hand) and _reads_through_curve(signals, model, voters, tolerance, effects)
    if sensor_curve and isinstance(model, Hand):
        signals = [without_sensor_curve(recording, model) for recording in signals]
        reruns = [without_sensor_curve(recording, model) for recording in reruns]
    lines = [line for each in (*checked, *checked_reruns) for line in (*each.signals.notes, *each.lines)]
    task = Task(
        signals=signals,
        model=model,
        joints=wanted,
        effects=effects,
        tolerance=tolerance,
        seed=seed,
        floors=repeatability(signals, reruns),
    )
    task, more = tolerant(task)
    lines += more
    done, failed = [], {}
    for number, joint in enumerate(wanted):
        try:
            done.append(_diagnose_joint(task, wording, joint, number))
        except Exception as error:  # the other joints are diagnosed whatever this one contains
            failed[joint] = f"its diagnosis failed: {' '.join(str(error).split()) or type(error).__name__}"
        progress(joint)
    done = _without_unshared(task, _beside_models(task, done))
    lines += [line for result in done for line in bound_notes(result)]
    lines += [line for result in done for line in (*_withdrawals(result), *exchange_notes(result))]
    lines += [each.statement(wording) for result in done for each in result.broken]
    lines += effects_not_offered(model)
    findings, left = ranked_findings(done, signals), remainders(done)
    reasons = not_judged(checked, [result.joint for result in done], joints) | failed
    return Diagnosis(
        verdict=_certain(verdict(findings, left), done),
        findings=tuple(findings),
        remainder=tuple(left),
        not_judged=tuple(reasons.items()),
        joints=tuple(done),
        check=tuple(lines),
        sensor_curve=sensor_curve,
        wording=wording,
        starts_s=starts_s,
    )


def _withdrawals(result: JointDiagnosis) -> list[str]:
    """Lines about effects that were withdrawn."""
    rows = withdrawn_rows(result.joint, result.left_out, result.withdrawn)
    return [f"{row['joint']}: {row['effect']} is withdrawn: {row['reason']}" for row in rows]


def _reads_through_curve(
    signals: Sequence[Signals], hand: Hand, joints: Sequence[str], tolerance: float, effects: Sequence[Effect]
) -> bool:
    """Whether the angles of most joints fit the model better once the described sensors' own error is removed.

    Each joint has one vote: a joint with an effect must not decide for those without. Where effects hide the sensors'
    error in most joints, as in a recording of one joint, the best effect of each is fitted first.
    """
    if not joints:
        return False
    at = np.linspace(0, len(joints) - 1, SETTINGS.curve_vote_joints).round().astype(int)
    chosen = [joints[k] for k in np.unique(at)]
    straight = [without_sensor_curve(recording, hand) for recording in signals]
    gains = []
    for joint in chosen:
        costs = []
        for candidate in (signals, straight):
            problem, free = _nominal_problem(candidate, hand, joint, tolerance)
            costs.append(map_fit(problem, free, np.zeros(len(free)), SETTINGS.rough_iterations).cost)
        gains.append(float(np.log(max(costs[0], 1e-12) / max(costs[1], 1e-12))))  # no usable sample costs nothing
    if abs(np.median(gains)) > SETTINGS.curve_vote_margin:
        return bool(np.median(gains) > 0.0)
    gained = 0.0
    for candidate, sign in ((signals, -1.0), (straight, 1.0)):
        for joint in chosen:
            problem, free = _nominal_problem(candidate, hand, joint, tolerance)
            gained += sign * rough_evidence(problem, effects, free, np.random.default_rng(0))
    return gained > 0.0


def _nominal_problem(
    signals: Sequence[Signals], hand: Hand, joint: str, tolerance: float
) -> tuple[JointProblem, list[FreeParameter]]:
    """The problem of one joint without its partner's model, and the free parameters of its nominal numbers."""
    problem = fit_part(joint_problem(signals, hand, joint))
    return problem, nominal_free_parameters(problem.nominal, tolerance, initial_rest_angle(signals, joint))


def _diagnose_joint(
    task: Task, wording: Wording, joint: str, *seed: int, without: str = "", partner: Sequence[Array] = ()
) -> JointDiagnosis:
    """One joint. partner: acceleration (T,) [rad/s^2] of its coupled partner in every segment, by the partner's model.

    without: an effect to leave out.
    """
    ready = task.prepare(joint)
    if partner:
        put_partner(ready.problem, partner)
    effects = [effect for effect in task.effects if effect.name != without]
    rng = np.random.default_rng([task.seed, *seed])
    found = _searched(task, wording, ready, ready.problem, effects, rng)
    other = exchanged(ready.problem) if _shows_late(found) else None
    if other is None:
        return found
    later = _searched(task, wording, ready, other, effects, rng)
    explained = later.search.accepted and not any(stage.remains for stage in later.results)
    return later if explained or (later.search.accepted and not found.search.accepted) else found


def _shows_late(found: JointDiagnosis) -> bool:
    """Whether a signal differs on test data, and not on training data, which so cannot show why."""
    on_test = [stage for stage in found.results if stage.remains_on("test")]
    return any(not stage.remains_on("train") for stage in on_test)


def _searched(
    task: Task,
    wording: Wording,
    ready: Prepared,
    whole: JointProblem,
    effects: Sequence[Effect],
    rng: np.random.Generator,
) -> JointDiagnosis:
    """One joint by a search on the fitted part of a problem. whole: that of `ready`, perhaps with other test data."""
    joint, problem = whole.joint, fit_part(whole)

    def again(changed: JointProblem, laws: bool) -> JointSearch:
        return search_joint(changed, effects, ready.free, rng, ready.start, laws=laws)

    search = again(problem, laws=True)
    results = stage_results(problem, search.nominal, search.final, len(search.accepted))
    switched, onset = search_with_onset(search, results, effects, again), None
    if switched is not None:
        search, onset, rows = switched
        problem, whole = search.problem, with_onset(whole, onset, rows)
    machine = task.signals[0].machine
    free_axis = swings_freely(whole)
    withdrawn = () if machine else without_repeating(search)  # what repeats in a machine has a name: cogging
    confirm_laws(whole, search, free_axis=free_axis)
    last = search
    if search.accepted and not machine:
        nominal, accepted = with_validation(problem, search.nominal, search.accepted)
        last = replace(search, nominal=nominal, accepted=accepted)
    test, contradicted = tested(whole, search, last, rng, free_axis=free_axis)
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
    )
    return replace(result, certificates=_certified(result), left_out=left_out)


def _fitted_to_everything(whole: JointProblem, search: JointSearch, rng: np.random.Generator) -> JointSearch:
    """The search with its models fitted to all data, test data included; for the numbers that a machine keeps.

    Laws are completed only where a whole recording, and perhaps its condition, took no part in the search.
    """
    laws = search.laws and len(whole.segments) > len(search.problem.segments)
    problem, nominal, accepted = on_everything(whole, search.nominal, search.accepted, rng, laws=laws)
    return replace(search, problem=problem, nominal=nominal, accepted=accepted)


def _certain(found: str, done: Sequence[JointDiagnosis]) -> str:
    """The verdict; an explanation of which a certificate is broken is a part of one."""
    return "partly_explained" if found == "explained" and any(result.broken for result in done) else found


def _certified(result: JointDiagnosis) -> tuple[Certificate, ...]:
    """The certificates of a joint whose findings leave nothing that is probably other physics."""
    search, whole = result.search, result.whole
    if not search.accepted or whole is None or any(stage.remains for stage in result.results):
        return ()
    free_axis = swings_freely(whole)
    return certify(search.problem, whole, search.final, result.results, free_axis=free_axis)


def _beside_models(task: Task, done: Sequence[JointDiagnosis]) -> list[JointDiagnosis]:
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
        partner = model_accelerations(problem, other.search.final)
        if _fits_better(own, result.search.final, partner):
            renewed[k] = _diagnose_joint(task, result.wording, result.joint, k, 2, partner=partner)
    return renewed


def _differs(result: JointDiagnosis) -> bool:
    """Whether a joint has an effect, or more than its noise is left."""
    return bool(result.search.accepted) or any(stage.remains for stage in result.results)


def _fits_better(whole: JointProblem, fit: MapFit, partner: Sequence[Array]) -> bool:
    """Whether the model of a joint fits clearly better with these accelerations of its partner.

    What the joint lacks itself may be large, and the push of its partner small, so that only errors below the practical
    floor show it.
    """
    measured = [segment.exogenous[:, PARTNER].copy() for segment in whole.segments]
    problem = fit_part(whole)  # its arrays are those of the whole problem
    fits = []
    for accelerations in (measured, partner):
        put_partner(whole, accelerations)
        fits.append(refit_below_floor(problem, map_fit(problem, fit.free, fit.z, SETTINGS.rough_iterations)))
    put_partner(whole, measured)
    before, after = (likelihood_below_floor(problem, fits[0], each) for each in fits)
    return after > before + SETTINGS.min_partner_gain


def _without_unshared(task: Task, done: list[JointDiagnosis]) -> list[JointDiagnosis]:
    """Effects of the whole hand that few of at least three joints show are none: diagnose these joints again."""
    if len(done) < 3:
        return done
    for name in [effect.name for effect in task.effects if effect.everywhere]:
        having = [k for k, each in enumerate(done) if any(h.effect.name == name for h in each.search.accepted)]
        if having and len(having) < SETTINGS.min_sharing_joints * len(done):
            for k in having:
                done[k] = _diagnose_joint(task, done[k].wording, done[k].joint, k, 1, without=name)
    return done
