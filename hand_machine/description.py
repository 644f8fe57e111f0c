"""The description file of a machine, schema 1; docs/machines.md documents every key.

Positive input drives towards positive position; a measured force is what the axis exerts in that direction.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from hand_machine.column_description import LARGEST, Column, columns_of, pressure_columns
from hand_machine.wording import units_of, wording_of_volume
from hand_model.kernel.rows import JOINT_PARAMETERS
from hand_model.quantities import UnitMap
from hand_model.yaml_loader import DescriptionError, load_yaml
from hand_model.yaml_reader import Section, read_yaml

KEYS = (
    *("schema", "name", "motion", "imposed", "gain", "stiffness", "damping", "inertia", "weight", "has", "columns"),
    *("controller", "recordings", "reference_temperature", "derivative_window", "effects", "sizes"),
)
PARTS = (
    *("supply", "valve", "chamber", "soft_material", "magnetic_sensor", "input_sensor", "force_sensing_resistor"),
    "motor",
)
"""What the key `has` may state (NEEDS of hand_model/effects/effect.py); the rest follows from the other keys."""
STILL = "none"
MOTIONS = ("linear", "rotary", STILL)
OF_VOLUME = ("schema", "name", "motion", "has", "columns", "effects", "sizes")
"""Keys of a closed volume."""
NUMBERS = ("gain", "stiffness", "damping", "inertia")
"""Numbers that a fit may change, each within its own tolerance unless it is exact; the weight only within its own."""
CONTROLLER = ("stiffness", "damping")
CONTROLLED = ("position", "speed")
"""What the input of a controller commands."""
NUMBER = ("value", "exact", "tolerance")
WARM = ("gain", "stiffness", "damping")
"""Numbers that may depend on the temperature of a recording."""
OWN_NUMBERS = ("added_inertia", "added_weight", "supply", "temperature")
"""What a recording may have of its own: a load that it moves in addition, the supply relative to the usual one, and the
temperature."""
COLDEST_C, HOTTEST_C, ROOM_C = -100.0, 500.0, 20.0
"""Range of temperatures, and the one at which the numbers of a file hold unless it states another."""
MAX_SUPPLY_RATIO = 1e3
EFFECT = ("value", "std", "unit")
SIZES = ("force", "position", "input")
SMALLEST_GAIN = 1e-12
"""Least gain, in SI."""
TIME_CONSTANT_S = (1e-5, 100.0)
DERIVATIVE_WINDOW_S = (1e-4, 10.0)
SMALLEST_TOLERANCE = 1e-6
"""Least relative tolerance; a number that is known better is exact."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineDescription:
    """A machine of one axis, SI.

    linear: position in m and force in N; else angle in rad and torque in N m.
    imposed: a rig moves the axis and the force is measured; else the input moves it.
    gain: force or torque per unit of input.  stiffness [N/m or N m/rad], damping [N s/m or N m s/rad], inertia [kg or
    kg m^2] and weight [N m at 90 degrees] of the nominal model.  has: parts that effects may need, of PARTS.
    columns: those the recordings are read from.  tolerances: relative standard deviations [-] of NUMBERS and weight
    that have their own; 0 where the number is exact.
    effects: parameters of effects that the model has, by their keys in a report, in the machine's units.
    recordings: numbers of OWN_NUMBERS by the name of a recording's file, those that it has.
    per_kelvin: relative change of numbers of WARM [1/K] from reference_c [deg C] on.
    sizes: force, position and input [SI] to which the fit that found them was scaled; None: as the recordings ask.
    controller: stiffness and damping of a controller, which the numbers above contain; empty without one.
    of_speed: whether it follows a command of the speed and not of the position.
    still: the machine is a closed volume without motion; its `position` is the pressure [Pa].
    derivative_window_s: over which an imposed motion is differentiated; None: as the recordings ask.
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
    tolerances: Mapping[str, float]
    effects: Mapping[str, float]
    recordings: Mapping[str, Mapping[str, float]]
    sizes: tuple[float, float, float] | None
    per_kelvin: Mapping[str, float]
    reference_c: float
    derivative_window_s: float | None = None
    controller: Mapping[str, float] = field(default_factory=dict)
    of_speed: bool = False
    still: bool = False

    @property
    def per_integral(self) -> float:
        """Input [-] that adds to that of a speed controller per integral of its command [1/s]; 0 for others."""
        return self.controller["stiffness"] / self.controller["damping"] if self.of_speed else 0.0

    def warmth(self, recording: Path) -> dict[str, float]:
        """Factors [-] of the numbers that the temperature of a recording changes. Raises DescriptionError below 0."""
        own = self.recordings.get(recording.name, {})
        warmer_k = own.get("temperature", self.reference_c) - self.reference_c
        factors = {name: 1.0 + each * warmer_k for name, each in self.per_kelvin.items()}
        for name, factor in factors.items():
            if factor <= 0.0:
                raise DescriptionError(
                    f"{self.path}: {name}.per_kelvin is {self.per_kelvin[name]:g}, which leaves {factor:.2g} times"
                    f" {name} at the temperature of {recording.name}; the allowed range is above 0"
                )
        return factors

    def with_load_of(self, recording: Path) -> MachineDescription:
        """The machine while it moves the load of a recording, at the supply and temperature of that recording."""
        own, warm = self.recordings.get(recording.name, {}), self.warmth(recording)
        return replace(
            self,
            inertia=self.inertia + own.get("added_inertia", 0.0),
            weight=self.weight + own.get("added_weight", 0.0),
            gain=self.gain * own.get("supply", 1.0) * warm.get("gain", 1.0),
            stiffness=self.stiffness * warm.get("stiffness", 1.0),
            damping=self.damping * warm.get("damping", 1.0),
        )


def is_machine_file(path: Path) -> bool:
    """Whether a YAML file describes a machine of one axis and not a hand. Raises DescriptionError for broken YAML."""
    top = load_yaml(path)
    return isinstance(top, dict) and "joints" not in top and ("motion" in top or "columns" in top)


def load_description(path: Path) -> MachineDescription:
    """Read a machine's file. Raises DescriptionError, one line with file, key, value and allowed range."""
    top = read_yaml(path, KEYS)
    top.integer("schema", 1, 1)
    motion = top.choice("motion", list(MOTIONS))
    if motion == STILL:
        return _volume(top, path)
    linear = motion == "linear"
    imposed = bool(top.raw("imposed", "true or false", False))
    controller = _controller(top, imposed=imposed)
    least = {"gain": (SMALLEST_GAIN, 1.0 if imposed or controller else None)}
    read = {key: _number(top, key, *least.get(key, (0.0, 0.0))) for key in NUMBERS}
    read |= _under_control(read, controller, of_speed=_of_speed(top))
    read["weight"] = _number(top, "weight", 0.0, 0.0, largest=0.0 if linear else LARGEST)
    return MachineDescription(
        path=path,
        name=top.name("name"),
        linear=linear,
        imposed=imposed,
        **{key: value for key, (value, _) in read.items()},
        has=_parts(top, linear=linear),
        columns=columns_of(top, imposed),
        tolerances={key: tolerance for key, (_, tolerance) in read.items() if tolerance is not None},
        effects=_effects(top, units_of(linear, per_torque=1.0, per_angle=1.0, per_input=1.0)),
        recordings=_recordings(top, linear=linear),
        sizes=_sizes(top),
        derivative_window_s=_derivative_window_s(top),
        controller=controller,
        of_speed=_of_speed(top),
        still=False,
        per_kelvin={key: _per_kelvin(top, key) for key in WARM if _has_per_kelvin(top, key)},
        reference_c=top.number("reference_temperature", COLDEST_C, HOTTEST_C, ROOM_C),
    )


