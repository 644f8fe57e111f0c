"""Two switching valves and their pressure loop in place of an analog pressure valve.

It is no mismatch to be searched for but the choice `valve_kind: switching` of the description.
"""

from __future__ import annotations

from hand_model.effects.effect import ANGLE, ATMOSPHERE_PA, SPEED, Effect, declare, inline, remember
from hand_model.plant_parameters import PLANT_ROW, Parameter
from hand_model.pressure_loop import open_rate, pulse
from hand_model.statics import chamber_volume

ON, CONDUCTANCE, CRITICAL, PERIOD, SHORTEST, RESPONSE, DEADBAND, VOLUME = declare(
    Parameter("switching_valve.share", 0.0, 1.0, "1: two switching valves; set by `valve_kind`", 1.0, 0.0, 1.0),
    Parameter("switching_valve.conductance_m3_per_s_pa", 1e-11, 1e-6, "sonic conductance C, ISO 6358", 1.0, 3e-10),
    Parameter("switching_valve.critical_ratio", 0.0, 0.9, "critical pressure ratio b, ISO 6358", 1.0, 0.3),
    Parameter("switching_valve.period_s", 1e-3, 0.1, "PWM period", 1.0, 0.01),
    Parameter("switching_valve.shortest_s", 0.0, 0.05, "shortest opening", 1.0, 5e-4),
    Parameter("switching_valve.response_s", 1e-3, 1.0, "response time of the pressure loop", 1.0, 0.03),
    Parameter("switching_valve.deadband_pa", 0.0, 5e4, "of the pressure loop", 1.0, 500.0),
    Parameter("switching_valve.volume_m3", 1e-7, 1e-3, "of actuator and tube, vented at 0", 1.0, 2e-6),
)
_volume = inline(chamber_volume.py_func)
PHASE, SAVED, PULSE = remember(), remember(), remember()
_A2, _A3 = PLANT_ROW["statics.a2_nm_per_pa"], PLANT_ROW["statics.a3_nm_per_pa_rad"]
_SUPPLY = PLANT_ROW["supply.pressure_pa"]
_GROWTH = 1.2e-12


@inline
def _rates(w, i, p, volume):  # type: ignore[no-untyped-def]
    here, full = max(p, 0.0) + ATMOSPHERE_PA, w[_SUPPLY, i] + ATMOSPHERE_PA
    fill = open_rate(full, here, w[CONDUCTANCE, i], w[CRITICAL, i], volume)
    return fill, open_rate(here, ATMOSPHERE_PA, w[CONDUCTANCE, i], w[CRITICAL, i], volume)


@inline
def step(w, i, p, u, e, h):  # type: ignore[no-untyped-def]
    """Pressure [Pa] after h [s]: the loop runs where a PWM period begins, and flow and motion change the pressure."""
    left = w[PHASE, i]
    if left < 0.5 * h:
        fill, vent = _rates(w, i, p, w[VOLUME, i])
        share, w[SAVED, i] = pulse(
            u - p, w[SAVED, i], w[RESPONSE, i], w[DEADBAND, i], w[PERIOD, i], w[SHORTEST, i], fill, vent
        )
        w[PULSE, i] = share * w[PERIOD, i]
        left += w[PERIOD, i]
    w[PHASE, i] = left - h
    opened = min(max(w[PULSE, i], -h), h)
    w[PULSE, i] -= opened
    phi = e[ANGLE]
    displaced = w[_A2, i] + w[_A3, i] * phi
    volume = max(_volume(p, phi, w[VOLUME, i], _GROWTH, w[_A2, i], w[_A3, i]), 1e-7)
    fill, vent = _rates(w, i, p, volume)
    rate = (fill * max(opened, 0.0) + vent * min(opened, 0.0)) / h
    rate -= (p + ATMOSPHERE_PA) * displaced * e[SPEED] / volume
    return min(max(p + h * rate, -ATMOSPHERE_PA), w[_SUPPLY, i])


EFFECT = Effect(
    "switching_valve",
    "valve",
    (),
    (),
    "two switching valves and a pressure loop stand in place of an analog pressure valve",
    (),
    "Pulse-width modulated fill and vent valves; the loop knows their flow.",
    "ISO 6358-1:2013, flow characteristics of pneumatic components",
)
