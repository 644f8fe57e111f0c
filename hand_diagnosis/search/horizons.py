"""Starts of fits for an axis that nothing but friction ties to its input, as a pendulum that swings after a release.

It keeps every error of its model for good: from a far start, late swings are wrong by whole turns, and the cost has a
minimum for each of them. Fits to the first part of every recording, then to more of it, lead to the right one, as the
intervals of multiple shooting do (Bock, in Modelling of Chemical Reaction Systems, Springer 1981).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from hand_diagnosis.problem import slice_of
from hand_diagnosis.settings import SETTINGS, FitPass
from hand_identification.free_parameters import FreeParameter
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import map_fit
from hand_model.arrays import Array


def from_the_first_part(problem: JointProblem, free: Sequence[FreeParameter], start: Array, fit_pass: FitPass) -> Array:
    """Coordinates (free,) [-] by fits from a start to ever more of every recording, but not to all of it."""
    z = start
    for share in SETTINGS.horizons:
        segments = [slice_of(s, 0, max(round(share * len(s.angle_rad)), 2)) for s in problem.segments]
        z = map_fit(replace(problem, segments=segments), free, z, fit_pass.iterations, fit_pass.tolerance).z
    return z
