"""What to record next: the experiment that separates an uncertain finding from its strongest rival, by simulation."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from hand_diagnosis import machine_experiments
from hand_diagnosis.diagnosis import Diagnosis
from hand_diagnosis.judgement import Finding
from hand_diagnosis.search import Hypothesis
from hand_diagnosis.settings import SETTINGS
from hand_identification.excitation import EXPERIMENTS
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit
from hand_identification.settings import FITS
from hand_model.arrays import Array
from hand_model.kernel.closed_loop import ClosedLoop
from hand_model.kernel.layout import PHI, P, resting_states
from hand_model.quantities import Wording

BY_HAND = {"closed_valve_push"}
"""Experiments whose outcome depends on what a person does; they cannot be simulated."""
BY_HAND_HOW = {
    "second_attitude": "record the same set-points again with the hand turned",
    "neighbour_moves": "record again while the neighbouring joints move and this one is held",
    "stops": "press the joint to both ends of its travel",
    "free_space": "record the same set-points again with nothing in reach: an obstacle is gone then, a stop is not",
}
"""What a person does with a hand, by experiment without a command."""
SIMULATED = tuple(name for name in EXPERIMENTS if name not in BY_HAND)


def tie_separations(diagnosis: Diagnosis) -> list[dict[str, str] | None]:
    """For each finding the experiment that separates it from what it ties with; None for a finding without a tie.

    Keys: why, a sentence; name of the experiment and its command, or, on another machine than a hand, `how`, what to do
    there. Both are missing where no experiment of the catalogue separates them.
    """
    return [_tie_separation(diagnosis, finding) if finding.tied_with else None for finding in diagnosis.findings]


def _tie_separation(diagnosis: Diagnosis, finding: Finding) -> dict[str, str]:
    """The experiment that separates a finding from most of the effects it ties with, and of those by most.

    Effects with the same equation differ by their numbers alone, so that a simulation of both separates nothing.
    """
    fitted = _fitted_together(diagnosis, finding, finding.tied_with)
    if not fitted:
        return {"why": "the effects were not fitted to the same data, so that their difference cannot be simulated"}
    problem, own, rivals = fitted[-1]
    sigmas = {
        name: [separation_sigma(problem, own.fit, rival.fit, name) for rival in rivals] for name in _simulated(problem)
    }
    recorded = [_recorded_sigma(problem, own.fit, rival.fit) for rival in rivals]
    needed = {
        name: [
            0 if rival.effect.name in own.effect.alike else recordings_needed(s, r)
            for rival, s, r in zip(rivals, each, recorded, strict=True)
        ]
        for name, each in sigmas.items()
    }
    best = max(sigmas, key=lambda name: (sum(map(bool, needed[name])), min(sigmas[name])))
    if not any(needed[best]):
        return _not_simulated(diagnosis, finding, (problem, (own, *rivals)), max(map(max, sigmas.values())))
    names = [rival.effect.name for rival, count in zip(rivals, needed[best], strict=True) if count]
    least = min(sigma for sigma, count in zip(sigmas[best], needed[best], strict=True) if count)
    where = finding.joint or diagnosis.wording.whole
    shares = {name: f"{name} ({share:.0%})" for name, share, _ in finding.alternatives}
    rival_names = " and ".join(shares.get(name, name) for name in names)
    why = f"separates {finding.effect} ({finding.probability:.0%}) from {rival_names} on {where}; in simulation"
    why += f" {'the two' if len(names) == 1 else 'they'} differ by {least:.2g} sigma"
    if max(needed[best]) > 1:
        why += f", so that {max(needed[best])} such recordings break the tie"
    left = [rival.effect.name for rival, count in zip(rivals, needed[best], strict=True) if not count]
    if left:
        why += f"; no experiment of the catalogue separates it from {' and '.join(left)} as well"
    return _experiment(best, why, finding.joint, diagnosis.wording, problem)


def recordings_needed(sigma: float, recorded_sigma: float) -> int:
    """How many recordings of an experiment break a tie by evidence; 0 where it adds little to what was recorded.

    sigma, recorded_sigma: difference of the two models on the experiment and on the recorded set-points [sigma]. The
    log evidence of a difference of s sigma is s^2 / 2, and adds up over recordings. More than
    SETTINGS.tie_recordings count as 0.
    """
    if sigma <= SETTINGS.min_separation_gain * recorded_sigma or sigma <= 0.0:
        return 0
    count = max(1, math.ceil(SETTINGS.tie_log_evidence / (0.5 * sigma * sigma)))
    return count if count <= SETTINGS.tie_recordings else 0


def _not_simulated(
    diagnosis: Diagnosis, finding: Finding, fitted: tuple[JointProblem, Sequence[Hypothesis]], sigma: float
) -> dict[str, str]:
    """An experiment of the catalogue that is arranged by hand, best one that shows a single effect; else why none."""
    problem, hypotheses = fitted
    differ = f"in simulation of every other experiment they differ by at most {sigma:.2g} sigma"
    every = [(name, each.effect.name) for each in hypotheses for name in each.effect.experiments]
    shown_by = Counter(name for name, _ in every)
    arranged = [(name, effect) for name, effect in every if name not in SIMULATED]
    if not diagnosis.wording.excitable:
        arranged = [(name, effect) for name, effect in arranged if name in machine_experiments.HOW]
    if not arranged:
        return {"why": "no experiment of the catalogue separates them better than this recording: " + differ}
    name, effect = min(arranged, key=lambda pair: shown_by[pair[0]])
    why = f"shows {effect} and is arranged by hand, so that it cannot be simulated; {differ}"
    return _experiment(name, why, finding.joint, diagnosis.wording, problem)


def _fitted_together(
    diagnosis: Diagnosis, finding: Finding, rivals: Sequence[str]
) -> list[tuple[JointProblem, Hypothesis, list[Hypothesis]]]:
    """The rounds in which a finding and all rivals were fitted, of the first joint that has one: the finding first."""
    for joint in diagnosis.joints:
        if finding.joint not in {None, joint.joint}:
            continue
        rounds = [{each.effect.name: each for each in hypotheses} for hypotheses in joint.search.rounds]
        found = [named for named in rounds if {finding.effect, *rivals} <= set(named)]
        if found:
            return [
                (joint.search.problem, named[finding.effect], [named[rival] for rival in rivals]) for named in found
            ]
    return []


def next_experiment(
    diagnosis: Diagnosis, ties: Sequence[Mapping[str, str] | None] | None = None
) -> dict[str, str] | None:
    """The experiment that separates the least certain finding from its strongest rival, by simulation of both.

    Of a tie it is that of `ties` (of all findings, from tie_separations). None where no experiment separates them
    better than the recording did, and where nothing is uncertain.
    """
    separations = dict(zip(map(id, diagnosis.findings), ties or (), strict=False))
    unsure = [finding for finding in diagnosis.findings if finding.alternatives]
    for finding in sorted(unsure, key=lambda finding: finding.probability):
        tie = separations.get(id(finding))
        if tie is not None and tie.get("name") in SIMULATED:
            return dict(tie)
        rival, share, _ = finding.alternatives[0]
        fitted = _fitted_together(diagnosis, finding, [rival])
        simulated = simulated_experiment(diagnosis, finding, rival)
        if simulated is None:
            continue
        name, sigma = simulated
        why = f"separates {finding.effect} ({finding.probability:.0%}) from {rival} ({share:.0%})"
        why += f" on {finding.joint or diagnosis.wording.whole}; in simulation the two differ by {sigma:.0f} sigma"
        return _experiment(name, why, finding.joint, diagnosis.wording, fitted[0][0])
    for left in diagnosis.remainder:
        joint = next(each for each in diagnosis.joints if each.joint == left.joint)
        name = _most_different(joint.search.problem)
        why = f"shows whether the remainder of {left.joint} appears in a motion unlike the recorded one"
        return _experiment(name, why, left.joint, diagnosis.wording, joint.search.problem)
    return None


def _most_different(problem: JointProblem) -> str:
    """The experiment whose set-points have least in common with the recorded ones, by their spectra."""
    followed = [each.angle_rad if problem.driven else each.set_point_pa for each in problem.segments]
    recorded = _spectrum(np.concatenate(followed), problem)
    alike = {name: float(recorded @ _spectrum(_course(problem, name), problem)) for name in _simulated(problem)}
    return min(alike, key=lambda name: alike[name])


def _course(problem: JointProblem, name: str) -> Array:
    """Levels (T,) of an experiment, in any unit."""
    if problem.machine:
        return machine_experiments.course(problem, name)
    period = problem.segments[0].period_s
    time_s = np.asarray(np.arange(round(SETTINGS.experiment_s / period)) * period, dtype=np.float64)
    return EXPERIMENTS[name](time_s, np.random.default_rng(0))


def _simulated(problem: JointProblem) -> tuple[str, ...]:
    """Names of the experiments that can be simulated and performed."""
    return machine_experiments.performable(problem) if problem.machine else SIMULATED


def _spectrum(set_points: Array, problem: JointProblem) -> Array:
    """Shares (bands,) of the speed of set-points (T,) in logarithmic bands of frequency, with unit norm."""
    power = np.abs(np.fft.rfft(np.diff(set_points))) ** 2
    frequency = np.fft.rfftfreq(len(set_points) - 1, problem.segments[0].period_s)
    shares, _ = np.histogram(frequency, SETTINGS.spectrum_edges_hz, weights=power)
    amplitudes: Array = np.sqrt(shares)
    return amplitudes / max(float(np.linalg.norm(amplitudes)), 1e-300)


def _experiment(name: str, why: str, joint: str | None, wording: Wording, problem: JointProblem) -> dict[str, str]:
    """With the command that records it on the running hand, if `hand excite` has it; on another machine, what to do."""
    if problem.machine:
        return {"name": name, "why": why, "how": machine_experiments.how(problem, name, wording)}
    joints = f"--joints {joint} " if joint else ""
    command = (
        {"command": f"hand excite {name} {joints}--live --out {name}.mcap"}
        if wording.excitable and name in EXPERIMENTS
        else {}
    )
    arranged = {} if name in EXPERIMENTS or name not in BY_HAND_HOW else {"how": BY_HAND_HOW[name]}
    return {"name": name, "why": why} | command | arranged


def simulated_experiment(diagnosis: Diagnosis, finding: Finding, rival: str) -> tuple[str, float] | None:
    """The best experiment by simulation of both fitted hypotheses, where both were fitted on the finding's joint.

    None also for effects with the same equation: what differs are numbers, which a fit to other data would change.
    """
    fitted = _fitted_together(diagnosis, finding, [rival])
    if not fitted:
        return None
    problem, own, (other,) = fitted[0]
    if other.effect.name in own.effect.alike:
        return None
    return best_experiment(problem, own, other)


def best_experiment(problem: JointProblem, first: Hypothesis, second: Hypothesis) -> tuple[str, float] | None:
    """The experiment with the largest simulated separation of two hypotheses, and the separation [sigma].

    None where no experiment separates them clearly better, by SETTINGS.min_separation_gain, than the recorded
    set-points do in the same simulation: to record the same motion again would add nothing new.
    """
    sigmas = {name: separation_sigma(problem, first.fit, second.fit, name) for name in _simulated(problem)}
    name = max(sigmas, key=lambda key: sigmas[key])
    recorded = _recorded_sigma(problem, first.fit, second.fit)
    return (name, sigmas[name]) if sigmas[name] > SETTINGS.min_separation_gain * recorded else None


def _recorded_sigma(problem: JointProblem, first: MapFit, second: MapFit) -> float:
    """Difference [sigma] of two fitted models on what was recorded."""
    if problem.machine:
        return machine_experiments.recorded_separation(problem, first, second)
    return _sigma(problem, first, second, _recorded(problem))


def _recorded(problem: JointProblem) -> Array:
    """The recorded set-points (T,) [Pa], as often or as much of them as an experiment is long."""
    segment = problem.segments[0]
    count = round(SETTINGS.experiment_s / segment.period_s)
    return np.asarray(np.resize(segment.set_point_pa, count), dtype=np.float64)


def separation_sigma(problem: JointProblem, first: MapFit, second: MapFit, name: str) -> float:
    """Difference [sigma] of two fitted models on an experiment; the practical noise is correlated over a while."""
    if problem.machine:
        return machine_experiments.separation(problem, first, second, name)
    period = problem.segments[0].period_s
    time_s = np.asarray(np.arange(round(SETTINGS.experiment_s / period)) * period, dtype=np.float64)
    top = max(float(problem.segments[0].pressure_pa.max()), SETTINGS.min_experiment_pressure_pa)
    commands = top * np.clip(EXPERIMENTS[name](time_s, np.random.default_rng(0)), 0.0, 1.0)
    return _sigma(problem, first, second, commands)


def _sigma(problem: JointProblem, first: MapFit, second: MapFit, commands_pa: Array) -> float:
    """The same under set-points (T,) [Pa]."""
    period = problem.segments[0].period_s
    one, other = (_readings(problem, fit, commands_pa, period) for fit in (first, second))
    squares = float((((one - other) / problem.floor[:2, None]) ** 2).sum())
    return float(np.sqrt(squares * period / FITS.correlation_s))


def _readings(problem: JointProblem, fit: MapFit, commands_pa: Array, period_s: float) -> Array:
    """Pressure [Pa] and angle [rad] (2, T) of the joint alone under set-points (T,)."""
    columns, _ = problem.columns(fit.free, fit.z[None])
    parameters = columns[0][:, None]
    loop = ClosedLoop(parameters[None], np.array([-1]), resting_states(parameters)[None], period_s)
    states = loop.advance(commands_pa[None, :, None])[0]
    return np.array([states[:, P, 0], states[:, PHI, 0]])
