"""Periods over the angle that the motion shows, for effects that repeat: found before the search, by a periodogram.

The torque that a model lacks for the recorded motion does not depend on how the axis answers to it, as its angle does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hand_diagnosis.settings import SETTINGS
from hand_identification.joint_problem import FORCE, JointProblem
from hand_identification.map_fit import MapFit
from hand_model.arrays import Array
from hand_model.effects.effect import ACCELERATION, SPEED, Effect
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW


def with_periods(problem: JointProblem, fit: MapFit, effects: Sequence[Effect]) -> JointProblem:
    """The problem with the period of every effect that is to be found in the data, as its nominal number."""
    wanted = [ROW[effect.scanned] for effect in effects if effect.scanned]
    wanted = [row for row in wanted if problem.nominal[row] == JOINT_PARAMETERS[row].neutral_si]
    period = period_of_torque(problem, fit) if wanted else 0.0
    if period <= 0.0:
        return problem
    nominal = problem.nominal.copy()
    nominal[wanted] = period
    return replace(problem, nominal=nominal)


def period_of_torque(problem: JointProblem, fit: MapFit) -> float:
    """The period [rad] of the angle with the largest harmonic in the torque that a fit lacks; 0 where none is seen."""
    columns, starts = problem.columns(fit.free, fit.z[None])
    predicted = replace(problem, driven=True).predict(columns, starts)
    angles, lacking, steps = [], [], []
    for segment, outputs in zip(problem.segments, predicted, strict=True):
        left = segment.measured[FORCE] - outputs[0, FORCE] if problem.driven else outputs[0, FORCE]
        angle = segment.angle_rad
        motion = angle, segment.exogenous[:, SPEED], segment.exogenous[:, ACCELERATION]
        x, v, a = (part / max(float(np.std(part)), 1e-300) for part in motion)
        known = segment.known & np.isfinite(left)
        around = np.column_stack([np.ones_like(x), x, x * x, x**3, v, np.tanh(v / SETTINGS.reversal_speed), a])[known]
        if known.sum() < 2 * around.shape[1]:
            continue
        rest = left[known] - around @ np.linalg.lstsq(around, left[known], rcond=1e-9)[0]
        angles.append(angle[known])
        lacking.append(np.clip(rest, *np.quantile(rest, SETTINGS.spike_quantiles)))
        steps.append(np.abs(np.diff(angle)))
    if not angles:
        return 0.0
    return _strongest(np.concatenate(angles), np.concatenate(lacking), float(np.median(np.concatenate(steps))))


def _strongest(angle: Array, values: Array, step: float) -> float:
    """The period [rad] of values (n,) over angles (n,) [rad] with the largest line; step: between samples [rad]."""
    span = float(np.ptp(angle))
    fewest, most = SETTINGS.scanned_turns
    most = min(most, span / max(SETTINGS.samples_a_turn * step, 1e-12))
    if span <= 0.0 or most <= fewest:
        return 0.0
    bins = 2 ** int(np.ceil(np.log2(SETTINGS.turn_bins * most)))
    places = np.minimum((bins * (angle - angle.min()) / span).astype(np.int64), bins - 1)
    power = np.abs(np.fft.rfft(np.bincount(places, values, bins), SETTINGS.turn_lines * bins))
    turns = np.arange(len(power)) / SETTINGS.turn_lines
    inside = (turns >= fewest) & (turns <= most)
    return span / float(turns[inside][int(np.argmax(power[inside]))]) if inside.any() else 0.0