def _volume(top: Section, path: Path) -> MachineDescription:
    """A closed volume, whose pressure is all that is measured. Raises DescriptionError for numbers of a motion."""
    for key in KEYS:
        if key in top and key not in OF_VOLUME:
            raise top.error(key, f"has no meaning with motion: {STILL}")
    return MachineDescription(
        path=path,
        name=top.name("name"),
        linear=True,
        imposed=False,
        gain=1.0,
        stiffness=0.0,
        damping=0.0,
        inertia=0.0,
        weight=0.0,
        has=_parts(top, linear=True) | {"chamber"},
        columns=pressure_columns(top),
        tolerances={},
        effects=_effects(top, wording_of_volume().units),
        recordings={},
        sizes=_sizes(top),
        per_kelvin={},
        reference_c=ROOM_C,
        still=True,
    )


def _has_per_kelvin(top: Section, key: str) -> bool:
    number = top.raw(key, "a number", 0.0)
    return isinstance(number, dict) and "per_kelvin" in number


def _per_kelvin(top: Section, key: str) -> float:
    """Relative change of a number [1/K]; one of 0 has none."""
    part = top.section(key, (*NUMBER, "per_kelvin"))
    if float(part.raw("value", "a number")) == 0.0:
        raise part.error("per_kelvin", "is relative and has no meaning for a value of 0")
    return part.number("per_kelvin", -1.0, 1.0)


def _recordings(top: Section, *, linear: bool) -> dict[str, dict[str, float]]:
    """Numbers of single recordings, by the name of the file."""
    entries = top.raw("recordings", "a mapping of file names", {})
    if not isinstance(entries, dict):
        raise top.error("recordings", "must be a mapping of file names, each with " + ", ".join(OWN_NUMBERS))
    section = top.section("recordings", [str(name) for name in entries], required=False)
    bounds = {
        "added_inertia": (0.0, LARGEST),
        "added_weight": (0.0, 0.0) if linear else (-LARGEST, LARGEST),
        "supply": (1.0 / MAX_SUPPLY_RATIO, MAX_SUPPLY_RATIO),
        "temperature": (COLDEST_C, HOTTEST_C),
    }
    found = {}
    for name in entries:
        part = section.section(name, OWN_NUMBERS)
        found[str(name)] = {key: part.number(key, *bounds[key]) for key in OWN_NUMBERS if key in part}
    return found


