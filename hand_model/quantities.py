"""Physical quantities in the units of one kind of machine: parameters, signals, and the sentences that name them.

Inside, every machine is computed in the base units of a hand: torque in N m, angle in rad, pressure in Pa, time in s. A
`UnitMap` says what one such unit is on a machine and what its unit is called there; a `Wording` adds the names of its
signals and motions. Sentences are made from numbers by a wording; a finished sentence is never edited.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple


class Dimension(NamedTuple):
    """Exponents of torque, angle, pressure and time."""

    torque: int = 0
    angle: int = 0
    pressure: int = 0
    time: int = 0


SHOWN_ANGLE, INERTIA, FORCE, HOUR, HERTZ = "deg", "kg_m2", "n", "per_h", "hz"
"""Endings of keys whose unit is not composed of the base units."""
ENDINGS: dict[str, Dimension] = {
    "nm_per_pa_rad2": Dimension(1, -2, -1),
    "nm_per_pa_rad": Dimension(1, -1, -1),
    "nm_per_rad3": Dimension(1, -3),
    "nm_per_rad2": Dimension(1, -2),
    "nm_per_pa2": Dimension(1, 0, -2),
    "nm_s2_per_rad2": Dimension(1, -2, 0, 2),
    "nm_s_per_rad": Dimension(1, -1, 0, 1),
    "nm_per_rad": Dimension(1, -1),
    "nm_per_pa": Dimension(1, 0, -1),
    "rad_per_s": Dimension(0, 1, 0, -1),
    "s_per_rad": Dimension(0, -1, 0, 1),
    "pa_per_s": Dimension(0, 0, 1, -1),
    "per_pa": Dimension(0, 0, -1),
    "per_rad": Dimension(0, -1),
    "per_s": Dimension(0, 0, 0, -1),
    "nm": Dimension(1),
    "rad": Dimension(0, 1),
    "pa": Dimension(0, 0, 1),
    "s": Dimension(0, 0, 0, 1),
}
"""Ending of a parameter's key, which is its unit, to its dimension; longer endings first."""


class Quantity(NamedTuple):
    """A parameter on a machine: its key there, the factor from the unit of the hand's key, and its unit."""

    key: str
    factor: float
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitMap:
    """Units of one kind of machine.

    torque, angle, pressure: names of the units [text]; inertia, shown_angle, force: likewise, of quantities that have
    a name of their own.  suffixes: how keys end in them, in the order torque, angle, pressure, shown angle, inertia.
    per_torque, per_angle, per_pressure: the machine's units in one N m, rad and Pa of the model [-].
    per_shown_angle: shown units of travel in one `angle` [-].  names: of parameters that are called otherwise there.
    """

    torque: str = "N m"
    angle: str = "rad"
    pressure: str = "Pa"
    shown_angle: str = "deg"
    inertia: str = "kg m^2"
    suffixes: tuple[str, str, str, str, str] = ("nm", "rad", "pa", "deg", "kg_m2")
    per_torque: float = 1.0
    per_angle: float = 1.0
    per_pressure: float = 1.0
    per_shown_angle: float = 180.0 / math.pi
    names: Mapping[str, str] = field(default_factory=dict)

    def quantity(self, key: str) -> Quantity:
        """The parameter `key` (named as in hand.yaml) on this machine. Unknown endings are dimensionless."""
        group, stem, ending = self._parts(key)
        suffix, factor, unit = self._composed(ENDINGS[ending]) if ending in ENDINGS else self._special()[ending]
        own = "_".join(part for part in (stem, suffix) if part)
        return Quantity(f"{group}.{own}" if group else own, factor, unit)

    def words(self, key: str) -> str:
        """The parameter `key` (named as in hand.yaml) in words, without its group and unit, as "time constant"."""
        return self._parts(key)[1].replace("_", " ")

    def _parts(self, key: str) -> tuple[str, str, str]:
        """Group of a key, its name on this machine without the unit, and the ending that is its unit on a hand."""
        group, _, name = key.rpartition(".")
        ending = next((ending for ending in (*ENDINGS, *self._special()) if name.endswith(f"_{ending}")), "")
        stem = name.removesuffix(f"_{ending}") if ending else name
        return group, self.names.get(stem, stem), ending

    def _special(self) -> dict[str, tuple[str, float, str]]:
        """Suffix, factor and unit by ending, of units with a name of their own."""
        shown = self.per_angle * self.per_shown_angle * math.pi / 180.0
        return {
            "": ("", 1.0, "1"),
            SHOWN_ANGLE: (self.suffixes[3], shown, self.shown_angle),
            INERTIA: (self.suffixes[4], self.per_torque / self.per_angle, self.inertia),
            FORCE: (FORCE, 1.0, "N"),
            HOUR: (HOUR, 1.0, "1/h"),
            HERTZ: (HERTZ, 1.0, "Hz"),
        }

    def _composed(self, dimension: Dimension) -> tuple[str, float, str]:
        """Suffix of a key, factor from the hand's unit, and unit of a product of powers."""
        units = (self.torque, self.angle, self.pressure, "s")
        suffixes = (*self.suffixes[:3], "s")
        above = [k for k, power in enumerate(dimension) if power > 0]
        below = [k for k in (2, 1, 3) if dimension[k] < 0]
        top = " ".join(_power(units[k], "^", dimension[k]) for k in above) or "1"
        bottom = " ".join(_power(units[k], "^", -dimension[k]) for k in below)
        unit = top + (f"/({bottom})" if len(below) > 1 else f"/{bottom}" if below else "")
        ends = [_power(suffixes[k], "", dimension[k]) for k in above]
        ends += ["per", *(_power(suffixes[k], "", -dimension[k]) for k in below)] if below else []
        factor = self.per_torque**dimension.torque * self.per_angle**dimension.angle
        return "_".join(ends), factor * self.per_pressure**dimension.pressure, unit


