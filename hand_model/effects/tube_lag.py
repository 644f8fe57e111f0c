"""The pressure in the actuator lags behind the measured one."""

from __future__ import annotations

from hand_model.effects.effect import Effect
from hand_model.effects.operators import lagged_twice, two_lag_constants
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Constants of both volumes."""
    tau, second = q
    return two_lag_constants(tau, second, h)


@inline
def actuator_pressure(q, m, p, h):  # type: ignore[no-untyped-def]
    """A line of one volume, or of two in series."""
    before, first, output = lagged_twice(m, p, (q[2], q[3], q[4], q[5]))
    return output, (before, first, output)


EFFECT = Effect(
    name="tube_lag",
    place="fluid",
    parameters=(
        Parameter("tube_lag.time_constant_s", 0.0, 1.0, "from the sensor to the actuator", 1.0, 0.0, 0.03),
        Parameter("tube_lag.second", 0.0, 0.5, "share of a second volume in it", 1.0, 0.0, 0.1),
    ),
    prepared=("kept_1", "slowness_1", "kept_2", "slowness_2"),
    memory={"input": "pressure", "first": "pressure", "output": "pressure"},
    hooks={"prepare": prepare, "actuator_pressure": actuator_pressure},
    keys=("tube_lag.time_constant_s", "tube_lag.second"),
    probes=((0.02, 0.25), (0.08, 0.25)),
    shape=("tube_lag.second",),
    says="the {pressure} in the actuator lags the measured {pressure} by {time_constant_s}",
    experiments=("steps", "multisine"),
    doc="Laminar resistance of the tube with the capacity of the actuator, as one volume or two.",
    source="Beater, Pneumatic Drives, 2007, tubes",
)
