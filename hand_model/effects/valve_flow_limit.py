"""The flow through the valve is limited: filling and venting have their own limits, choked or not."""

from __future__ import annotations

import math

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import ATMOSPHERE_PA, Effect, Times
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter
from hand_model.pressure_loop import subsonic

CRITICAL = 0.3
"""Critical pressure ratio of a small valve; by the law it has its own."""


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Reciprocals of the supply pressure, absolute and gauge, and of the law's values at the full difference."""
    _, fill_1, fill_2, fill_3, vent_1, vent_2, vent_3, _, critical, supply, fill, vent, tau = q
    per_fill, per_vent = 1.0 / (1.0 + fill_1 + fill_2 + fill_3), 1.0 / (1.0 + vent_1 + vent_2 + vent_3)
    per_filling, per_venting = 1.0 / max(fill * tau, 1.0), 1.0 / max(vent * tau, 1.0)
    per_span = 1.0 / (1.0 - critical)
    return 1.0 / (supply + ATMOSPHERE_PA), 1.0 / supply, per_fill, per_vent, per_filling, per_venting, per_span


@inline
def valve_error(q, error):  # type: ignore[no-untyped-def]
    """By the law the flow approaches its limit gradually. The result has the sign of the error and never exceeds it.

    An error of x times the one that reaches the limit acts like f, with (1 - g^2) f^2 - (1 + x) f + x = 0: a
    hyperbola between the lines f = x and f = 1, and x / (1 + x) where g is 1. Where g is 0, the error remains as it is,
    and the limit alone makes both lines of it.
    """
    gradual, per_filling, per_venting = q[7], q[17], q[18]
    share = error * per_filling if error > 0.0 else -error * per_venting
    root = math.sqrt((1.0 - share) * (1.0 - share) + 4.0 * gradual * gradual * share)
    bent = 2.0 * error / (1.0 + share + root)
    return bent if gradual > 0.0 else error


@inline
def flow_limit(q, limit, p, fills):  # type: ignore[no-untyped-def]
    """The limit follows the pressures on both sides of the valve.

    By the law it also grows with the difference that drives the flow, by increments for each third of the supply
    pressure that cannot be negative; at the full difference it is the textbook limit.
    """
    choking, per_full = q[0], q[13]
    here = p + ATMOSPHERE_PA
    ratio = here * per_full if fills else ATMOSPHERE_PA / max(here, 1.0)
    upstream = 1.0 if fills else here * per_full  # over the absolute supply pressure
    choked = subsonic(ratio, q[8], q[19]) * upstream
    share = min(max(p * q[14], 0.0), 1.0)
    filling = 1.0 if fills else 0.0  # selected values would be conditional reads, which are not vectorised
    driving = 3.0 * (filling + share - 2.0 * filling * share)
    a, b = q[4] + filling * (q[1] - q[4]), q[5] + filling * (q[2] - q[5])
    c, per_all = q[6] + filling * (q[3] - q[6]), q[16] + filling * (q[15] - q[16])
    grown = 1.0 + a * min(driving, 1.0) + b * min(max(driving - 1.0, 0.0), 1.0) + c * max(driving - 2.0, 0.0)
    return limit * (1.0 - choking + choking * choked) * (grown * per_all)


def curve(q, x, y):  # type: ignore[no-untyped-def]
    """Limit [Pa/s] at the pressure x [Pa] of filling where y is 0, and of venting elsewhere."""
    return float(flow_limit(q, q[10] if y == 0.0 else q[11], x, y == 0.0))


_GROWTHS = tuple(
    Parameter(
        f"valve_flow_limit.{side}_{k}", 0.0, 100.0, f"law: growth over third {k} of the difference", 1.0, 0.0,
        0.5, law=True,
    )
    for side in ("fill", "vent")
    for k in (1, 2, 3)
)  # fmt: skip
EFFECT = Effect(
    name="valve_flow_limit",
    place="valve",
    needs=("valve",),
    parameters=(
        Parameter("valve_flow_limit.choking", 0.0, 1.0, "0 a constant limit, 1 a choked one", 1.0, 0.0, 0.17),
        *_GROWTHS,
        Parameter(
            "valve_flow_limit.gradual",
            0.0,
            1.0,
            "law: 0 a sharp limit, 1 a gradual approach to it",
            1.0,
            0.0,
            0.2,
            law=True,
        ),
        Parameter("valve_flow_limit.critical", 0.0, 0.8, "law: critical pressure ratio", 1.0, CRITICAL, 0.05, law=True),
    ),
    reads=("supply.pressure_pa", "valve.fill_rate_pa_per_s", "valve.vent_rate_pa_per_s", "valve.time_constant_s"),
    prepared=("per_full", "per_supply", "per_fill", "per_vent", "per_filling", "per_venting", "per_span"),
    hooks={"prepare": prepare, "valve_error": valve_error, "flow_limit": flow_limit},
    keys=("valve.fill_rate_pa_per_s", "valve.vent_rate_pa_per_s", "valve_flow_limit.choking"),
    probes=(
        (Times(0.1), Times(0.1), 0.0),
        (Times(0.1), Times(0.4), 0.0),
        (Times(0.4), Times(0.1), 0.0),
        (Times(0.2), Times(0.3), 0.8),
        (Times(0.04), Times(0.04), 0.0),
        (Times(0.06), Times(0.06), 1.0),
    ),
    spread={"valve.fill_rate_pa_per_s": 2.0, "valve.vent_rate_pa_per_s": 2.0},
    shape=("valve.fill_rate_pa_per_s", "valve.vent_rate_pa_per_s"),
    says="the valve fills at most {fill_rate_pa_per_s} and vents at most {vent_rate_pa_per_s}",
    experiments=("steps", "chirp"),
    doc="Sonic conductance bounds the flow; filling from the supply and venting to the room differ.",
    source="ISO 6358-1:2013, flow characteristics of pneumatic components",
    constitution=Constitution(
        acts_on="rate of the pressure through the valve",
        sign="bounds the rate on either side, towards the set-point only",
        passive=True,
        monotone="does not fall while the pressure difference that drives the flow grows",
        over=("pressure", "direction"),
        coefficients=(
            *(parameter.key for parameter in _GROWTHS),
            "valve_flow_limit.gradual",
            "valve_flow_limit.critical",
        ),
        quantity="the limit of filling, then of venting,",
        unit="pa_per_s",
        curve=curve,
        source="ISO 6358-1:2013: flow does not fall with the ratio of the pressures",
    ),
)
