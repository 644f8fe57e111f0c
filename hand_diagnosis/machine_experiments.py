"""Experiments that another machine than a hand can perform: courses of its input or motion in the recorded range.

Where the input moves the axis, it follows the course; a rig moves the axis along it; an axis without input is released.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hand_diagnosis.settings import SETTINGS
from hand_identification.excitation import EXPERIMENTS
from hand_identification.joint_problem import FORCE, STAGES, JointProblem, Segment
from hand_identification.map_fit import MapFit
from hand_model.arrays import Array
from hand_model.effects.effect import SPEED
from hand_model.kernel.layout import OMEGA, PHI, P
from hand_model.kernel.open_loop import surroundings_of
from hand_model.quantities import Wording

ANGLE, PRESSURE = STAGES.index("angle"), STAGES.index("pressure")
DRIVEN_BY_INPUT = ("staircase", "slow_triangle", "steps", "multisine", "chirp", "hold", "free_decay", "reversals")
MOVED_BY_RIG = ("slow_triangle", "reversals", "multisine", "chirp")
"""Motions without jumps, which a rig can impose."""
RELEASED = ("free_decay",)
HOW = {
    "staircase": "raise the {signal} from {low} to {high} and lower it again, in six steps each, and wait at each",
    "slow_triangle": "let the {signal} rise and fall evenly between {low} and {high}, three times",
    "steps": "let the {signal} jump between random levels from {low} to {high}, every 0.8 s",
    "multisine": "let the {signal} follow a sum of ten sines of 0.1 to 5 Hz between {low} and {high}",
    "chirp": "let the {signal} follow a sine between {low} and {high} whose frequency rises from 0.1 to 5 Hz",
    "hold": "hold the {signal} at {middle} for most of the time and near {low} for the rest",
    "free_decay": "let the {signal} jump from {high} to {low} and wait until the {axis} rests, several times",
    "reversals": "let the {signal} rise and fall by ever less, from between {low} and {high} to {middle}",
    "second_attitude": "record the same again after the machine is tilted",
    "free_space": "record the same again with nothing in the way: an obstacle is gone then, a stop is not",
    "stops": "move the {axis} to both ends of its travel",
}
"""What is done on the machine, by experiment. low, high, middle: numbers with their unit."""
CLOSED = ("hold",)
FILL = "fill the volume to {high}, close the valve and wait until most of the pressure is lost; then from half of it"
RELEASE = "hold the {axis} at {high}, release it and wait until it rests; then from {low}"


def performable(problem: JointProblem) -> tuple[str, ...]:
    """Names of the experiments that the machine of the problem can perform and that can be simulated."""
    if _is_still(problem):
        return CLOSED
    if problem.driven:
        return MOVED_BY_RIG
    return DRIVEN_BY_INPUT if np.ptp(_driving(problem)) > 0.0 else RELEASED


def how(problem: JointProblem, name: str, wording: Wording) -> str:
    """What to do on the machine for an experiment, a sentence without its full stop, in the machine's units."""
    if _is_still(problem):
        (factor, unit), high = wording.signal_units[0], max(float(each.pressure_pa.max()) for each in problem.segments)
        return FILL.format(high=f"{factor * high:.3g} {unit}")
    released = not problem.driven and np.ptp(_driving(problem)) == 0.0
    stage = ANGLE if problem.driven or released else 0
    (factor, unit), signal = wording.signal_units[stage], wording.signals[stage]
    low, high = _motion_range(problem, name) if problem.driven else _range(problem, released=released)
    texts = {
        key: f"{factor * value:.3g}" + ("" if unit == signal else f" {unit}")
        for key, value in (("low", low), ("high", high), ("middle", (low + high) / 2.0))
    }
    template = RELEASE if released else HOW[name]
    return template.format(signal=signal, axis=wording.axis, **texts)


def separation(problem: JointProblem, first: MapFit, second: MapFit, name: str) -> float:
    """Difference [sigma] of two fitted models on an experiment; 0 where one leaves the recorded range by far."""
    segment = _performed(problem, name)
    one, other = (_predicted(problem, fit, segment) for fit in (first, second))
    if not problem.driven and not _is_still(problem):
        angles = np.concatenate([each.angle_rad for each in problem.segments])
        spare = SETTINGS.experiment_overshoot * float(np.ptp(angles))
        beyond = max(float(np.abs(each - np.median(angles)).max()) for each in (one, other))
        if not beyond <= float(np.ptp(angles)) / 2.0 + spare:
            return 0.0
    return _sigma(problem, one - other, segment.period_s)


def recorded_separation(problem: JointProblem, first: MapFit, second: MapFit) -> float:
    """Difference [sigma] of two fitted models on the first recording, as if it were as long as an experiment."""
    segment = problem.segments[0]
    one, other = (_predicted(problem, fit, segment) for fit in (first, second))
    share = SETTINGS.experiment_s / (segment.period_s * len(segment.angle_rad))
    return float(np.sqrt(share)) * _sigma(problem, one - other, segment.period_s)