def _effects(top: Section, units: UnitMap) -> dict[str, float]:
    """Values by key, in the machine's units; the range of each is checked where the sizes are known."""
    if "effects" not in top:
        return {}
    keys = [units.quantity(parameter.key).key for parameter in JOINT_PARAMETERS]
    section = top.section("effects", keys)
    found = {}
    for key in (key for key in keys if key in section):
        if isinstance(section.raw(key, "a number"), dict):
            found[key] = section.section(key, EFFECT).number("value", -LARGEST, LARGEST)
        else:
            found[key] = section.number(key, -LARGEST, LARGEST)
    return found


def _sizes(top: Section) -> tuple[float, float, float] | None:
    if "sizes" not in top:
        return None
    section = top.section("sizes", SIZES)
    force, position, of_input = (section.number(name, SMALLEST_GAIN, LARGEST) for name in SIZES)
    return force, position, of_input


def _controller(top: Section, *, imposed: bool) -> dict[str, float]:
    """Stiffness and damping of the controller that follows a position command; empty where the input is a force."""
    if "controller" not in top:
        return {}
    if imposed:
        raise top.error("controller", "moves the axis and contradicts imposed: true; give one of them")
    if "gain" in top:
        raise top.error("gain", "follows from controller.stiffness; leave it out")
    section = top.section("controller", ("of", *CONTROLLER, "time_constant"))
    if not _of_speed(top):
        if "time_constant" in section:
            raise section.error("time_constant", "is that of a drive with of: speed; give stiffness and damping")
        stiffness = section.number("stiffness", SMALLEST_GAIN, LARGEST)
        return {"stiffness": stiffness, "damping": section.number("damping", 0.0, LARGEST, 0.0)}
    stiffness = section.number("stiffness", 0.0, LARGEST, 0.0)
    if "time_constant" not in section:
        return {"stiffness": stiffness, "damping": section.number("damping", SMALLEST_GAIN, LARGEST)}
    if "damping" in section:
        raise section.error("damping", "follows from time_constant and inertia; give one of them")
    inertia = _number(top, "inertia", 0.0, 0.0)[0]
    if inertia == 0.0:
        raise section.error("time_constant", "needs an inertia above 0")
    return {"stiffness": stiffness, "damping": inertia / section.number("time_constant", *TIME_CONSTANT_S)}


def _of_speed(top: Section) -> bool:
    """Whether a controller follows a command of the speed."""
    if "controller" not in top:
        return False
    section = top.section("controller", ("of", *CONTROLLER, "time_constant"))
    return "of" in section and section.choice("of", list(CONTROLLED)) == "speed"


def _under_control(
    read: Mapping[str, tuple[float, float | None]], controller: Mapping[str, float], *, of_speed: bool
) -> dict[str, tuple[float, float | None]]:
    """Numbers of an axis with a controller. Of a position: force = stiffness (command - position) - damping speed.

    Of a speed: force = damping (command - speed), and stiffness times the integral of the same difference. The
    controller's own numbers are exact; a tolerance of the axis becomes one of the sum. Where the axis has none, the
    sum has that of every number: friction of the axis is part of it.
    """
    if not controller:
        return {}
    found: dict[str, tuple[float, float | None]] = {"gain": (controller["damping" if of_speed else "stiffness"], 0.0)}
    for name in CONTROLLER:
        own, tolerance = read[name]
        total = own + controller[name]
        found[name] = (total, tolerance if not tolerance else tolerance * own / total)
    return found


def _derivative_window_s(top: Section) -> float | None:
    if "derivative_window" not in top:
        return None
    return top.number("derivative_window", *DERIVATIVE_WINDOW_S)


def _number(
    top: Section, key: str, low: float, default: float | None, *, largest: float = LARGEST
) -> tuple[float, float | None]:
    """A number and its own relative tolerance [-], 0 where it is exact, None where it has none."""
    if not isinstance(top.raw(key, "a number", default if default is None else [default]), dict):
        return top.number(key, low, largest, default), None
    part = top.section(key, (*NUMBER, "per_kelvin") if key in WARM else NUMBER)
    value = part.number("value", low, largest)
    exact = part.raw("exact", "true or false", [])
    if exact not in ([], True, False):
        raise part.error("exact", f"is {exact!r}; it must be true or false")
    if exact is True and "tolerance" in part:
        raise part.error("tolerance", "contradicts exact: true; give one of them")
    if exact is True:
        return value, 0.0
    if "tolerance" not in part:
        return value, None
    if value == 0.0:
        raise part.error("tolerance", "is relative and has no meaning for a value of 0; give exact: true or neither")
    return value, part.number("tolerance", SMALLEST_TOLERANCE, 1.0)


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
