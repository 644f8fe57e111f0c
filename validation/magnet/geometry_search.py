"""Which half-ring gives Table 1's simulated nonlinearity: the paper does not print its geometry."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from validation.magnet.field import Magnet, radial_field
from validation.magnet.linearity import joint_nonlinearity

HALF_RING_PERCENT = (0.039, 0.117)
"""Table 1, simulated half-ring, over 0 ... 90 and -10 ... 100 degrees of the joint."""
OUTER_M = 2.5e-3
INNER_M = (0.5e-3, 1.0e-3, 1.5e-3, 2.0e-3)
GAP_M = (0.2e-3, 3.0e-3)


@dataclass(frozen=True, slots=True)
class Fit:
    """The best gap for a hole: nonlinearity in percent over both ranges, and the largest relative distance."""

    inner_m: float
    gap_m: float
    narrow_percent: float
    wide_percent: float
    distance: float


def half_ring(inner_m: float, gap_m: float) -> Magnet:
    """A half-ring of the common outer radius, magnetised across its middle."""
    return Magnet(np.array([OUTER_M]), inner_m, OUTER_M + gap_m, np.pi)


def search(progress: Callable[[int], None]) -> list[Fit]:
    """The gap with the closest result for each hole, the best first. progress is called with 1 after each hole."""
    fits = []
    for inner in INNER_M:

        def distance(gap: float, inner: float = inner) -> float:
            found = joint_nonlinearity(*radial_field(half_ring(inner, gap), 40))
            return max(abs(float(np.log(a / b))) for a, b in zip(found, HALF_RING_PERCENT, strict=True))

        best = minimize_scalar(distance, bounds=GAP_M, method="bounded", options={"xatol": 2e-5})
        narrow, wide = joint_nonlinearity(*radial_field(half_ring(inner, float(best.x)), 60))
        far = max(abs(narrow / HALF_RING_PERCENT[0] - 1.0), abs(wide / HALF_RING_PERCENT[1] - 1.0))
        fits.append(Fit(inner, float(best.x), narrow, wide, far))
        progress(1)
    return sorted(fits, key=lambda fit: fit.distance)
