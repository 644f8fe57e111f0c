"""Numbers that a fitted model does not use, such as the angle of a stop that it no longer reaches: their prior decides.

A fit may step to where such a number has lost its effect, and no slope there leads back. Any value then fits these data
as well, but not others that the model would use the number for.
"""

from __future__ import annotations

import numpy as np

from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit, map_fit, point_at
from hand_identification.settings import FITS


def idle_at_prior(problem: JointProblem, fit: MapFit) -> MapFit:
    """The fit with its idle numbers at their expected values, all at once or one by one, where that hardly costs more.

    fit: of this problem, with its weights.
    """
    idle = np.flatnonzero((np.diag(fit.normal) < FITS.idle_information) & (np.abs(fit.z) > FITS.idle_difference))
    back = fit.z.copy()
    back[idle] = 0.0
    allowed = fit.cost + FITS.idle_cost
    if len(idle) and point_at(problem, fit.free, back).cost > allowed:
        back = fit.z.copy()
        for place in idle:
            moved = back.copy()
            moved[place] = 0.0
            if point_at(problem, fit.free, moved).cost <= allowed:
                back = moved
    return fit if np.array_equal(back, fit.z) else map_fit(problem, fit.free, back, 1)
