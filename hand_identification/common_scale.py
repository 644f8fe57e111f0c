"""The common scale of all torques, which a motion does not show: where nothing measures one, its prior decides.

Inertia, drag, stiffness, friction and the gain of the input, or that of a drive, may all be larger by one factor, and
the joint moves as it did (Eq. 8 is homogeneous in them). So may the gain of a drive and, by the inverse, that of the
input. In these directions the cost of a fit hardly changes; the fit is drawn along them by what its model cannot
describe, and returns in steps that are too short to count. So the way back is tried at once.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from scipy.optimize import minimize_scalar

from hand_identification.joint_problem import FORCE, JointProblem
from hand_identification.map_fit import MapFit, map_fit
from hand_identification.settings import FITS
from hand_model.arrays import Array

_TORQUE = re.compile(r"_nm(_|$)|_kg_m2$")
"""Parameters in proportion to which a torque or a moment of inertia is, by the unit at the end of their key."""
_DRIVE, _INPUT = "drive_gain.error", "statics.a2_nm_per_pa"
"""The relative error of the gain of a drive, and the gain of the input, which it multiplies."""


def at_prior_scale(problem: JointProblem, fit: MapFit) -> MapFit:
    """A fit continued from where all torques are scaled alike towards their prior, where that one costs less."""
    places = {parameter.key: k for k, parameter in enumerate(fit.free)}
    scaled = {k: 1.0 for key, k in places.items() if _TORQUE.search(key) or key == _DRIVE}
    if {_DRIVE, _INPUT} <= places.keys():
        fit = _nearer(problem, fit, {places[_DRIVE]: 1.0, places[_INPUT]: -1.0})
        del scaled[places[_INPUT]]
    measured = any(bool(segment.use[FORCE].any()) for segment in problem.segments)
    return fit if measured or problem.driven or not scaled else _nearer(problem, fit, scaled)


def _nearer(problem: JointProblem, fit: MapFit, powers: Mapping[int, float]) -> MapFit:
    """The fit continued nearer to the prior by a factor, to these powers, of parameters at these places among the free
    ones, where that costs less.
    """
    values = problem.columns(fit.free, fit.z[None])[0][0]

    def scaled(logarithm: float) -> Array:
        z = fit.z.copy()
        for k, power in powers.items():
            parameter, factor = fit.free[k], math.exp(power * logarithm)
            value = float(values[parameter.row])
            z[k] = parameter.coordinate(factor * (1.0 + value) - 1.0 if parameter.key == _DRIVE else factor * value)
        return z

    def prior(logarithm: float) -> float:
        return float((scaled(logarithm) ** 2).sum())

    best = minimize_scalar(prior, bounds=(-FITS.longest_scale, FITS.longest_scale), method="bounded")
    if prior(0.0) - best.fun < FITS.least_scale_gain:
        return fit
    again = map_fit(problem, fit.free, scaled(best.x), FITS.iterations)
    return again if again.cost < fit.cost else fit
