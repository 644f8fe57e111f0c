"""The catalogue of effects, one file each; the order of the imports is the order of their parameters and hooks."""

from __future__ import annotations

from hand_model.effects import (  # isort: skip - hooks that share a signal act in this order
    supply_droop,
    valve_hysteresis,
    valve_lag,
    valve_delay,
    valve_deadband,
    valve_flow_limit,
    switching_valve,
    hydraulic,
    leak,
    tube_lag,
    gas_compression,
    creep,
    hysteresis,
    stiffening,
    ageing,
    thermal_drift,
    coulomb_friction,
    viscous_friction,
    backlash,
    end_stop,
    gravity,
    added_inertia,
    joint_coupling,
    contact,
    constant_load,
    hall_misalignment,
    angle_gain,
    angle_offset,
    angle_lag,
    pressure_gain,
    pressure_offset,
    fsr_drift,
    fsr_hysteresis,
    fsr_gain,
    clock_offset,
    dropped_frames,
)
from hand_model.effects.effect import Effect, declared

CATALOGUE: tuple[Effect, ...] = (
    supply_droop.EFFECT,
    valve_hysteresis.EFFECT,
    valve_lag.EFFECT,
    valve_delay.EFFECT,
    valve_deadband.EFFECT,
    valve_flow_limit.EFFECT,
    switching_valve.EFFECT,
    hydraulic.EFFECT,
    leak.EFFECT,
    tube_lag.EFFECT,
    gas_compression.EFFECT,
    creep.EFFECT,
    hysteresis.EFFECT,
    stiffening.EFFECT,
    ageing.EFFECT,
    thermal_drift.EFFECT,
    coulomb_friction.EFFECT,
    viscous_friction.EFFECT,
    backlash.EFFECT,
    end_stop.EFFECT,
    gravity.EFFECT,
    added_inertia.EFFECT,
    joint_coupling.EFFECT,
    contact.EFFECT,
    constant_load.EFFECT,
    hall_misalignment.EFFECT,
    angle_gain.EFFECT,
    angle_offset.EFFECT,
    angle_lag.EFFECT,
    pressure_gain.EFFECT,
    pressure_offset.EFFECT,
    fsr_drift.EFFECT,
    fsr_hysteresis.EFFECT,
    fsr_gain.EFFECT,
    clock_offset.EFFECT,
    dropped_frames.EFFECT,
)
EFFECT_PARAMETERS, MEMORY = declared()
EFFECTS: dict[str, Effect] = {effect.name: effect for effect in CATALOGUE}
"""Every effect by its name."""


def markdown_table() -> str:
    """The catalogue as a Markdown table; docs/diagnosis.md carries it."""
    rows = ["| place | effect | what it is | shown by | source |", "|---|---|---|---|---|"]
    for effect in CATALOGUE:
        if effect.keys or effect.place == "timing":  # the others are choices of the description
            shown = ", ".join(effect.experiments) or "-"
            rows.append(f"| {effect.place} | `{effect.name}` | {effect.doc} | {shown} | {effect.source} |")
    return "\n".join(rows) + "\n"
