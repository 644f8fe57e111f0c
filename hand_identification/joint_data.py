"""The fitting problem of one joint from signals: inputs of its model, samples that count, and the initial state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.polynomial.polynomial import polyfit

from hand_identification.impacts import impacts
from hand_identification.joint_problem import (
    JointProblem,
    Segment,
    block_numbers,
    initial_weights,
)
from hand_identification.settings import FITS
from hand_identification.step_times import settle_steps
from hand_model.arrays import Array, Flags
from hand_model.joint_model import JointModel
from hand_model.kernel.layout import OMEGA, PHI, P
from hand_model.kernel.open_loop import OUTPUTS, surroundings_of
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW, STATES
from hand_model.material import creep_course
from hand_recording.local_smoothing import Windows
from hand_recording.settings import READING
from hand_recording.signals import (
    Signals,
    derivatives,
    half_window,
    in_band,
    noise_in_band,
    slopes_over,
    smoothing_span,
    white_noise,
    without_noise,
)


def joint_problem(
    signals: Sequence[Signals], hand: JointModel, joint: str, floor: Sequence[float] | Array = FITS.floor
) -> JointProblem:
    """The problem of one joint over all recordings that contain it, with the nominal parameters of the hand.

    floor: (OUTPUTS,) SI, repeatability of each signal.
    """
    index = hand.joints.index(joint)
    segments: list[Segment] = []
    first = 0
    for recording in signals:
        if joint in recording.joints:
            segments.append(_segment(recording, hand, joint, first))
            first = int(segments[-1].block[-1]) + 1
    whites = [_white(segment) for segment in segments]
    noises = np.array([_noise(segment, white) for segment, white in zip(segments, whites, strict=True)])
    noise = np.max(noises, axis=0)
    if signals[0].machine:
        segments = _trusted(segments, [recording for recording in signals if joint in recording.joints])
        noise = np.min(noises, axis=0)
    problem = JointProblem(
        joint,
        segments,
        hand.parameters[:, index].copy(),
        initial_weights(segments[0].period_s, noise),
        hand.lever_arm_m(index),
        driven=signals[0].driven,
        floor=np.asarray(floor),
        machine=signals[0].machine,
        white=np.repeat(np.transpose(whites), [len(segment.starts) for segment in segments], axis=1),
    )
    if any(segment.loose is not None for segment in segments):
        settle_steps(problem)
    return problem


def _trusted(segments: Sequence[Segment], signals: Sequence[Signals]) -> list[Segment]:
    """The recordings of a machine, each with the trust that the noise of its predicted signal leaves it.

    Below the practical repeatability, noise makes no recording worse than another.
    """
    stage = 2 if signals[0].driven else 1
    readings = [(each.force_n if each.driven else each.angle_rad)[:, 0] for each in signals]
    noises = [
        segment.kept_noise_n or white_noise(np.nan_to_num(values))
        for segment, values in zip(segments, readings, strict=True)
    ]
    sizes = [float(np.hypot(noise, FITS.floor[stage])) for noise in noises]
    return [replace(segment, trust=min(sizes) / size) for segment, size in zip(segments, sizes, strict=True)]


def _segment(signals: Signals, hand: JointModel, joint: str, first_block: int) -> Segment:
    j = signals.joints.index(joint)
    force = in_band(signals.force_n[:, j], signals.period_s, signals.band_s)
    driving, windows = driving_pressure(signals, j)
    start = np.zeros(STATES)
    start[P], start[PHI] = signals.pressure_pa[0, j], signals.angle_rad[0, j]
    start[OMEGA] = speed_at_start(signals.angle_rad[:, j], signals.period_s)
    return Segment(
        name=signals.name,
        period_s=signals.period_s,
        set_point_pa=signals.set_point_pa[:, j],
        commanded_pa=signals.commanded_pa[:, j],
        pressure_pa=signals.pressure_pa[:, j],
        driving_pa=driving,
        windows=windows,
        angle_rad=signals.angle_rad[:, j],
        force_n=force,
        exogenous=_surroundings(signals, hand, joint),
        known=signals.known[:, j],
        use=_use(signals, j, force, impacts(signals, hand, joint)),
        loose=None if signals.loose is None else signals.loose[:, j],
        block=block_numbers(signals.samples, signals.period_s, first_block),
        start=start,
        late_s=signals.pressure_late_s,
        jitter_s=signals.jitter_s,
        own=None if signals.own is None else signals.own.of(j),
        added=_added(signals.added),
        derivative_s=signals.derivative_s,
        band_s=signals.band_s,
        kept_noise_n=noise_in_band(np.nan_to_num(signals.force_n[:, j]), signals.period_s, signals.band_s),
    )


def _added(numbers: Mapping[str, float]) -> Array | None:
    """What a recording adds to the parameters (rows,), SI; None where it adds nothing."""
    if not numbers:
        return None
    added = np.zeros(len(JOINT_PARAMETERS))
    for key, value in numbers.items():
        added[ROW[key]] = value
    return added


def speed_at_start(angle_rad: Array, period_s: float) -> float:
    """First speed [rad/s] of angles (T,) that begin in motion; 0 at rest, where an estimate would be noise."""
    count = min(round(FITS.starting_s / period_s) + 1, len(angle_rad))
    if count < 2 * FITS.starting_order:
        return 0.0
    at = np.linspace(0.0, 1.0, count)
    speed = float(polyfit(at, angle_rad[:count], FITS.starting_order)[1]) / ((count - 1) * period_s)
    return speed if abs(speed) > FITS.in_motion_rad_s else 0.0


def driving_pressure(signals: Signals, j: int) -> tuple[Array, Windows]:
    """Pressure (T,) [Pa] of column j as the input of the joint, from its readings alone, and the smoothing windows."""
    pressure = signals.pressure_pa[:, j]
    if signals.driven:
        return pressure, np.ones(len(pressure), dtype=np.int64)
    quiet, span = without_noise(pressure, signals.period_s, white_noise(pressure))
    return quiet, np.where(quiet != pressure, span, 1)


def _surroundings(signals: Signals, hand: JointModel, joint: str) -> Array:
    """Exogenous inputs (T, EXOGENOUS) of the joint's model, without the inflow of the whole hand (driving.py)."""
    j = signals.joints.index(joint)
    speed, acceleration = derivatives(signals.angle_rad[:, j : j + 1], signals.period_s, signals.derivative_s)
    motion = signals.angle_rad[:, j], speed[:, 0], acceleration[:, 0]
    partner = int(hand.partner[hand.joints.index(joint)])
    if partner >= 0 and hand.joints[partner] in signals.joints:
        beside = signals.angle_rad[:, signals.joints.index(hand.joints[partner])]
        return surroundings_of(signals.time_s, motion, beside, _quiet_acceleration(beside, signals.period_s))
    if len(signals.joints) > 1:
        return surroundings_of(signals.time_s, motion, signals.angle_rad[:, j - 1 if j else 1])
    return surroundings_of(signals.time_s, motion)


