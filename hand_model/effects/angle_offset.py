"""The angle sensor has a zero error."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import DEGREE, Parameter


@inline
def angle_reading(q, phi):  # type: ignore[no-untyped-def]
    """Reading of the true angle phi."""
    (offset,) = q
    return phi + offset


EFFECT = Effect(
    name="angle_offset",
    place="angle_sensor",
    parameters=(Parameter("angle_offset.offset_deg", -60.0, 60.0, "reading minus true angle", DEGREE, 0.0, 2.0),),
    hooks={"angle_reading": angle_reading},
    keys=("angle_offset.offset_deg",),
    probes=((2.0,), (-2.0,)),
    says="the {angle} sensor reads {offset_deg} too much",
    experiments=("stops", "staircase"),
    doc="Zero error of the Hall sensor.",
    source="Eq. 1, phi_0, Martin et al. 2004",
    constitution=Constitution(
        acts_on="reading of the angle",
        sign="either",
        monotone="constant",
        over=(),
        source="two-point calibration, Martin et al. 2004",
    ),
)
