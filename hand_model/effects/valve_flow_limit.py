"""The flow through the valve is limited: filling and venting have their own limits, choked or not."""

from __future__ import annotations

from hand_model.effects.effect import ATMOSPHERE_PA, Effect, Times
from hand_model.kernel.inline import inline
from hand_model.kernel.plant_rows import Parameter
from hand_model.pressure_loop import subsonic

CRITICAL = 0.3
"""Critical pressure ratio of a small valve."""
_PER_SPAN = 1.0 / (1.0 - CRITICAL)


@inline
def prepare(q, h):  # type: ignore[no-untyped-def]
    """Reciprocal of the absolute supply pressure."""
    return (1.0 / (q[1] + ATMOSPHERE_PA),)


@inline
def flow_limit(q, limit, p, fills):  # type: ignore[no-untyped-def]
    """The limit follows the pressures on both sides of the valve."""
    choking, per_full = q[0], q[2]
    here = p + ATMOSPHERE_PA
    ratio = here * per_full if fills else ATMOSPHERE_PA / max(here, 1.0)
    upstream = 1.0 if fills else here * per_full  # over the absolute supply pressure
    choked = subsonic(ratio, CRITICAL, _PER_SPAN) * upstream
    return limit * (1.0 - choking + choking * choked)


EFFECT = Effect(
    name="valve_flow_limit",
    place="valve",
    parameters=(Parameter("valve_flow_limit.choking", 0.0, 1.0, "0 a constant limit, 1 a choked one", 1.0, 0.0, 0.17),),
    reads=("supply.pressure_pa",),
    prepared=("per_full",),
    hooks={"prepare": prepare, "flow_limit": flow_limit},
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
)