def _quiet_acceleration(angle_rad: Array, period_s: float) -> Array:
    """Acceleration (T,) [rad/s^2] of a coupled joint; a slow motion is smoothed over a longer window."""
    span = smoothing_span(angle_rad, period_s, white_noise(angle_rad))
    if span * period_s > 2.0 * READING.input_windows_s[0]:
        return slopes_over(angle_rad, span, 2, period_s)
    return derivatives(angle_rad[:, None], period_s)[1][:, 0]


def _use(signals: Signals, j: int, force: Array, after_impacts: Flags) -> Flags:
    """Samples of each stage that count, (OUTPUTS, T)."""
    settled = np.arange(signals.samples) >= round(FITS.settling_s / signals.period_s)
    known = signals.known[:, j] & settled
    use = np.zeros((OUTPUTS, signals.samples), dtype=bool)
    use[0] = known & bool(signals.has_set_point[j]) & bool(signals.has_pressure[j])
    use[1] = known & bool(signals.has_pressure[j]) & (not signals.still) & ~after_impacts
    if signals.driven:
        # Derivatives at the end of a recording are extrapolated by the last whole window.
        whole = np.arange(signals.samples) < signals.samples - half_window(signals.period_s, signals.derivative_s)
        use[1], use[2] = False, known & whole & np.isfinite(force)
        return use
    use[2] = known & np.isfinite(force) & (np.nan_to_num(force) > FITS.touching_n)
    return use


def _white(segment: Segment) -> Array:
    """White noise of each measured signal (OUTPUTS,), SI."""
    return np.array([segment.white_noise(stage, signal) for stage, signal in enumerate(segment.measured)])


def _noise(segment: Segment, white: Array) -> Array:
    """Standard deviation of the noise of each measured signal (OUTPUTS,), SI: white noise, and speed times jitter."""
    if segment.jitter_s == 0.0:
        return white
    speeds = np.gradient(segment.measured, segment.period_s, axis=1)
    return np.asarray(np.hypot(white, segment.jitter_s * np.sqrt(np.mean(speeds**2, axis=1))))


def crept(segment: Segment, end: int, column: Array, ratio: float) -> float:
    """The creeping ratio [-] at a sample, from the measured pressures before it (Eq. 12).

    end: the sample.  column: (rows,) parameters.  ratio: at the first sample [-].
    """
    keys = ("p_min_pa", "b1_per_pa", "extension_time_s", "b0_per_pa", "recovery_time_s")
    law = tuple(float(column[ROW[f"material.{key}"]]) for key in keys)
    return float(creep_course(segment.pressure_pa[:end], law, segment.period_s, ratio)[-1])
