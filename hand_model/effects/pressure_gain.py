"""The pressure sensor has a span error."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """True pressure per reading."""
    (error,) = q
    return (1.0 / (1.0 + error),)


@inline
def pressure_reading(q, p):  # type: ignore[no-untyped-def]
    """Reading of the true pressure p."""
    return p * (1.0 + q[0])


@inline
def pressure_true(q, reading):  # type: ignore[no-untyped-def]
    """The true pressure behind a reading."""
    return reading * q[1]


EFFECT = Effect(
    name="pressure_gain",
    place="pressure_sensor",
    needs=("input_sensor",),
    parameters=(Parameter("pressure_gain.error", -0.5, 0.5, "relative error of the span", 1.0, 0.0, 0.005),),
    prepared=("per_span",),
    hooks={"prepare": prepare, "pressure_reading": pressure_reading, "pressure_true": pressure_true},
    keys=("pressure_gain.error",),
    probes=((0.04,), (-0.04,)),
    says="the {pressure} sensor reads {error} (relative) too much",
    experiments=("staircase",),
    doc="Span error of a piezoresistive sensor.",
    source="IEC 61298-2, span error",
    constitution=Constitution(
        acts_on="reading of the pressure",
        sign="either",
        monotone="rises with the pressure",
        over=("pressure",),
        source="ratiometric sensor, Martin et al. 2004",
    ),
)
