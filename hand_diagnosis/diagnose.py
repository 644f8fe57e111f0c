"""The whole diagnosis of a hand: data check, every joint, findings that concern the hand, verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hand_diagnosis.correction import sparse_correction
from hand_diagnosis.data_check import Checked, check
from hand_diagnosis.findings import Finding, joint_findings, unknown_finding
from hand_diagnosis.isolability import Isolability, isolability
from hand_diagnosis.partners import fits_better, model_accelerations, put_partner
from hand_diagnosis.repeatability import floors
from hand_diagnosis.search import JointSearch, rough_evidence, search_joint
from hand_diagnosis.task import Task, rested
from hand_diagnosis.verdict import StageResult, describe, stage_results
from hand_identification.free_parameters import FARTHEST, WIDE, FreeParameter, nominal_free_parameters
from hand_identification.joint_data import joint_problem
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import map_fit
from hand_model.arrays import Array
from hand_model.description import Hand
from hand_model.effects import CATALOGUE, EFFECTS
from hand_model.effects.effect import Effect
from hand_model.kernel.plant_rows import PLANT_PARAMETERS
from hand_recording.hand_signals import without_sensor_curve
from hand_recording.signals import Signals

MOVES_RAD = np.radians(2.0)
"""A joint that moves less tells nothing."""
PUSHED_RAD = np.radians(10.0)
EXCITED_PA = 1e4
"""A joint with less pressure is not excited, unless something moves it by more than PUSHED_RAD."""
CURVE_JOINTS = 5
SHARED_JOINTS = 0.5
"""Share of the joints that must show an effect of the whole hand."""
CURVE_UNSURE = 0.1
"""Of the logarithm of the cost's ratio: closer than this, the nominal model alone cannot tell."""


@dataclass(frozen=True, slots=True)
class JointDiagnosis:
    """A joint: the search, its stages on held-out data, what its data can tell apart (where something was found)."""

    joint: str
    search: JointSearch
    results: tuple[StageResult, ...]
    isolability: Isolability | None


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """All of it. verdict: agrees, explained, partly_explained or unknown_physics.  check: lines of the data check."""

    verdict: str
    findings: tuple[Finding, ...]
    joints: tuple[JointDiagnosis, ...]
    check: tuple[str, ...]
    sensor_curve: bool


def diagnose(
    signals: Sequence[Signals],
    hand: Hand,
    *,
    tolerance: float,
    seed: int,
    joints: Sequence[str] = (),
    without: Sequence[str] = (),
    sensor_curve: bool | None = None,
    reruns: Sequence[Signals] = (),
    progress: Callable[[str], None] = lambda _: None,
) -> Diagnosis:
    """Diagnose recordings. tolerance: relative standard deviation of the nominal numbers.  without: effects left out.

    sensor_curve: whether angles are readings of the described Hall sensors; None: what fits better.
    reruns: recordings of the same commands; what differs between them is never claimed.
    Raises ValueError for joints or effects that do not exist, and for a re-run of other commands.
    """
    effects = _effects(without)
    checked = [check(one, hand) for one in signals]
    signals = [one.signals for one in checked]
    unusable = frozenset().union(*(one.unusable for one in checked))
    again = [check(one, hand) for one in reruns]
    reruns = [_usable(one) for one in again]
    wanted = _joints(signals, hand, joints, unusable)
    if sensor_curve is None:  # of all joints that move, also those that are not asked for: they vote
        sensor_curve = _reads_through_curve(signals, hand, _joints(signals, hand, (), unusable), tolerance, effects)
    if sensor_curve:
        signals = [without_sensor_curve(one, hand) for one in signals]
        reruns = [without_sensor_curve(one, hand) for one in reruns]
    lines = [line for one in (*checked, *again) for line in (*one.signals.notes, *one.lines)]
    lines += [line for one in checked for line in _still(one, wanted, joints)]
    task = Task(signals, hand, wanted, effects, tolerance, seed, floors(signals, reruns))
    done = []
    for number, joint in enumerate(wanted):
        done.append(_diagnose_joint(task, joint, number))
        progress(joint)
    done = _without_lonely(task, _beside_models(task, done))
    lines += [line for one in done for line in _at_bounds(one)]
    findings = [*_dropped(signals), *_ranked(done)]
    return Diagnosis(_verdict(findings, done), tuple(findings), tuple(done), tuple(lines), sensor_curve)


def _usable(rerun: Checked) -> Signals:
    """A re-run that says nothing of joints whose channels are at fault."""
    at_fault = [joint in rerun.unusable for joint in rerun.signals.joints]
    return replace(rerun.signals, known=rerun.signals.known & ~np.array(at_fault, dtype=bool))


