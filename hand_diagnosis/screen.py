"""Which effects are worth a fit: how far each probe, with the nominal numbers free to follow, explains the residual.

To first order. A probe changes the prediction by s; the residual r is explained by alpha s + J dz, alpha within
0 ... 3, dz under its prior. What the nominal numbers explain alone is no merit of the probe.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hand_identification.free_parameters import probe_values
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit
from hand_model.arrays import Array
from hand_model.effects.effect import Effect
from hand_model.kernel.rows import ROW

AT_ONCE = 32
"""Probes simulated together: enough for any number of cores."""
LONG, FEWER = 60_000, 16
"""Samples from which only so many are simulated together, for the memory's sake."""
LARGEST_SHARE = 3.0
"""A probe is not followed further than this many times its size: it was not a linear one."""


@dataclass(frozen=True, slots=True)
class Screened:
    """An effect, the cost that its best probe promises to save, and where to start: values by row, step of base z."""

    effect: Effect
    gain: float
    start: dict[int, float]
    share: float


def screen(problem: JointProblem, fit: MapFit, effects: Sequence[Effect]) -> list[Screened]:
    """Every effect by its best probe, the most promising first."""
    base, starts = problem.columns(fit.free, fit.z[None])
    probes = [(effect, values) for effect in effects for values in probe_values(effect, base[0])]
    if not probes:
        return []
    columns = np.repeat(base, len(probes), axis=0)
    for column, (_, values) in zip(columns, probes, strict=True):
        for row, value in values.items():
            column[row] = value
    gains, shares = np.zeros(len(probes)), np.zeros(len(probes))
    at_once = AT_ONCE if sum(len(segment.angle_rad) for segment in problem.segments) < LONG else FEWER
    for begin in range(0, len(probes), at_once):
        part = slice(begin, begin + at_once)
        changed = problem.residuals(columns[part], np.repeat(starts, len(columns[part]), axis=0))
        gains[part], shares[part] = _gains(problem, fit, changed)
    best: dict[str, Screened] = {}
    for (effect, values), gain, share in zip(probes, gains, shares, strict=True):
        if effect.name not in best or gain > best[effect.name].gain:
            best[effect.name] = Screened(effect, float(gain), values, float(share))
    for effect in effects:
        relief = _relief(fit, effect)
        if relief > (best[effect.name].gain if effect.name in best else 0.0):
            best[effect.name] = Screened(effect, relief, {}, 1.0)
    return sorted(best.values(), key=lambda one: -one.gain)


def _relief(fit: MapFit, effect: Effect) -> float:
    """What the nominal numbers that an effect sets free have paid already for leaving their tolerance."""
    rows = {ROW[key] for key in effect.keys}
    return float(sum(z * z for parameter, z in zip(fit.free, fit.z, strict=True) if parameter.row in rows))


def _gains(problem: JointProblem, fit: MapFit, changed: Sequence[Array]) -> tuple[Array, Array]:
    """Cost saved by each probe and the share of it that saves most, (probes,) each."""
    train = (~problem.held_out).astype(float)
    count, coordinates = len(changed[0]), len(fit.z)
    ss, sr = np.zeros(count), np.zeros(count)
    cross, slope = np.zeros((count, coordinates)), np.zeros(coordinates)
    for segment, residual, slopes, other in zip(problem.segments, fit.residuals, fit.sensitivity, changed, strict=True):
        root = np.sqrt(problem.weight)[:, None] * train[segment.block][None]
        r = (residual * root).ravel()
        j = (slopes * root).reshape(coordinates, -1)
        other -= residual  # in place: of ten minutes these arrays are large
        other *= root
        s = np.nan_to_num(other, copy=False, posinf=0.0, neginf=0.0).reshape(count, -1)
        ss += (s * s).sum(axis=1)
        sr += s @ r
        cross += s @ j.T
        slope += j @ r
    free = np.linalg.inv(fit.normal + np.eye(coordinates))
    own = np.maximum(ss - np.einsum("pm,mn,pn->p", cross, free, cross), 1e-9 * ss + 1e-12)
    toward = -(sr - cross @ free @ (slope + fit.z))
    share = np.clip(toward / own, 0.0, LARGEST_SHARE)
    return share * (2.0 * toward - share * own), share