def _power(name: str, sign: str, power: int) -> str:
    return name if power == 1 else f"{name}{sign}{power}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Wording:
    """Units and words in the report of one kind of machine.

    axis, whole: names of a joint and of the machine.  excitable: whether `hand excite` can drive it.
    signals: names of the predicted signals (pressure, angle, force of a hand); signal_units: factor from SI, and unit.
    states: names of the states on which a residual may depend.
    symbols: of angle, pressure and speed in a formula; symbol_units: factor from SI, and unit, of angle and pressure.
    positive, negative: words for motion in either direction.  words: fields of the catalogue's sentences.
    """

    units: UnitMap = field(default_factory=UnitMap)
    axis: str = "joint"
    whole: str = "the hand"
    excitable: bool = True
    signals: tuple[str, str, str] = ("pressure", "angle", "force")
    signal_units: tuple[tuple[float, str], ...] = ((1e-3, "kPa"), (180.0 / math.pi, "deg"), (1.0, "N"))
    states: Mapping[str, str] = field(default_factory=dict)
    symbols: tuple[str, str, str] = ("phi", "p", "omega")
    symbol_units: tuple[tuple[float, str], tuple[float, str]] = ((1.0, "rad"), (1e-5, "bar"))
    positive: str = "flexing"
    negative: str = "extending"
    words: Mapping[str, str] = field(
        default_factory=lambda: {
            "angle": "angle",
            "pressure": "pressure",
            "torque": "torque",
            "flexion": "flexion",
            "joint": "joint",
        }
    )

    def state(self, name: str) -> str:
        """The machine's name of a state: angle, pressure, speed, set-point or time."""
        return self.states.get(name, name)

    def sentence(self, template: str, numbers: Iterable[tuple[str, float, float]]) -> str:
        """A sentence of the catalogue. numbers: (key as in hand.yaml, value, standard error), in the machine's units.

        A field {name} of the template is the parameter whose key ends in .name, with its unit; {angle}, {pressure},
        {torque} and {flexion} are words. Raises KeyError for a field that neither has.
        """
        values = {key.rpartition(".")[2]: self._text(key, value, error) for key, value, error in numbers}
        return template.format_map({**self.words, **values})

    def _text(self, key: str, value: float, error: float) -> str:
        unit = self.units.quantity(key).unit
        return f"{value:.3g} ± {error:.1g}" + ("" if unit == "1" else f" {unit}")


HAND = Wording()
"""A hand: N m, rad or degrees, Pa."""


_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "u"))
_PREFIXED = ("N", "Pa", "s")
"""Units whose size a prefix shows."""


def unit_words(unit: str) -> str:
    """A unit as it is written in a text; "" for a number without one."""
    return "" if unit == "1" else unit.replace("^2", "²").replace("^3", "³")


def amount(value: float, unit: str) -> str:
    """A value [unit] with three digits and its unit, with a prefix where the unit takes one."""
    scale, prefix = 1.0, ""
    if unit.split(" ", maxsplit=1)[0].split("/", maxsplit=1)[0] in _PREFIXED and value != 0.0:
        scale, prefix = next((pair for pair in _PREFIXES if abs(value) >= 0.9995 * pair[0]), _PREFIXES[-1])
        if unit == "s":
            scale, prefix = (scale, prefix) if scale < 1.0 else (1.0, "")
    digits = 3 if abs(value) < 999.5 * scale else 1 + math.floor(math.log10(abs(value / scale)))
    return f"{value / scale:.{digits}g}" + ("" if unit == "1" else f" {prefix}{unit}")
