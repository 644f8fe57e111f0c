"""The last fit of a model: below the practical floor.

Which effects are missing is judged against the floor; once that is settled there is no reason to leave, for the sake of
priors, what the same numbers explain.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit, map_fit
from hand_recording.signals import white_noise

SHARPER, ITERATIONS = 25.0, 6
"""Weight of the data, relative to that of the practical floor; iterations of the fit."""
COLOURED = 1.05
"""Root mean square of a residual over its white noise from which there is something to polish."""


def polished(problem: JointProblem, fit: MapFit) -> MapFit:
    """The fit, gone on with sharper weights; its cost and the errors of its numbers stay those of the floor."""
    sharp = replace(problem, weight=SHARPER * problem.weight)
    done = map_fit(sharp, fit.free, fit.z, ITERATIONS)
    train = ~problem.held_out
    cost = float((problem.weight[:, None] * done.squares[:, train]).sum() + done.z @ done.z)
    return replace(done, cost=cost, normal=done.normal / SHARPER)


def coloured(problem: JointProblem, fit: MapFit) -> bool:
    """Whether any residual is clearly more than white noise."""
    for segment, residual in zip(problem.segments, fit.residuals, strict=True):
        for stage in np.flatnonzero(segment.use.any(axis=1)):
            left = residual[stage][segment.use[stage]]
            if float(np.sqrt(np.mean(left**2))) > COLOURED * white_noise(left):
                return True
    return False
