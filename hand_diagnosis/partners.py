"""The coupled phalanx moves as its model says, not as its sensor shows it.

A joint feels the acceleration of its partner (Eq. 8 with the coupling inertia). Taken from the partner's measured
angle, a fault of that sensor would look like missing physics of this joint. Once both joints have a model, the
acceleration that the partner's model gives, its sensor's faults left out, can take its place where that fits better.
"""

from __future__ import annotations

from collections.abc import Sequence

from hand_diagnosis.evidence import log_likelihood
from hand_identification.joint_problem import JointProblem
from hand_identification.map_fit import MapFit, map_fit
from hand_model.arrays import Array
from hand_model.effects import CATALOGUE
from hand_model.effects.effect import PARTNER
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW
from hand_recording.signals import derivatives

WORTH = 4.0
"""Log likelihood that the model's acceleration must bring to replace the measured one."""
_SENSOR = [ROW[key] for effect in CATALOGUE if effect.place == "angle_sensor" for key in effect.keys]


def model_accelerations(problem: JointProblem, fit: MapFit) -> list[Array]:
    """Acceleration (T,) [rad/s^2] of the joint itself in every segment, by its fitted model."""
    columns, starts = problem.columns(fit.free, fit.z[None])
    for row in _SENSOR:
        columns[:, row] = (JOINT_PARAMETERS[row].neutral or 0.0) * JOINT_PARAMETERS[row].scale
    predicted = problem.predict(columns, starts)
    return [
        derivatives(one[0, 1][:, None], segment.period_s)[1][:, 0]
        for one, segment in zip(predicted, problem.segments, strict=True)
    ]


def put_partner(problem: JointProblem, accelerations: Sequence[Array]) -> None:
    """Set the partner's acceleration in every segment."""
    for segment, acceleration in zip(problem.segments, accelerations, strict=True):
        segment.exogenous[:, PARTNER] = acceleration


def fits_better(problem: JointProblem, fit: MapFit, accelerations: Sequence[Array]) -> bool:
    """Whether the nominal model of a joint, fitted as fit, would fit clearly better with these of its partner."""
    measured = [segment.exogenous[:, PARTNER].copy() for segment in problem.segments]
    put_partner(problem, accelerations)
    beside = map_fit(problem, fit.free, fit.z, 3)
    put_partner(problem, measured)
    before, after = (log_likelihood(problem, one.squares, ~problem.held_out) for one in (fit, beside))
    return after > before + WORTH