def course(problem: JointProblem, name: str) -> Array:
    """What the machine is made to follow (T,): its input [Pa], or its motion [rad] where a rig imposes it."""
    segment = _performed(problem, name)
    return segment.angle_rad if problem.driven else segment.driving_pa


def _levels(period_s: float, name: str) -> tuple[Array, Array]:
    """Times (T,) [s] of an experiment, and its levels (T,) from 0 to 1."""
    time_s = np.asarray(np.arange(round(SETTINGS.experiment_s / period_s)) * period_s, dtype=np.float64)
    return time_s, np.clip(EXPERIMENTS[name](time_s, np.random.default_rng(0)), 0.0, 1.0)


def _performed(problem: JointProblem, name: str) -> Segment:
    """The first recording with the signals of an experiment in place of its own."""
    first = problem.segments[0]
    time_s, level = _levels(first.period_s, name)
    low, high = _range(problem, released=False)
    driving, angle = low + (high - low) * level, np.full_like(time_s, first.angle_rad[0])
    motion = (angle, np.zeros_like(angle), np.zeros_like(angle))
    start = first.start.copy()
    start[OMEGA] = 0.0
    if _is_still(problem):
        start[P] = high
    if problem.driven:
        motion = _motion(problem, name)
        driving = np.full_like(time_s, float(np.median(_driving(problem))))
    elif low == high:
        start[PHI] = max(float(each.angle_rad.max()) for each in problem.segments)
    return replace(
        first,
        set_point_pa=driving,
        commanded_pa=driving,
        pressure_pa=driving,
        driving_pa=driving,
        angle_rad=motion[0],
        exogenous=surroundings_of(time_s, motion),
        start=start,
        acts=None,
    )


def _motion(problem: JointProblem, name: str) -> tuple[Array, Array, Array]:
    """Position [rad], speed and acceleration (T,) each of an imposed motion, smooth and no faster than recorded."""
    first = problem.segments[0]
    _, level = _levels(first.period_s, name)
    half = max(1, round(SETTINGS.experiment_smoothing_s / first.period_s / 2.0))
    window = np.hanning(2 * half + 3)[1:-1]
    level = np.convolve(np.pad(level, half, mode="edge"), window / window.sum(), mode="valid")
    low, high = _range_of_angle(problem)
    fastest = max(float(np.abs(each.exogenous[:, SPEED]).max()) for each in problem.segments)
    speed = (high - low) * float(np.abs(np.gradient(level, first.period_s)).max())
    middle = (low + high) / 2.0
    angle = middle + min(1.0, fastest / max(speed, 1e-12)) * (low + (high - low) * level - middle)
    rate = np.gradient(angle, first.period_s)
    return angle, rate, np.gradient(rate, first.period_s)


def _predicted(problem: JointProblem, fit: MapFit, segment: Segment) -> Array:
    """The predicted signal (T,) of the machine: its force [N] where the motion is imposed, else its angle [rad]."""
    columns, _ = problem.columns(fit.free, fit.z[None])
    alone = replace(problem, segments=[segment])
    return np.asarray(alone.predict(columns, alone.starts(1))[0][0, _stage(problem)])


def _sigma(problem: JointProblem, difference: Array, period_s: float) -> float:
    floor = problem.floor[_stage(problem)]
    return float(np.sqrt(np.sum((difference / floor) ** 2) * period_s / problem.correlation_s))


def _stage(problem: JointProblem) -> int:
    """The signal that is predicted."""
    return FORCE if problem.driven else PRESSURE if _is_still(problem) else ANGLE


def _is_still(problem: JointProblem) -> bool:
    """Whether only a pressure was measured."""
    return not any(each.use[ANGLE].any() or each.use[FORCE].any() for each in problem.segments)


def _driving(problem: JointProblem) -> Array:
    return np.concatenate([each.driving_pa for each in problem.segments])


def _range_of_angle(problem: JointProblem) -> tuple[float, float]:
    angles = np.concatenate([each.angle_rad for each in problem.segments])
    return float(angles.min()), float(angles.max())


def _range(problem: JointProblem, *, released: bool) -> tuple[float, float]:
    """The recorded range of the input [Pa], or of the angle [rad] from which an axis is released."""
    driving = _driving(problem)
    return _range_of_angle(problem) if released else (float(driving.min()), float(driving.max()))


def _motion_range(problem: JointProblem, name: str) -> tuple[float, float]:
    angle = _motion(problem, name)[0] if name in EXPERIMENTS else np.array(_range_of_angle(problem))
    return float(angle.min()), float(angle.max())
