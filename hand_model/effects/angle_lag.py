"""The angle reading lags behind the joint."""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import Effect
from hand_model.effects.operators import lagged_twice, two_lag_constants
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Constants of both filters."""
    tau, second = q
    return two_lag_constants(tau, second, h)


@inline
def angle_sensor(q, m, phi, h):  # type: ignore[no-untyped-def]
    """One first-order filter, or two in series."""
    return lagged_twice(m, phi, (q[2], q[3], q[4], q[5]))


@inline
def angle_reading(q, m, phi):  # type: ignore[no-untyped-def]
    """Output of the filters."""
    _, _, output = m
    return output


EFFECT = Effect(
    name="angle_lag",
    place="angle_sensor",
    parameters=(
        Parameter("angle_lag.time_constant_s", 0.0, 0.5, "of the filters together", 1.0, 0.0, 0.01),
        Parameter("angle_lag.second", 0.0, 0.5, "share of a second filter in it", 1.0, 0.0, 0.1),
    ),
    prepared=("kept_1", "slowness_1", "kept_2", "slowness_2"),
    memory={"input": "angle", "first": "angle", "output": "angle"},
    hooks={"prepare": prepare, "angle_sensor": angle_sensor, "angle_reading": angle_reading},
    keys=("angle_lag.time_constant_s", "angle_lag.second"),
    probes=((0.01, 0.25), (0.04, 0.25)),
    shape=("angle_lag.second",),
    says="the {angle} reading lags by {time_constant_s}",
    experiments=("steps", "multisine"),
    doc="Low-pass filter between the joint and its reading, of first or second order.",
    source="first-order filters in series",
    constitution=Constitution(
        acts_on="reading of the angle",
        sign="behind the angle, without an error at rest",
        monotone="no overshoot",
        memory="one or two real poles",
        over=("time",),
        source="anti-alias filter of real poles, Oppenheim and Schafer, 2010",
    ),
)
