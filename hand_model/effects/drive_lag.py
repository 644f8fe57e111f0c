"""The torque of a drive follows its input with a lag: a current loop, a field, a filter of the command."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.effects.operators import lag_constants, lagged
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Constants of the lag."""
    return lag_constants(q[0], h)


@inline
def actuator_pressure(q, m, p, h):  # type: ignore[no-untyped-def]
    """A lag of first order."""
    before, output = m
    output = lagged(output, before, p, q[1], q[2])
    return output, (p, output)


EFFECT = Effect(
    name="drive_lag",
    place="joint",
    needs=("drive",),
    parameters=(Parameter("drive_lag.time_constant_s", 0.0, 5.0, "of the drive", 1.0, 0.0, 0.03),),
    prepared=("kept", "slowness"),
    memory={"input": "pressure", "output": "pressure"},
    hooks={"prepare": prepare, "actuator_pressure": actuator_pressure},
    keys=("drive_lag.time_constant_s",),
    probes=((0.005,), (0.02,), (0.08,), (0.3,)),
    says="the drive follows its {pressure} with a lag of {time_constant_s}",
    experiments=("steps", "multisine"),
    doc="The torque of the drive follows its input as a lag of first order.",
    source="Isermann, Mechatronic Systems, 2005, electrical drives",
    constitution=Constitution(
        acts_on="input of the drive",
        sign="behind the input, without an error at rest",
        monotone="no overshoot",
        memory="one real pole",
        over=("time",),
        source="resistance and inductance of a winding, Isermann, Mechatronic Systems, 2005",
    ),
)
