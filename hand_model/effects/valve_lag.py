"""The valve is slower than its model: a longer time constant or a further one."""

from __future__ import annotations

from hand_model.effects.effect import TINY_S, Effect, Times, decay, declare, inline, remember
from hand_model.plant_parameters import Parameter

TAU, VENTING = declare(
    Parameter("valve_lag.time_constant_s", 0.0, 1.0, "second lag of the valve", 1.0, 0.0, 0.03),
    Parameter("valve_lag.venting_ratio", 0.2, 5.0, "time constant while venting over that while filling", 1.0, 1.0),
)
LAGGED = remember()


@inline
def set_point(w, i, u, p, e, h):  # type: ignore[no-untyped-def]
    """First-order lag ahead of the valve's own: its mean over the step, in which u is constant."""
    tau, behind = w[TAU, i], w[LAGGED, i] - u
    left = behind * decay(h / (tau + TINY_S))
    w[LAGGED, i] = u + left
    return u + (behind - left) * tau / h


@inline
def valve_error(w, i, error):  # type: ignore[no-untyped-def]
    """Venting has a time constant of its own."""
    return error if error > 0.0 else error / w[VENTING, i]


EFFECT = Effect(
    "valve_lag",
    "valve",
    ("valve_lag.time_constant_s", "valve.time_constant_s", "valve_lag.venting_ratio"),
    ((0.02, Times(1.0), 1.0), (0.08, Times(1.0), 1.0), (0.0, Times(1.6), 1.0), (0.0, Times(0.5), 1.0)),
    "the valve is slower than modelled: lags of {time_constant_s} ({venting_ratio} times that while venting)",
    ("steps", "multisine"),
    "A valve of second order, or of another time constant than the nominal one, or one while venting.",
    "Eq. 8's separately identified valve, Martin et al. 2004",
    {"set_point": set_point, "valve_error": valve_error},
    {"valve_lag.venting_ratio": 0.2},
    starts=((LAGGED, "pressure"),),
    shape=("valve.time_constant_s", "valve_lag.venting_ratio"),
)
