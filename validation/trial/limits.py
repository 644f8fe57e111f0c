"""Detection limits and what cannot be told apart even in principle, both from the trial's own plant.

An effect is at its limit when what it does to the signal where it acts, beyond what the nominal constants could imitate
within their few percent, has the RMS of that signal's practical repeatability. Two effects cannot be told apart when
one, scaled, and the nominal constants leave less than half of that of the other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from validation.trial.arrays import Array
from validation.trial.catalogue import KNOWN, Concealed
from validation.trial.nominal import UNCERTAIN
from validation.trial.plant import record
from validation.trial.rows import ROW

Index = NDArray[np.int64]
REPEATABILITY = (300.0, math.radians(0.05), 0.05)
"""Of pressure [Pa], angle [rad] and force [N]."""
OUTPUT = (0, 1, 3)
"""Row of the plant's readings of each stage."""
KNOWN_WALL = (math.radians(35.0), 0.8, 1.0)
"""Of the force sensors' cases: angle [rad], stiffness [N m/rad], plain spring."""
PRESSURE, ANGLE, FORCE = range(3)
VALVE = {"lag", "delay"}
CLOCK_S = 0.01
"""A clock's offset at size 1."""
COARSE_S = 5e-4
OFF, DELAY_OFF = 0.03, 0.4
"""Standard deviation of the nominal constants' relative errors; what nobody knows of the dead time."""
CORRELATION_S = 0.5
SKIP_S = 0.5
INSEPARABLE = 0.5
SMALLEST = 1e-3


@dataclass(frozen=True, slots=True)
class Scene:
    """A joint among those that touch it: rows (rows, k), set-points (frames, k), partners, neighbours, its column."""

    q: Array
    u: Array
    partner: Index
    neighbour: Index
    column: int
    frame_s: float
    wander: Array

    def readings(self, concealed: Concealed | None, size: float, **changes: float) -> Array:
        """Readings (3, frames) of the joint with an effect of a size; changes: factors on rows."""
        q = self.q.copy()
        for name, factor in changes.items():
            q[ROW[name], self.column] *= factor
        if concealed is not None:
            switch_on(concealed, q, self.column, size, self)
        out = record(q, self.u, self.frame_s, self.partner, self.neighbour, self.wander, COARSE_S)
        out = np.nan_to_num(out, nan=1e3, posinf=1e3, neginf=-1e3)
        seen: Array = out[list(OUTPUT), :, self.column][:, round(SKIP_S / self.frame_s) :]
        return seen

    @property
    def reach_rad(self) -> float:
        """How far the joint flexes where nothing more stands in its way."""
        out = record(self.q, self.u, self.frame_s, self.partner, self.neighbour, self.wander, COARSE_S)
        return float(out[OUTPUT[ANGLE], :, self.column].max())


def switch_on(concealed: Concealed, q: Array, joint: int, size: float, where: Scene) -> None:
    """Switch an effect on; places in the way move in from where the joint just reaches in its scene."""
    concealed.apply(q, joint, size)
    kind, _, rest = concealed.needs.partition(":")
    if kind == "inverse":
        row, unit = rest.split(":")
        q[ROW[row], joint] = float(unit) / max(size, 1e-9)
    if kind == "nearer":
        q[ROW[rest], joint] = max(min(where.reach_rad, 1.6) - 0.05 * size, 0.15)
    if kind == "known_wall":
        q[ROW["wall_at"], joint], q[ROW["wall_k"], joint], q[ROW["wall_plain"], joint] = KNOWN_WALL


def scene(q: Array, u: Array, partner: Index, neighbour: Index, joint: int, frame_s: float, wander: Array) -> Scene:
    """The joint and those that touch it, cut out of a hand."""
    near = [int(k) for k in dict.fromkeys((joint, partner[joint], neighbour[joint])) if k >= 0]
    at = {k: index for index, k in enumerate(near)}
    own = [at.get(int(partner[k]), -1) for k in near]
    beside = [at.get(int(neighbour[k]), 0) for k in near]
    return Scene(q[:, near].copy(), u[:, near].copy(), np.array(own), np.array(beside), 0, frame_s, wander)


