"""What a diagnosis found about a machine, in its file: numbers that changed, effects with their laws, and sizes.

`model.yaml` is the machine file that was given with the numbers found, so that it is read wherever that file is. The
keys under `effects` are those of the report, in the units of the machine. `sizes` are the force, travel and input to
which the fit was scaled: laws have their knots there, and they must stay where they are for other recordings.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ruamel.yaml.comments import CommentedMap

from hand_machine.description import NUMBERS, MachineDescription
from hand_model.arrays import Array
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW
from hand_model.quantities import UnitMap
from hand_model.yaml_document import YamlDocument, number_text
from hand_model.yaml_loader import DescriptionError

PARAMETER = {
    "gain": "statics.a2_nm_per_pa",
    "stiffness": "statics.a1_nm_per_rad",
    "damping": "dynamics.viscous_friction_nm_s_per_rad",
    "inertia": "dynamics.inertia_kg_m2",
}
"""Parameters of the model by the numbers of the machine file."""
NEGATIVE = "stiffness"
"""Number of the machine file whose parameter has the opposite sign (Eq. 6: a1 < 0 pulls back)."""
WEIGHT = "gravity.sine_nm"
ROUNDING = 1e-6
"""Relative distance from its range at which a value still counts as within: that of six digits."""
UNUSED = ("valve", "supply", "end_stop")
"""Groups that have no part in a machine unless an effect of theirs was found."""


@dataclass(frozen=True, slots=True)
class Found:
    """What the fit of an axis found, SI of its model: values, standard deviations and resolutions by key.

    own: keys of the effects that were found.  resolutions: see hand_identification.map_fit.MapFit.resolutions.
    """

    values: Mapping[str, float]
    deviations: Mapping[str, float]
    resolutions: Mapping[str, float]
    own: frozenset[str]


def put_effects(described: MachineDescription, units: UnitMap, parameters: Array) -> None:
    """Set the rows of the parameters (rows,) [SI of the model] that the section `effects` of a machine file gives.

    Raises DescriptionError for a value out of its range.
    """
    known = {units.quantity(key).key: key for key in ROW}
    for name, value in described.effects.items():
        key = known[name]
        low, high = _range(units, key)
        if not _is_within(value, low, high):
            raise DescriptionError(
                f"{described.path}: effects.{name} is {value:g}; the allowed range is {low:.4g} to {high:.4g}"
            )
        parameters[ROW[key]] = value / _shown(units, key)


def _range(units: UnitMap, key: str) -> tuple[float, float]:
    """The allowed range of a parameter in the units of the machine."""
    bound = JOINT_PARAMETERS[ROW[key]]
    factor = _shown(units, key) * bound.scale
    return bound.low * factor, bound.high * factor


def _is_within(value: float, low: float, high: float) -> bool:
    return low - abs(low) * ROUNDING <= value <= high + abs(high) * ROUNDING


def _shown(units: UnitMap, key: str) -> float:
    """The unit of the machine's key in one SI unit of the model [-]."""
    return units.quantity(key).factor / JOINT_PARAMETERS[ROW[key]].scale


def write_found_model(described: MachineDescription, units: UnitMap, found: Found, out: Path, comment: str) -> None:
    """Write the machine file with what was found, its comments kept. comment: lines at the top.

    Raises OSError where it cannot be written.
    """
    document = YamlDocument(described.path)
    rest = dict(found.values)
    for name in NUMBERS:
        key = PARAMETER[name]
        value = rest.pop(key, None)
        if value is not None and _is_stated(described, name, key, found):
            own = (-value if name == NEGATIVE else value) - described.controller.get(name, 0.0) / _shown(units, key)
            _set_number(document, name, _text(units, key, max(own, 0.0), found))
    if not described.linear and rest.get(WEIGHT, -1.0) >= 0.0:
        _set_number(document, "weight", _text(units, WEIGHT, rest.pop(WEIGHT), found))
    rest = {key: value for key, value in rest.items() if key in found.own or key.split(".")[0] not in UNUSED}
    for name in ("derivative_window", "effects", "sizes"):
        document.data.pop(name, None)
    if described.derivative_window_s is not None:
        document.data["derivative_window"] = float(f"{described.derivative_window_s:.4g}")
    effects = _effects(described, units, rest, found)
    if effects:
        document.data["effects"] = effects
    sizes = {"force": units.per_torque, "position": units.per_angle, "input": units.per_pressure}
    document.data["sizes"] = {name: float(value) for name, value in sizes.items()}
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(document.text(comment), encoding="utf-8")


def number_notes(units: UnitMap, found: Found) -> dict[str, str]:
    """Standard error and unit of the numbers at the top of a machine file, and the units of its `sizes`, by name."""
    notes = {"force": units.torque, "position": units.angle, "input": units.pressure}
    for name, key in {**PARAMETER, "weight": WEIGHT}.items():
        std = _shown(units, key) * found.deviations.get(key, math.nan)
        unit = units.quantity(key).unit
        notes[name] = f"± {std:.1g} {unit}" if math.isfinite(std) else unit
    return notes


def _is_stated(described: MachineDescription, name: str, key: str, found: Found) -> bool:
    """Whether a number is written: one of 0 in the file was enlarged only for the fit, unless an effect sets it."""
    return float(getattr(described, name)) != 0.0 or key in found.own


def _text(units: UnitMap, key: str, value: float, found: Found) -> str:
    factor = _shown(units, key)
    text = number_text(factor * value, factor * found.resolutions.get(key, math.nan))
    if _is_within(float(text), *_range(units, key)):
        return text
    return number_text(factor * value, abs(factor * value) * ROUNDING)  # rounded, it would leave its range


def _set_number(document: YamlDocument, name: str, text: str) -> None:
    """Put a number where the file has it: under `value`, where the number states how well it is known."""
    data = document.data
    if isinstance(data.get(name), dict):
        document.set_number(data[name], "value", text)
    elif name in data:
        document.set_number(data, name, text)
    else:  # what is written behind the last key belongs to it
        data.insert(max(len(data) - 1, 1), name, None)
        document.set_number(data, name, text)


def _effects(
    described: MachineDescription, units: UnitMap, values: Mapping[str, float], found: Found
) -> dict[str, CommentedMap]:
    """The section `effects`: what the file had there, overlaid with what was found."""
    known = {units.quantity(key).key: key for key in ROW}
    texts = {name: number_text(value) for name, value in described.effects.items()}
    texts |= {units.quantity(key).key: _text(units, key, value, found) for key, value in values.items()}
    return {name: _entry(units, known[name], text, found) for name, text in texts.items()}


def _entry(units: UnitMap, key: str, text: str, found: Found) -> CommentedMap:
    entry = CommentedMap(value=float(text))
    deviation = found.deviations.get(key)
    if deviation is not None and math.isfinite(deviation):
        entry["std"] = float(number_text(_shown(units, key) * deviation, 10.0 * _shown(units, key) * deviation))
    entry["unit"] = units.quantity(key).unit
    entry.fa.set_flow_style()
    return entry
