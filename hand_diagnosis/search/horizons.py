"""Starts of fits for an axis that swings freely after a release, as a pendulum does.

It keeps every error of its model for good: from a far start, late swings are wrong by whole turns, and the cost has a
minimum for each of them. Fits to the first part of every recording, then to more of it, lead to the right one, as the
intervals of multiple shooting do (Bock, in Modelling of Chemical Reaction Systems, Springer 1981).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hand_diagnosis.problem import slice_of, swings_freely
from hand_diagnosis.settings import SETTINGS, FitPass
from hand_identification.free_parameters import FreeParameter
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import map_fit
from hand_model.arrays import Array


def is_released(problem: JointProblem) -> bool:
    """Whether nothing drives an axis without elasticity: its input is constant in every recording."""
    return swings_freely(problem) and all(float(np.ptp(segment.driving_pa)) == 0.0 for segment in problem.segments)


def from_the_first_part(problem: JointProblem, free: Sequence[FreeParameter], start: Array, fit_pass: FitPass) -> Array:
    """Coordinates (free,) [-] by fits from a start to ever more of every recording, but not to all of it."""
    z = start
    for share in SETTINGS.horizons:
        segments = [slice_of(s, 0, max(round(share * len(s.angle_rad)), 2)) for s in problem.segments]
        z = map_fit(replace(problem, segments=segments), free, z, fit_pass.iterations, fit_pass.tolerance).z
    return z
