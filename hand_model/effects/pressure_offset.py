"""The pressure sensor has a zero error."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def pressure_reading(q, p):  # type: ignore[no-untyped-def]
    """Reading of the true pressure p."""
    (offset,) = q
    return p + offset


@inline
def pressure_true(q, reading):  # type: ignore[no-untyped-def]
    """The true pressure behind a reading."""
    (offset,) = q
    return reading - offset


EFFECT = Effect(
    name="pressure_offset",
    place="pressure_sensor",
    needs=("input_sensor",),
    parameters=(Parameter("pressure_offset.offset_pa", -2e5, 2e5, "reading minus true pressure", 1.0, 0.0, 5e3),),
    hooks={"pressure_reading": pressure_reading, "pressure_true": pressure_true},
    keys=("pressure_offset.offset_pa",),
    probes=((5e3,), (-5e3,)),
    says="the {pressure} sensor reads {offset_pa} too much",
    experiments=("staircase", "hold"),
    doc="Zero error of a piezoresistive sensor.",
    source="IEC 61298-2, zero error",
    constitution=Constitution(
        acts_on="reading of the pressure",
        sign="either",
        monotone="constant",
        over=(),
        source="ratiometric sensor, Martin et al. 2004",
    ),
)
