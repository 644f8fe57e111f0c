"""The force reading creeps under load."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def force_sensor(q, m, force, h):  # type: ignore[no-untyped-def]
    """The crept part follows the force as a first-order lag; midpoint rule, and at most the whole way."""
    _, tau = q
    (crept,) = m
    return (crept + (force - crept) * min(h / (tau + 0.5 * h), 1.0),)


@inline
def force_reading(q, m, force):  # type: ignore[no-untyped-def]
    """The reading adds a share of the crept part to the force."""
    share, _ = q
    (crept,) = m
    return force + share * crept


EFFECT = Effect(
    name="fsr_drift",
    place="force_sensor",
    needs=("force_sensing_resistor",),
    parameters=(
        Parameter("fsr_drift.share", -0.9, 5.0, "of the force added under lasting load", 1.0, 0.0, 0.2),
        Parameter("fsr_drift.time_constant_s", 0.1, 1e3, "of the creep", 1.0, 10.0),
    ),
    memory=("crept",),
    hooks={"force_sensor": force_sensor, "force_reading": force_reading},
    keys=("fsr_drift.share", "fsr_drift.time_constant_s"),
    probes=((0.2, 3.0), (0.2, 20.0), (-0.2, 10.0)),
    spread={"fsr_drift.time_constant_s": 1.0},
    shape=("fsr_drift.time_constant_s",),
    says="under constant load the force reading creeps by {share} of itself with a time constant of {time_constant_s}",
    experiments=("hold", "taps"),
    doc="Creep of the polymer of a force sensing resistor.",
    source="one retardation term, Eq. 9, Martin et al. 2004",
    constitution=Constitution(
        acts_on="reading of the force",
        sign="that of the force",
        passive=True,
        monotone="rises under lasting load, ever more slowly",
        memory="one retardation",
        over=("time", "force"),
        source="Ferry, Viscoelastic Properties of Polymers, 1980",
    ),
)
