"""Detection limits and isolability classes, both computed with the plant of the trial.

At its detection limit, an effect changes the signal where it acts by the practical repeatability of that signal (RMS),
after subtraction of the part that the nominal constants can imitate within their few percent. Two effects are in one
isolability class if one of them, scaled, and the nominal constants imitate the other except for less than half of the
repeatability.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from validation.trial.arrays import Array
from validation.trial.catalogue import KNOWN, Concealed
from validation.trial.nominal import UNCERTAIN
from validation.trial.plant import ROW, record

Index = NDArray[np.int64]
REPEATABILITY = (300.0, math.radians(0.05), 0.05)
"""Of pressure [Pa], angle [rad] and force [N]."""
OUTPUT = (0, 1, 3)
"""Row of the plant's readings for each stage."""
KNOWN_WALL = (math.radians(35.0), 0.8, 1.0)
"""Known obstacle in the cases with a force sensor: angle [rad], stiffness [N m/rad], 1 for a plain spring."""
PRESSURE, ANGLE, FORCE = range(3)
VALVE = {"lag", "delay"}
CLOCK_S = 0.01
"""Offset of a clock at size 1."""
COARSE_S = 5e-4
OFF, DELAY_OFF = 0.03, 0.4
"""Relative standard deviation of the nominal constants, and of the dead time."""
CORRELATION_S = 0.5
SKIP_S = 0.5
INSEPARABLE = 0.5
SMALLEST = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """A joint with its partner and neighbour, cut out of a hand.

    q: parameters (rows, k).  u: set-points (frames, k) [Pa].  partner, neighbour: (k,) columns.  column: the joint's
    own.  wander: (frames,) random process of unit size.
    """

    q: Array
    u: Array
    partner: Index
    neighbour: Index
    column: int
    frame_s: float
    wander: Array

    def readings(self, concealed: Concealed | None, size: float, **changes: float) -> Array:
        """Pressure, angle and force (3, frames) of the joint with an effect; changes: factors on rows."""
        q = self.q.copy()
        for name, factor in changes.items():
            q[ROW[name], self.column] *= factor
        if concealed is not None:
            switch_on(concealed, q, self.column, size, self)
        out = record(q, self.u, self.frame_s, self.partner, self.neighbour, wander=self.wander, step_s=COARSE_S)
        out = np.nan_to_num(out, nan=1e3, posinf=1e3, neginf=-1e3)
        seen: Array = out[list(OUTPUT), :, self.column][:, round(SKIP_S / self.frame_s) :]
        return seen

    @property
    def reach_rad(self) -> float:
        """Largest angle that the joint reaches without an additional obstacle."""
        out = record(self.q, self.u, self.frame_s, self.partner, self.neighbour, wander=self.wander, step_s=COARSE_S)
        return float(out[OUTPUT[ANGLE], :, self.column].max())


def switch_on(concealed: Concealed, q: Array, joint: int, size: float, where: Scene) -> None:
    """Add an effect of a size [detection limits] to q (rows, joints); a stop or obstacle stands nearer than the joint's
    reach, the more so the larger its size.
    """
    concealed.apply(q, joint, size)
    kind, _, rows = concealed.needs.partition(":")
    if kind == "inverse":
        row, unit = rows.split(":")
        q[ROW[row], joint] = float(unit) / max(size, 1e-9)
    if kind == "nearer":
        q[ROW[rows], joint] = max(min(where.reach_rad, 1.6) - 0.05 * size, 0.15)
    if kind == "known_wall":
        q[ROW["wall_at"], joint], q[ROW["wall_k"], joint], q[ROW["wall_plain"], joint] = KNOWN_WALL