def _effects(without: Sequence[str]) -> list[Effect]:
    for name in without:
        if name not in EFFECTS:
            raise ValueError(f"--without is {name!r}; the effects are: {', '.join(EFFECTS)}")
    return [effect for effect in CATALOGUE if effect.keys and effect.name not in without]


def _joints(signals: Sequence[Signals], hand: Hand, joints: Sequence[str], unusable: frozenset[str]) -> list[str]:
    recorded = [joint for joint in hand.joints if any(joint in one.joints for one in signals)]
    for joint in joints:
        if joint not in recorded:
            raise ValueError(f"--joints: {joint!r} was not recorded; the recordings hold: {', '.join(recorded)}")
    able = [joint for joint in joints or recorded if joint not in unusable]
    return [joint for joint in able if any(_moves(one, joint) for one in signals)]


def _moves(one: Signals, joint: str) -> bool:
    """Whether a joint is excited: by pressure, or far enough from outside; a vented one that is only shaken is not."""
    if joint not in one.joints:
        return False
    column = one.joints.index(joint)
    angle, pressure = np.ptp(one.angle_rad[:, column]), np.ptp(one.pressure_pa[:, column])
    return bool(angle > PUSHED_RAD or (angle > MOVES_RAD and (pressure > EXCITED_PA or one.driven)))


def _still(checked: Checked, wanted: Sequence[str], asked: Sequence[str]) -> list[str]:
    one = checked.signals
    told = {*wanted, *checked.unusable}
    still = [joint for joint in asked or one.joints if joint in one.joints and joint not in told]
    return [f"{one.name}: {', '.join(still)} too little motion to judge"] if still else []


def _reads_through_curve(
    signals: Sequence[Signals], hand: Hand, joints: Sequence[str], tolerance: float, effects: Sequence[Effect]
) -> bool:
    """Whether the angles of most joints fit the model better once the described sensors' own error is taken back.

    Each joint has one vote: a joint with an effect must not decide for those without. Where effects hide the sensors'
    error in most, as in a recording of one joint that misses something, the best effect of each is fitted first.
    """
    if not joints:
        return False
    chosen = [joints[k] for k in np.unique(np.linspace(0, len(joints) - 1, CURVE_JOINTS).round().astype(int))]
    straight = [without_sensor_curve(one, hand) for one in signals]
    gains = []
    for joint in chosen:
        costs = []
        for candidate in (signals, straight):
            problem, free = _plain(candidate, hand, joint, tolerance)
            costs.append(map_fit(problem, free, np.zeros(len(free)), 3).cost)
        gains.append(float(np.log(max(costs[0], 1e-12) / max(costs[1], 1e-12))))  # no usable sample costs nothing
    if abs(np.median(gains)) > CURVE_UNSURE:
        return bool(np.median(gains) > 0.0)
    gained = 0.0
    for candidate, sign in ((signals, -1.0), (straight, 1.0)):
        for joint in chosen:
            problem, free = _plain(candidate, hand, joint, tolerance)
            gained += sign * rough_evidence(problem, effects, free, np.random.default_rng(0))
    return gained > 0.0


def _plain(
    signals: Sequence[Signals], hand: Hand, joint: str, tolerance: float
) -> tuple[JointProblem, list[FreeParameter]]:
    """A joint by itself, and the free parameters of its nominal numbers."""
    problem = joint_problem(signals, hand, joint)
    return problem, nominal_free_parameters(problem.nominal, tolerance, rested(signals, joint))


def _diagnose_joint(
    task: Task, joint: str, *seed: int, without: str = "", accelerations: Sequence[Array] = ()
) -> JointDiagnosis:
    """One joint. accelerations: of its coupled partner in every segment, where its model knows them better."""
    ready = task.prepare(joint)
    problem = ready.problem
    if accelerations:
        put_partner(problem, accelerations)
    effects = [effect for effect in task.effects if effect.name != without]
    rng = np.random.default_rng([task.seed, *seed])
    search = search_joint(problem, effects, ready.free, rng, ready.start)
    results = tuple(stage_results(problem, search.nominal, search.final, len(search.accepted)))
    judged = [effect for effect in effects if effect.place != "force_sensor"]
    told = isolability(problem, search.nominal, judged) if search.accepted else None
    _forget_slopes(search)
    return JointDiagnosis(joint, search, results, told)


