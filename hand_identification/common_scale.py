"""The common scale of all torques, which a motion does not show: where nothing measures one, its prior decides.

Inertia, drag, stiffness, friction and the gain of the input may all be larger by one factor, and the joint moves as it
did (Eq. 8 is homogeneous in them). In that direction the cost of a fit hardly changes; the fit is drawn along it by
what its model cannot describe, and returns in steps that are too short to count. So the way back is tried at once.
"""

from __future__ import annotations

import math
import re

from scipy.optimize import minimize_scalar

from hand_identification.joint_problem import FORCE, JointProblem
from hand_identification.map_fit import MapFit, map_fit
from hand_identification.settings import FITS
from hand_model.arrays import Array

_TORQUE = re.compile(r"_nm(_|$)|_kg_m2$")
"""Parameters in proportion to which a torque or a moment of inertia is, by the unit at the end of their key."""


def at_prior_scale(problem: JointProblem, fit: MapFit) -> MapFit:
    """A fit continued from where all torques are scaled alike towards their prior, where that one costs less."""
    torques = {k: parameter for k, parameter in enumerate(fit.free) if _TORQUE.search(parameter.key)}
    measured = any(bool(segment.use[FORCE].any()) for segment in problem.segments)
    if measured or problem.driven or not torques:
        return fit
    values = problem.columns(fit.free, fit.z[None])[0][0]

    def scaled(logarithm: float) -> Array:
        z = fit.z.copy()
        for k, parameter in torques.items():
            z[k] = parameter.coordinate(math.exp(logarithm) * values[parameter.row])
        return z

    def prior(logarithm: float) -> float:
        return float((scaled(logarithm) ** 2).sum())

    best = minimize_scalar(prior, bounds=(-FITS.longest_scale, FITS.longest_scale), method="bounded")
    if prior(0.0) - best.fun < FITS.least_scale_gain:
        return fit
    again = map_fit(problem, fit.free, scaled(best.x), FITS.iterations)
    return again if again.cost < fit.cost else fit