def scene(q: Array, u: Array, partner: Index, neighbour: Index, joint: int, *, frame_s: float, wander: Array) -> Scene:
    """A joint of a hand with its partner and neighbour; q (rows, joints), u (frames, joints) [Pa]."""
    near = [int(k) for k in dict.fromkeys((joint, partner[joint], neighbour[joint])) if k >= 0]
    at = {k: index for index, k in enumerate(near)}
    own = [at.get(int(partner[k]), -1) for k in near]
    beside = [at.get(int(neighbour[k]), 0) for k in near]
    return Scene(
        q=q[:, near].copy(),
        u=u[:, near].copy(),
        partner=np.array(own),
        neighbour=np.array(beside),
        column=0,
        frame_s=frame_s,
        wander=wander,
    )


class Measured(Protocol):
    """A joint on some plant: its readings with an effect, and with other constants."""

    @property
    def frame_s(self) -> float:
        """Time between two frames [s]."""

    def readings(self, concealed: Any, size: float, **changes: float) -> Array:
        """Pressure, angle and force (3, frames).

        size: of what is concealed [-].  changes: factors on rows of UNCERTAIN.
        """


class Projector:
    """Removes from a change of a signal what the nominal constants can imitate, for one stage of a scene."""

    def __init__(self, where: Measured, stage: int) -> None:
        """Compute the sensitivities by differences; the force needs the known obstacle."""
        still = next(known for known in KNOWN if known.needs == "known_wall") if stage == FORCE else None
        self.plain = where.readings(still, 0.0)[stage]
        # The valve cannot imitate an effect behind the measured pressure.
        names = [name for name in UNCERTAIN if stage == PRESSURE or name not in VALVE]
        steps = [where.readings(still, 0.0, **{name: 1.0 + OFF})[stage] - self.plain for name in names]
        if stage == PRESSURE:
            # A set-point also waits for the tick of the board, so the dead time is known less well than the others.
            steps.append(where.readings(still, 0.0, delay=1.0 + DELAY_OFF)[stage] - self.plain)
        self._s = np.array(steps) / REPEATABILITY[stage]
        self._sigma = REPEATABILITY[stage]
        self._weight = where.frame_s / CORRELATION_S

    def remainder(self, change: Array, *others: Array) -> Array:
        """What is left of a change (frames,) [repeatabilities]; others: further changes, freely scaled."""
        r = change / self._sigma
        free = [b / max(float(np.linalg.norm(b)), 1e-300) * np.linalg.norm(r) for b in others]
        basis = np.vstack([self._s, *free]) if free else self._s
        trust = np.concatenate([np.ones(len(self._s)), np.full(len(free), 1e-4)])
        normal = self._weight * basis @ basis.T + np.diag(trust)
        z = np.linalg.solve(normal, self._weight * basis @ r)
        left: Array = r - z @ basis
        return left


def rms(values: Array) -> float:
    """Root mean square of values (...,) [their unit]."""
    return float(np.sqrt(np.mean(values**2)))


def limit_size(concealed: Concealed, where: Scene) -> float:
    """Size [unit of the effect] at the detection limit; inf where the effect is not visible up to its largest size."""
    if concealed.needs == "drop":
        return 0.005
    if concealed.needs == "clock":
        projector = Projector(where, ANGLE)
        return 1.0 / max(rms(projector.remainder(CLOCK_S * np.gradient(projector.plain, where.frame_s))), 1e-9)
    projector = Projector(where, concealed.stage)

    def seen(size: float) -> float:
        change = where.readings(concealed, size)[concealed.stage] - projector.plain
        value = rms(projector.remainder(change))
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
    """Whether the effect is a stop or an obstacle that stands nearer the larger its size is."""
    return concealed.needs.startswith("nearer")


def inseparable(concealed: Concealed, size: float, where: Scene) -> list[str]:
    """Isolability class of an effect of a size [detection limits] in a scene: its own name first, then those that the
    data cannot separate.
    """
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
        # A stop and an obstacle are compared at the same angle; other effects are scaled.
        same = _in_the_way(concealed) and _in_the_way(other)
        imitation = where.readings(other, size if same else 1.0)[other.stage] - projector.plain
        if not np.isfinite(imitation).all() or rms(imitation) <= 1e-12:
            continue
        if rms(projector.remainder(change, imitation)) < INSEPARABLE:
            group.append(other.name)
    return group