class Projector:
    """What the nominal constants can imitate, of one stage of one scene."""

    def __init__(self, where: Scene, stage: int) -> None:
        """Sensitivities by differences; force is felt at the known obstacle."""
        still = next(one for one in KNOWN if one.needs == "known_wall") if stage == FORCE else None
        self.plain = where.readings(still, 0.0)[stage]
        # Behind the measured pressure, the valve can imitate nothing.
        names = [name for name in UNCERTAIN if stage == PRESSURE or name not in VALVE]
        steps = [where.readings(still, 0.0, **{name: 1.0 + OFF})[stage] - self.plain for name in names]
        if stage == PRESSURE:
            # A set-point waits for the board's tick, too: nobody knows the dead time to a few percent.
            steps.append(where.readings(still, 0.0, delay=1.0 + DELAY_OFF)[stage] - self.plain)
        self._s = np.array(steps) / REPEATABILITY[stage]
        self._sigma = REPEATABILITY[stage]
        self._weight = where.frame_s / CORRELATION_S

    def rest(self, change: Array, *beside: Array) -> Array:
        """What is left of a change, in repeatabilities; beside: other changes, freely scaled."""
        r = change / self._sigma
        free = [b / max(float(np.linalg.norm(b)), 1e-300) * np.linalg.norm(r) for b in beside]
        basis = np.vstack([self._s, *free]) if free else self._s
        trust = np.concatenate([np.ones(len(self._s)), np.full(len(free), 1e-4)])
        normal = self._weight * basis @ basis.T + np.diag(trust)
        z = np.linalg.solve(normal, self._weight * basis @ r)
        left: Array = r - z @ basis
        return left


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def limit_size(concealed: Concealed, where: Scene) -> float:
    """Size at which the effect is at its detection limit; inf where it does not show at all."""
    if concealed.needs == "drop":
        return 0.005
    if concealed.needs == "clock":
        projector = Projector(where, ANGLE)
        return 1.0 / max(rms(projector.rest(CLOCK_S * np.gradient(projector.plain, where.frame_s))), 1e-9)
    projector = Projector(where, concealed.stage)

    def seen(size: float) -> float:
        change = where.readings(concealed, size)[concealed.stage] - projector.plain
        value = rms(projector.rest(change))
        return value if np.isfinite(value) else math.inf

    low = high = SMALLEST
    while seen(high) < 1.0:
        low, high = high, 4.0 * high
        if high > concealed.most:
            return math.inf
    for _ in range(6):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if seen(middle) < 1.0 else (low, middle)
    return math.sqrt(low * high)


def _in_the_way(concealed: Concealed) -> bool:
    """Whether it is something that the joint runs into, nearer with its size."""
    return concealed.needs.startswith("nearer")


def inseparable(concealed: Concealed, size: float, where: Scene) -> list[str]:
    """Effects that could stand for this one here, itself first."""
    group = [concealed.name]
    if concealed.needs in {"drop", "clock"} or concealed.place == "unknown":
        return group
    projector = Projector(where, concealed.stage)
    change = where.readings(concealed, size)[concealed.stage] - projector.plain
    for other in KNOWN:
        if (
            other.name == concealed.name
            or other.stage != concealed.stage
            or other.needs in {"drop", "clock", "no_creep"}
        ):
            continue
        # Two things in the way are compared at the same place; other effects are scaled anyway.
        same = _in_the_way(concealed) and _in_the_way(other)
        its = where.readings(other, size if same else 1.0)[other.stage] - projector.plain
        if np.isfinite(its).all() and rms(its) > 1e-12 and rms(projector.rest(change, its)) < INSEPARABLE:
            group.append(other.name)
    return group
