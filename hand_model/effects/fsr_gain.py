"""The force sensor has a span error."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def force_reading(q, force):  # type: ignore[no-untyped-def]
    """Reading of the true force."""
    (error,) = q
    return force * (1.0 + error)


EFFECT = Effect(
    name="fsr_gain",
    place="force_sensor",
    needs=("force_sensor",),
    parameters=(Parameter("fsr_gain.error", -0.9, 5.0, "relative error of the reading", 1.0, 0.0, 0.2),),
    hooks={"force_reading": force_reading},
    keys=("fsr_gain.error",),
    probes=((0.3,), (-0.3,)),
    says="the force sensor reads {error} (relative) too much",
    experiments=("taps", "closed_valve_push"),
    doc="Span error of a force sensing resistor.",
    source="Eq. 5, Martin et al. 2004",
    constitution=Constitution(
        acts_on="reading of the force",
        sign="either",
        monotone="rises with the force",
        over=("force",),
        source="Eq. 5, Martin et al. 2004",
    ),
)
