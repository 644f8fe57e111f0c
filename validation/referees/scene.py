"""Detection limits and isolability classes on the referees' plant, by the definitions of validation/trial/limits.py."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from validation.referees.forms import Apply, Family, Site
from validation.referees.plant import FRAME_S, Laws, record
from validation.referees.shapes import Rng
from validation.trial.arrays import Array
from validation.trial.limits import COARSE_S, INSEPARABLE, OUTPUT, SKIP_S, SMALLEST, Projector, rms
from validation.trial.plant import ROW

Index = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Joints:
    """A joint with its partner and neighbour, cut out of a hand; the joint is column 0.

    q: (rows, k).  u: set-points (frames, k) [Pa].  partner, neighbour: (k,) columns.
    """

    q: Array
    u: Array
    partner: Index
    neighbour: Index
    frame_s: float = FRAME_S

    def readings(self, concealed: Apply | None, size: float, **changes: float) -> Array:
        """Pressure, angle and force (3, frames) of the joint with a law; changes: factors on rows."""
        q = self.q.copy()
        for name, factor in changes.items():
            q[ROW[name], 0] *= factor
        laws = Laws(q.shape[1], len(self.u))
        if concealed is not None:
            concealed(laws, 0, size)
        out = record(q, (laws, laws), self.u, self.frame_s, self.partner, self.neighbour, step_s=COARSE_S)
        out = np.nan_to_num(out, nan=1e3, posinf=1e3, neginf=-1e3)
        seen: Array = out[list(OUTPUT), :, 0][:, round(SKIP_S / self.frame_s) :]
        return seen

    def site(self) -> Site:
        """What a family knows of the joint."""
        plain = self.readings(None, 0.0)
        return Site(self.q[:, 0], float(plain[1].max()), float(plain[0].max()))


def cut(q: Array, u: Array, partner: Index, neighbour: Index, joint: int) -> Joints:
    """A joint of a hand with its partner and neighbour; q (rows, joints), u set-points (frames, joints) [Pa]."""
    near = [int(k) for k in dict.fromkeys((joint, partner[joint], neighbour[joint])) if k >= 0]
    at = {k: index for index, k in enumerate(near)}
    own = np.array([at.get(int(partner[k]), -1) for k in near])
    beside = np.array([at.get(int(neighbour[k]), 0) for k in near])
    return Joints(q[:, near].copy(), u[:, near].copy(), own, beside)


def limit(law: Apply, stage: int, most: float, where: Joints, projector: Projector) -> float:
    """Size at the detection limit [-]; inf where the law is not visible up to its largest size, most [-]."""

    def seen(size: float) -> float:
        value = rms(projector.remainder(where.readings(law, size)[stage] - projector.plain))
        return value if math.isfinite(value) else math.inf

    low = high = SMALLEST
    while seen(high) < 1.0:
        low, high = high, 4.0 * high
        if high > most:
            return math.inf
    for _ in range(6):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if seen(middle) < 1.0 else (low, middle)
    return math.sqrt(low * high)


def inseparable(
    own: Family,
    concealed: tuple[Apply, float],
    where: Joints,
    projector: Projector,
    others: tuple[Family, ...],
    rng: Rng,
) -> list[str]:
    """Effects that the data cannot separate from this law: its own first, then those whose laws imitate it.

    concealed: the law and its size [-].  others: families that may imitate it; a stop and an obstacle always do.
    """
    law, size = concealed
    group, site = [own.effect], where.site()
    change = where.readings(law, size)[own.stage] - projector.plain
    for other in others:
        if other.stage != own.stage or other.effect in group or other.everywhere:
            continue
        stands = {"end_stop", "contact"} >= {own.effect, other.effect}
        imitation = where.readings(other.draw(site, rng), size if stands else 1.0)[other.stage] - projector.plain
        if not np.isfinite(imitation).all() or rms(imitation) <= 1e-12:
            continue
        if stands or rms(projector.remainder(change, imitation)) < INSEPARABLE:
            group.append(other.effect)
    return group
