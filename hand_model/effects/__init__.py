"""The catalogue of effects, one file each; ORDER is the order of their parameters, their memory and their hooks."""

from __future__ import annotations

from importlib import import_module

from hand_model.effects.effect import OTHER_MACHINES, Effect, assemble

ORDER: tuple[str, ...] = (
    "supply_droop",
    "valve_hysteresis",
    "valve_lag",
    "valve_delay",
    "valve_deadband",
    "valve_flow_limit",
    "unnamed_pressure",
    "switching_valve",
    "hydraulic",
    "leak",
    "tube_lag",
    "drive_lag",
    "gas_compression",
    "creep",
    "hysteresis",
    "stiffening",
    "ageing",
    "thermal_drift",
    "coulomb_friction",
    "viscous_friction",
    "directional_friction",
    "gear_friction",
    "drive_elasticity",
    "backlash",
    "end_stop",
    "gravity",
    "spring",
    "cogging",
    "added_inertia",
    "joint_coupling",
    "contact",
    "constant_load",
    "unnamed_torque",
    "drive_gain",
    "drive_saturation",
    "hall_misalignment",
    "angle_gain",
    "angle_offset",
    "angle_lag",
    "pressure_gain",
    "pressure_offset",
    "fsr_drift",
    "fsr_hysteresis",
    "fsr_gain",
    "clock_offset",
    "command_delay",
    "dropped_frames",
)
"""Names of the files. Effects that share a signal act on it in this order."""


def _load(name: str) -> Effect:
    """The effect of one file, whose name it has."""
    effect: Effect = import_module(f"{__name__}.{name}").EFFECT
    if effect.name != name:
        raise ValueError(f"effect {effect.name}: its file is named '{name}'; both names must be the same")
    return effect


CATALOGUE: tuple[Effect, ...] = assemble(map(_load, ORDER))
EFFECTS: dict[str, Effect] = {effect.name: effect for effect in CATALOGUE}
"""Every effect by its name."""


def markdown_table() -> str:
    """The catalogue as a Markdown table; docs/diagnosis.md carries it."""
    rows = ["| place | effect | what it is | shown by | source |", "|---|---|---|---|---|"]
    for effect in CATALOGUE:
        if effect.keys or effect.place == "timing":  # the others are choices of the description
            shown = ", ".join(effect.experiments) or "-"
            rows.append(f"| {effect.place} | `{effect.name}` | {effect.doc} | {shown} | {effect.source} |")
    foreign = [f"`{effect.name}`" for effect in CATALOGUE if not OTHER_MACHINES.isdisjoint(effect.needs)]
    return "\n".join(rows) + f"\n\nNot offered to a hand, but to other machines: {', '.join(foreign)}.\n"


def class_table() -> str:
    """The classes as a Markdown table; docs/effects.md carries it. Raises ValueError for an effect without a class."""
    heads = (
        "effect",
        "acts on",
        "sign",
        "passive",
        "law",
        "memory",
        "may depend on",
        "coefficients",
        "constraints from",
    )
    rows = [f"| {' | '.join(heads)} |", "|" + "---|" * len(heads)]
    for effect in CATALOGUE:
        known = effect.constitution
        if known is None:
            raise ValueError(f"effect {effect.name}: its class is not stated")
        passive = {True: "yes", False: "no", None: "-"}[known.passive]
        over = ", ".join(known.over) or "-"
        cells = (known.acts_on, known.sign, passive, known.monotone, known.memory, over)
        rows.append(f"| `{effect.name}` | {' | '.join(cells)} | {len(known.coefficients) or '-'} | {known.source} |")
    return "\n".join(rows) + "\n"
