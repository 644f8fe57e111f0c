"""The valve is slower than its model: a longer time constant, a further one, or another one while venting."""

from __future__ import annotations

from hand_model.effects.effect import Effect, Times
from hand_model.effects.operators import lag_constants
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Constants of the lag, and the reciprocal of the ratio while venting."""
    tau, venting = q
    kept, slowness = lag_constants(tau, h)
    return kept, slowness, 1.0 / venting


@inline
def set_point(q, m, u, p, e, h):  # type: ignore[no-untyped-def]
    """First-order lag ahead of the valve's own: its mean over the step, in which u is constant."""
    kept, slowness = q[2], q[3]
    (lagged,) = m
    behind = lagged - u
    remaining = behind * kept
    return u + (behind - remaining) * slowness, (u + remaining,)


@inline
def valve_error(q, error):  # type: ignore[no-untyped-def]
    """Venting has a time constant of its own."""
    return error if error > 0.0 else error * q[4]


EFFECT = Effect(
    name="valve_lag",
    place="valve",
    parameters=(
        Parameter("valve_lag.time_constant_s", 0.0, 1.0, "second lag of the valve", 1.0, 0.0, 0.03),
        Parameter("valve_lag.venting_ratio", 0.2, 5.0, "time constant while venting over that while filling", 1.0, 1.0),
    ),
    prepared=("kept", "slowness", "per_venting"),
    memory={"lagged": "pressure"},
    hooks={"prepare": prepare, "set_point": set_point, "valve_error": valve_error},
    keys=("valve_lag.time_constant_s", "valve.time_constant_s", "valve_lag.venting_ratio"),
    probes=((0.02, Times(1.0), 1.0), (0.08, Times(1.0), 1.0), (0.0, Times(1.6), 1.0), (0.0, Times(0.5), 1.0)),
    spread={"valve_lag.venting_ratio": 0.2},
    shape=("valve.time_constant_s", "valve_lag.venting_ratio"),
    says="the valve is slower than modelled: lags of {time_constant_s} ({venting_ratio} times that while venting)",
    experiments=("steps", "multisine"),
    doc="A valve of second order, or of another time constant than the nominal one, or one while venting.",
    source="Eq. 8's separately identified valve, Martin et al. 2004",
)