def _at_bounds(one: JointDiagnosis) -> list[str]:
    """Nominal numbers that would go farther than they may: a model this far off needs another tolerance."""
    fit, own = one.search.final, one.search.effect_keys.union(WIDE)
    far = [
        parameter.key
        for parameter, z in zip(fit.free, fit.z, strict=True)
        if parameter.row < len(PLANT_PARAMETERS) and parameter.key not in own and abs(z) > FARTHEST - 1e-6
    ]
    reason = f"ends {FARTHEST:g} tolerances from its nominal value; expect more with --tolerance?"
    return [f"{one.joint}: {', '.join(far)} {reason}"] if far else []


def _forget_slopes(search: JointSearch) -> None:
    """Residuals are still drawn; sensitivities have done their work and are large."""
    search.nominal = replace(search.nominal, sensitivity=())
    if search.accepted:
        last = search.accepted[-1]
        search.accepted[-1] = replace(last, fit=replace(last.fit, sensitivity=()))


def _beside_models(task: Task, done: Sequence[JointDiagnosis]) -> list[JointDiagnosis]:
    """Joints that miss something, judged anew where their partner's model explains it better than its sensor."""
    at = {one.joint: one for one in done}
    renewed = list(done)
    for k, one in enumerate(done):
        other = at.get(task.partner(one.joint))
        if other is None or not (one.search.accepted or any(result.unexplained for result in one.results)):
            continue
        if [p.name for p in other.search.problem.segments] != [p.name for p in one.search.problem.segments]:
            continue
        accelerations = model_accelerations(other.search.problem, other.search.final)
        if fits_better(one.search.problem, one.search.nominal, accelerations):
            renewed[k] = _diagnose_joint(task, one.joint, k, 2, accelerations=accelerations)
    return renewed


def _without_lonely(task: Task, done: list[JointDiagnosis]) -> list[JointDiagnosis]:
    """Effects of the whole hand that only few of several joints show are no such effects: judge these joints anew."""
    if len(done) < 3:
        return done
    for name in [effect.name for effect in task.effects if effect.everywhere]:
        having = [k for k, one in enumerate(done) if any(h.effect.name == name for h in one.search.accepted)]
        if having and len(having) < SHARED_JOINTS * len(done):
            for k in having:
                done[k] = _diagnose_joint(task, done[k].joint, k, 1, without=name)
    return done


def _ranked(done: Sequence[JointDiagnosis]) -> list[Finding]:
    """Findings of every joint by how much they explain; one of the whole hand only once."""
    scored: list[tuple[float, Finding]] = []
    for one in done:
        worst = max(one.results, key=lambda r: r.excess_after * r.unexplained, default=None)
        weight = one.search.final.cost
        gain = one.search.nominal.cost - weight
        if worst is not None and worst.unexplained:
            structure = describe(one.search.problem, one.search.final, worst.stage)
            correction = sparse_correction(one.search.problem, one.search.final, worst.stage)
            scored.append((gain + weight, unknown_finding(one.joint, one.search, worst, structure, correction)))
            continue
        for order, finding in enumerate(joint_findings(one.joint, one.search, one.results)):
            scored.append((gain / (order + 1.0), finding))
    scored.sort(key=lambda pair: -pair[0])
    unique: list[Finding] = []
    for _, finding in scored:
        if finding.joint is None and any(f.joint is None and f.effect == finding.effect for f in unique):
            continue
        unique.append(finding)
    return unique


def _dropped(signals: Sequence[Signals]) -> list[Finding]:
    """Missing frames, as the stamps tell."""
    found = []
    for one in signals:
        share = max(one.dropped, _lost(one))
        if share > DROPPED:
            statement = f"{one.name}: {share:.2%} of the frames are missing; gaps are bridged and not judged."
            found.append(
                Finding(None, "timing", "dropped_frames", 0.99, (), (), "stamps", "gaps between stamps", (), statement)
            )
    return found


def _lost(one: Signals) -> float:
    """Share of samples without any reading between the first and the last; topics need not begin or end together."""
    read = np.flatnonzero(one.known.any(axis=1))
    return 1.0 - len(read) / (read[-1] - read[0] + 1) if len(read) else 0.0


DROPPED = 2e-3
"""Share of missing frames that is worth a finding."""


def _verdict(findings: Sequence[Finding], done: Sequence[JointDiagnosis]) -> str:
    names = {finding.effect for finding in findings}
    if not names:
        return "agrees"
    if "unknown" in names:
        return "unknown_physics" if names <= {"unknown", "dropped_frames"} else "partly_explained"
    left = any(result.leftover for one in done for result in one.results if one.search.accepted)
    return "partly_explained" if left else "explained"
