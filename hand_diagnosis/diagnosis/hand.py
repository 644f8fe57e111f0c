"""The diagnosis of a hand or machine: data check, every joint, findings that concern the whole hand, verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from hand_diagnosis.diagnosis.across import next_to_models, with_bends, with_causes, without_unshared
from hand_diagnosis.diagnosis.joint import JointDiagnosis, diagnose_joint
from hand_diagnosis.judgement import (
    Finding,
    Remainder,
    bound_notes,
    exchange_notes,
    number_lines,
    ranked_findings,
    remainders,
    verdict,
    withdrawn_rows,
)
from hand_diagnosis.problem import (
    Task,
    bent,
    check,
    effects_not_offered,
    effects_without,
    fit_part,
    initial_rest_angle,
    moving_joints,
    not_judged,
    repeatability,
    spared_last,
)
from hand_diagnosis.search import is_explained, moved, rough_evidence, tolerant
from hand_diagnosis.settings import SETTINGS
from hand_identification.free_parameters import FreeParameter, nominal_free_parameters
from hand_identification.joint_data import joint_problem
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit, map_fit
from hand_model.compile_cache import one_thread
from hand_model.description import Hand
from hand_model.effects.effect import Effect
from hand_model.joint_model import JointModel
from hand_model.quantities import HAND, Wording
from hand_recording.hand_signals import without_sensor_curve
from hand_recording.signals import Signals


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosis:
    """All of it.

    verdict: agrees, explained, partly_explained, unknown_physics or unusable.  check: lines of the data check.
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


@one_thread()
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
    for settled in (bent, tolerant):
        task, more = settled(task)
        lines += more
    done, failed = _each_joint(task, wording, progress)
    task, more = with_bends(task, done)
    if more:
        lines += more
        done, failed = _each_joint(task, wording, lambda _: None)
    done = without_unshared(task, next_to_models(task, done))
    try:
        done = with_causes(task, done)
    except Exception as error:  # what was found joint by joint is reported whatever becomes of causes of all joints
        lines.append(
            f"causes of the whole hand were not fitted: {' '.join(str(error).split()) or type(error).__name__}"
        )
    lines += [line for result in done for line in bound_notes(result)]
    lines += [line for result in done for line in (*_withdrawals(result), *exchange_notes(result))]
    lines += [each.statement(wording) for result in done for each in result.broken]
    lines += effects_not_offered(model)
    findings, left = ranked_findings(done, signals), remainders(done)
    reasons = not_judged(checked, [result.joint for result in done], joints) | failed
    return Diagnosis(
        verdict=_certain(verdict(findings, left, len(done)), done),
        findings=tuple(findings),
        remainder=tuple(left),
        not_judged=tuple(reasons.items()),
        joints=tuple(done),
        check=tuple(lines),
        sensor_curve=sensor_curve,
        wording=wording,
        starts_s=starts_s,
    )


def _each_joint(
    task: Task, wording: Wording, progress: Callable[[str], None]
) -> tuple[list[JointDiagnosis], dict[str, str]]:
    """Every joint by itself, and of those that cannot be diagnosed the reason. progress: as that of `diagnose`."""
    done, failed = [], {}
    for number, joint in enumerate(task.joints):
        try:
            done.append(diagnose_joint(task, wording, joint, number))
        except Exception as error:  # the other joints are diagnosed whatever this one contains
            failed[joint] = f"its diagnosis failed: {_reason(error)}"
        progress(joint)
    return done, failed


def _reason(error: Exception) -> str:
    """What an error says, in one line."""
    return " ".join(str(error).split()) or type(error).__name__


def _withdrawals(result: JointDiagnosis) -> list[str]:
    """Lines about effects that were withdrawn, and about stated numbers that hold better than fitted ones."""
    rows = withdrawn_rows(result.joint, result.left_out, result.withdrawn)
    lines = [f"{row['joint']}: {row['effect']} is withdrawn: {row['reason']}" for row in rows]
    return lines + number_lines(result.joint, result.left_out)


def _reads_through_curve(
    signals: Sequence[Signals], hand: Hand, joints: Sequence[str], tolerance: float, effects: Sequence[Effect]
) -> bool:
    """Whether the angles of most joints fit the model better once the described sensors' own error is removed.

    Each joint has one vote, unless the plain model explains neither: a joint with an effect must not decide for those
    without. Numbers that are further off than the tolerance must not decide either. Where effects hide the sensors'
    error in all joints, as in a recording of one joint, the best effect of each is fitted first.
    """
    if not joints:
        return False
    at = np.linspace(0, len(joints) - 1, SETTINGS.curve_vote_joints).round().astype(int)
    chosen = [joints[k] for k in np.unique(at)]
    straight = [without_sensor_curve(recording, hand) for recording in signals]
    gains = []
    for joint in chosen:
        tried = [_plain_cost(candidate, hand, joint, tolerance) for candidate in (signals, straight)]
        if any(explained for _, explained in tried):
            as_angle, as_reading = (max(cost, 1e-12) for cost, _ in tried)  # no usable sample costs nothing
            gains.append(float(np.log(as_angle / as_reading)))
    if gains and abs(np.median(gains)) > SETTINGS.curve_vote_margin:
        return bool(np.median(gains) > 0.0)
    gained = 0.0
    for candidate, sign in ((signals, -1.0), (straight, 1.0)):
        for joint in chosen:
            problem, free = _nominal_problem(candidate, hand, joint, tolerance)
            enough = partial(_is_plain_enough, problem)  # no effect hides the sensors' error there
            gained += sign * rough_evidence(problem, effects, free, np.random.default_rng(0), enough)[0]
    return gained > 0.0


def _is_plain_enough(problem: JointProblem, plain: MapFit, _: MapFit) -> bool:
    """See `is_explained`, of the plain model."""
    return is_explained(problem, plain)


def _plain_cost(signals: Sequence[Signals], hand: Hand, joint: str, tolerance: float) -> tuple[float, bool]:
    """Cost [-] of the plain model of a joint, its numbers being further off than the tolerance where that fits, and
    whether it explains the recordings.
    """
    costs = []
    for factor in (1.0, *SETTINGS.tolerance_factors):
        problem, free = _nominal_problem(signals, hand, joint, factor * tolerance)
        fit = map_fit(problem, free, np.zeros(len(free)), SETTINGS.rough_iterations)
        costs.append((fit.cost, is_explained(problem, fit)))
        if moved(fit) < SETTINGS.tolerance_moved:
            break
    return min(costs)


def _nominal_problem(
    signals: Sequence[Signals], hand: Hand, joint: str, tolerance: float
) -> tuple[JointProblem, list[FreeParameter]]:
    """The problem of one joint without its partner's model, and the free parameters of its nominal numbers."""
    problem = fit_part(joint_problem(signals, hand, joint))
    rested, own = initial_rest_angle(signals, joint), hand.tolerances
    return problem, nominal_free_parameters(problem.nominal, tolerance, rested, own, problem.motion_rad)


def _certain(found: str, done: Sequence[JointDiagnosis]) -> str:
    """The verdict; an explanation of which a certificate is broken is a part of one."""
    return "partly_explained" if found == "explained" and any(result.broken for result in done) else found
