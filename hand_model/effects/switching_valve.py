"""Two switching valves and their pressure loop in place of an analog pressure valve.

A search does not try it. The description chooses it with `valve_kind: switching`.
"""

from __future__ import annotations

from hand_model.effects.constitution import Constitution
from hand_model.effects.effect import ANGLE, ATMOSPHERE_PA, SPEED, Effect
from hand_model.kernel.inline import inline, inlined
from hand_model.kernel.plant_rows import Parameter
from hand_model.pressure_loop import open_rate, pulse
from hand_model.statics import chamber_volume, leverage

_volume, _leverage = inlined(chamber_volume), inlined(leverage)
GROWTH_M3_PER_PA = 1.2e-12
"""Growth of the chamber's volume with pressure."""
SMALLEST_M3 = 1e-7
"""No chamber is taken as smaller, whatever the parameters."""


@inline
def _rates(p, supply, conductance, critical, volume):  # type: ignore[no-untyped-def]
    """Pressure rates [Pa/s] while the fill valve or the vent valve is open."""
    here, full = max(p, 0.0) + ATMOSPHERE_PA, supply + ATMOSPHERE_PA
    fill = open_rate(full, here, conductance, critical, volume)
    return fill, open_rate(here, ATMOSPHERE_PA, conductance, critical, volume)


@inline
def _begun(q, m, p, u, h):  # type: ignore[no-untyped-def]
    """Memory at the beginning of a step: where a PWM period begins, the pressure loop chooses a pulse."""
    _, conductance, critical, period, shortest, response, deadband, vented, supply, _, _ = q
    remaining, saved, open_s = m
    if remaining < 0.5 * h:
        fill, vent = _rates(p, supply, conductance, critical, vented)
        share, saved = pulse(u - p, saved, response, deadband, period, shortest, fill, vent)
        remaining, open_s = remaining + period, share * period
    return remaining, saved, open_s


@inline
def valve(q, m, p, u, e, h):  # type: ignore[no-untyped-def]
    """Pressure after h: flow through the valves for as long as they are open, and motion, change it.

    Mass is conserved at constant temperature: V p_abs' + p_abs V' is P_0 C p_1 psi, and V grows with the pressure.
    """
    _, conductance, critical, _, _, _, _, vented, supply, a2, a3 = q
    remaining, saved, open_s = _begun(q, m, p, u, h)
    opened = min(max(open_s, -h), h)
    volume = max(_volume(p, e[ANGLE], vented, GROWTH_M3_PER_PA, a2, a3), SMALLEST_M3)
    volume += GROWTH_M3_PER_PA * (p + ATMOSPHERE_PA)
    fill, vent = _rates(p, supply, conductance, critical, volume)
    rate = (fill * max(opened, 0.0) + vent * min(opened, 0.0)) / h
    rate -= (p + ATMOSPHERE_PA) * _leverage(e[ANGLE], a2, a3) * e[SPEED] / volume
    return min(max(p + h * rate, -ATMOSPHERE_PA), supply), (remaining - h, saved, open_s - opened)


EFFECT = Effect(
    name="switching_valve",
    place="valve",
    needs=("valve",),
    parameters=(
        Parameter("switching_valve.share", 0.0, 1.0, "1: two switching valves; set by `valve_kind`", 1.0, 0.0, 1.0),
        Parameter("switching_valve.conductance_m3_per_s_pa", 1e-11, 1e-6, "sonic conductance C, ISO 6358", 1.0, 3e-10),
        Parameter("switching_valve.critical_ratio", 0.0, 0.9, "critical pressure ratio b, ISO 6358", 1.0, 0.3),
        Parameter("switching_valve.period_s", 1e-3, 0.1, "PWM period", 1.0, 0.01),
        Parameter("switching_valve.shortest_s", 0.0, 0.05, "shortest opening", 1.0, 5e-4),
        Parameter("switching_valve.response_s", 1e-3, 1.0, "response time of the pressure loop", 1.0, 0.03),
        Parameter("switching_valve.deadband_pa", 0.0, 5e4, "of the pressure loop", 1.0, 500.0),
        Parameter("switching_valve.volume_m3", 1e-7, 1e-3, "of actuator and tube, vented at 0", 1.0, 2e-6),
    ),
    reads=("supply.pressure_pa", "statics.a2_nm_per_pa", "statics.a3_nm_per_pa_rad"),
    memory=("remaining_s", "saved", "open_s"),
    hooks={"valve": valve},
    says="two switching valves and a pressure loop stand in place of an analog pressure valve",
    doc="Pulse-width modulated fill and vent valves; the loop knows their flow.",
    source="ISO 6358-1:2013, flow characteristics of pneumatic components",
    constitution=Constitution(
        acts_on="pressure behind the valves",
        sign="towards the set-point",
        passive=True,
        monotone="flow does not fall with the pressure ratio",
        memory="the pulse of the period",
        over=("pressure", "direction"),
        source="ISO 6358-1:2013",
    ),
)
