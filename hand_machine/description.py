"""The description file of a machine, schema 1; docs/machines.md documents every key.

Positive input drives towards positive position; a measured force is what the axis exerts in that direction.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from hand_model.yaml_reader import Section, read_yaml

KEYS = ("schema", "name", "motion", "imposed", "gain", "stiffness", "damping", "inertia", "weight", "has", "columns")
COLUMNS = ("time", "input", "position", "force")
PARTS = ("supply", "valve", "chamber", "soft_material", "magnetic_sensor", "input_sensor", "force_sensing_resistor")
"""What the key `has` may state (NEEDS of hand_model/effects/effect.py); the rest follows from the other keys."""
LARGEST, SMALLEST_GAIN = 1e12, 1e-12
"""Bounds of every number of the file, in SI."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column of the recordings and the factor that turns it into SI. scale_given: whether the file states it."""

    name: str
    scale: float
    scale_given: bool = True


@dataclass(frozen=True, slots=True)
class MachineDescription:
    """A machine of one axis, SI.

    linear: position in m and force in N; else angle in rad and torque in N m.
    imposed: a rig moves the axis and the force is measured; else the input moves it.
    gain: force or torque per unit of input.  stiffness [N/m or N m/rad], damping [N s/m or N m s/rad], inertia [kg or
    kg m^2] and weight [N m at 90 degrees] of the nominal model.  has: parts that effects may need, of PARTS.
    columns: those the recordings are read from.
    """

    path: Path
    name: str
    linear: bool
    imposed: bool
    gain: float
    stiffness: float
    damping: float
    inertia: float
    weight: float
    has: frozenset[str]
    columns: Mapping[str, Column]


def load_description(path: Path) -> MachineDescription:
    """Read a machine's file. Raises DescriptionError, one line with file, key, value and allowed range."""
    top = read_yaml(path, KEYS)
    top.integer("schema", 1, 1)
    linear = top.choice("motion", ["linear", "rotary"]) == "linear"
    imposed = bool(top.raw("imposed", "true or false", False))
    numbers = {key: top.number(key, 0.0, LARGEST, 0.0) for key in ("stiffness", "damping", "inertia")}
    return MachineDescription(
        path,
        top.name("name"),
        linear,
        imposed,
        top.number("gain", SMALLEST_GAIN, LARGEST, 1.0 if imposed else None),
        **numbers,
        weight=top.number("weight", 0.0, 0.0 if linear else LARGEST, 0.0),
        has=_parts(top, linear=linear),
        columns=_columns(top, imposed),
    )


def _parts(top: Section, *, linear: bool) -> frozenset[str]:
    allowed = f"a list of {', '.join(PARTS)}"
    given = top.raw("has", allowed, [])
    if not isinstance(given, list):
        raise top.error("has", f"must be {allowed}")
    for part in given:
        if part not in PARTS:
            raise top.error("has", f"contains {part!r}; it must be {allowed}")
    if linear and "magnetic_sensor" in given:
        raise top.error("has", "contains magnetic_sensor, which only an axis with motion: rotary can have")
    return frozenset(given)


def _columns(top: Section, imposed: bool) -> dict[str, Column]:
    """The columns that the recordings must have: no force where the input moves the axis; the input may be absent."""
    section = top.section("columns", COLUMNS)
    wanted = [name for name in COLUMNS if name != "force" or imposed]
    if imposed and "input" not in section:
        wanted.remove("input")
    columns = {}
    for name in wanted:
        part = section.section(name, ("column", "scale"))
        own = part.raw("column", "the name of a column")
        columns[name] = Column(str(own), part.number("scale", -LARGEST, LARGEST, 1.0), "scale" in part)
    return columns
