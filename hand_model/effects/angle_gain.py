"""The angle sensor has a span error."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def angle_reading(q, phi):  # type: ignore[no-untyped-def]
    """Reading of the true angle phi."""
    (error,) = q
    return phi * (1.0 + error)


EFFECT = Effect(
    name="angle_gain",
    place="angle_sensor",
    parameters=(Parameter("angle_gain.error", -0.5, 0.5, "relative error of the reading", 1.0, 0.0, 0.05),),
    hooks={"angle_reading": angle_reading},
    keys=("angle_gain.error",),
    probes=((0.05,), (-0.05,)),
    says="the {angle} sensor reads {error} (relative) too much",
    experiments=("stops", "staircase"),
    doc="Span error of the two-point calibration.",
    source="Eq. 3, Martin et al. 2004",
    constitution=Constitution(
        acts_on="reading of the angle",
        sign="either",
        monotone="rises with the angle",
        over=("angle",),
        source="two-point calibration, Martin et al. 2004",
    ),
)
