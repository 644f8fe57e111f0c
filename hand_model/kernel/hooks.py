"""The hooks of a set of effects, composed into one function per place in the equations.

`compose` writes the source of every composed function, with row numbers as constants, and compiles it as an inline
function. A function of an empty set is an identity or 0 and vanishes in compilation. w is a working array (rows, lanes)
of rows.py, i the lane; the remaining arguments are those of effects/effect.py.

Effects that share a signal act in the order of the catalogue; pressure_true inverts the readings in the opposite order.
A sensor with memory gets the reading of the effects before it.

Coefficients of learned laws are read where a loop is compiled with laws. Elsewhere they are constants at their neutral
values, which the compiler removes together with the terms that they multiply. Memory that only those terms read stays
as it starts.

A loop that calls these functions and is cached by numba must look them up among its globals and not in a closure, and
must have `equations_key` in its closure: numba's cache does not see changes of functions that a loop calls.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hand_model.arrays import Array
from hand_model.effects import CATALOGUE
from hand_model.effects.effect import HOOKS, OTHER_MACHINES, Effect, hook_arguments
from hand_model.kernel.inline import inline
from hand_model.kernel.rows import PREPARED_ROW, ROW, effect_rows, memory_rows


class Hooks(NamedTuple):
    """Composed functions of a set of effects; units as in effects/effect.py. All but `prepare` act on one lane i.

    prepare and the hooks that change memory write rows of w; the others only read w.
    """

    prepare: Any
    """(w, i, h): derive the prepared constants of all effects for the step h [s]."""
    set_point: Any
    """(w, i, u, p, e, h) -> u [Pa]; changes memory."""
    set_point_trial: Any
    """The same without a change of memory."""
    valve_error: Any
    """(w, i, error) -> error [Pa]."""
    flow_limit: Any
    """(w, i, limit, p, fills) -> limit [Pa/s]."""
    pressure_source: Any
    """(w, i, p, e) -> rate [Pa/s]."""
    pressure_reading: Any
    """(w, i, p) -> reading [Pa]."""
    pressure_true: Any
    """(w, i, reading) -> p [Pa]."""
    actuator_pressure: Any
    """(w, i, p, h) -> p [Pa]; changes memory."""
    torque: Any
    """(w, i, phi, omega, p, creep_angle, e) -> torque [N m], stiffness [N m/rad]."""
    torque_damping: Any
    """(w, i, phi, omega, p, creep_angle, e) -> damping [N m s/rad] that is part of the torque."""
    damping: Any
    """(w, i, omega) -> damping [N m s/rad]."""
    dry: Any
    """(w, i, phi, omega, p) -> magnitude of dry friction [N m]."""
    moved: Any
    """(w, i, before, after, h): memory after a motion [rad]."""
    angle_sensor: Any
    """(w, i, phi, h): memory of the angle sensor after a step that ended at phi [rad]."""
    angle_reading: Any
    """(w, i, phi) -> reading [rad]."""
    force_sensor: Any
    """(w, i, force, h): memory of the force sensor after a sample with the force [N]."""
    force_reading: Any
    """(w, i, force) -> reading [N]."""
    valve_replaced: Any
    """(w, i) -> whether `valve` replaces the linear valve of the lane."""
    valve: Any
    """(w, i, p, u, e, h) -> p [Pa] after h; changes memory."""

    def uses(self, hook: str) -> bool:
        """Whether any effect of the set has this hook. A loop leaves out unused hooks, which saves compile time."""
        return getattr(self, hook) is not _unused(hook)


_SIGNAL = {
    "set_point": "u",
    "valve_error": "error",
    "flow_limit": "limit",
    "pressure_reading": "p",
    "pressure_true": "reading",
    "actuator_pressure": "p",
    "angle_reading": "phi",
    "force_reading": "force",
}
"""Hooks through which a signal passes from effect to effect, and the argument that is the signal."""
_DERIVED = {"valve_replaced": "valve", "set_point_trial": "set_point"}
"""Composed functions that are no hooks of an effect, and the hook that they follow from."""
_SENSORS = {"angle_sensor": "angle_reading", "force_sensor": "force_reading"}
_SUMS = ("pressure_source", "torque", "torque_damping", "damping", "dry")
_REMEMBERS = ("set_point", "actuator_pressure", "valve")
"""Hooks that return a value and, where the effect has memory, the new memory."""


def _cells(rows: Iterable[int]) -> str:
    return "(" + "".join(f"w[{row}, i], " for row in rows) + ")"


class _Writer:
    """Source of composed functions and the equations that they call. laws: whether law coefficients are read."""

    def __init__(self, laws: bool) -> None:
        self.equations: dict[str, Any] = {}
        self.laws = laws

    def _parameters(self, effect: Effect, prepared: bool) -> str:
        """Source of q."""
        cells = [f"w[{row}, i]" for row in effect_rows(effect, prepared=prepared)]
        if not self.laws:
            fixed = {place: own.neutral_si for place, own in enumerate(effect.parameters) if own.law}
            cells = [repr(fixed[place]) if place in fixed else cell for place, cell in enumerate(cells)]
        return f"({''.join(f'{cell}, ' for cell in cells)})"

    def memory(self, effect: Effect, left_out: str) -> str:
        """Source of m; left_out: what stands in for memory of laws where they are not read."""
        names = zip(effect.starts, memory_rows(effect), strict=True)
        unread = () if self.laws else effect.law_memory
        return "(" + "".join(left_out if name in unread else f"w[{row}, i], " for name, row in names) + ")"

    def call(self, effect: Effect, hook: str) -> str:
        """Source that calls an effect's equation with its parameters, memory and the arguments of the hook."""
        name = f"{effect.name}_{hook}"
        self.equations[name] = effect.hooks[hook]
        arguments = [self._parameters(effect, prepared=hook != "prepare")]
        names = hook_arguments(hook, bool(effect.memory))[1:]
        arguments += [self.memory(effect, "0.0, ") if argument == "m" else argument for argument in names]
        return f"{name}({', '.join(arguments)})"

    def function(self, hook: str, body: list[str], arguments: tuple[str, ...] | None = None) -> Any:
        """Compile an inline function of a body."""
        names = ("w", "i", *(HOOKS[hook] if arguments is None else arguments))
        source = "\n    ".join([f"def {hook}({', '.join(names)}):", *body])
        space: dict[str, Any] = dict(self.equations)
        exec(compile(source, f"<hook {hook}>", "exec"), space)
        return inline(space[hook])


def _signal_body(writer: _Writer, hook: str, effects: tuple[Effect, ...], keeps: bool = True) -> list[str]:
    """keeps: whether new memory replaces the old one."""
    signal = _SIGNAL[hook]
    body = []
    for effect in reversed(effects) if hook == "pressure_true" else effects:
        if hook in effect.hooks:
            remembers = hook in _REMEMBERS and effect.memory
            target = f"{signal}, {writer.memory(effect, '_, ') if keeps else '_'}" if remembers else signal
            body.append(f"{target} = {writer.call(effect, hook)}")
    return [*body, f"return {signal}"]


def _sum_body(writer: _Writer, hook: str, effects: tuple[Effect, ...]) -> list[str]:
    calls = [writer.call(effect, hook) for effect in effects if hook in effect.hooks]
    if hook != "torque":
        return [f"return {' + '.join(calls) or '0.0'}"]
    body = [f"torque_{number}, stiffness_{number} = {call}" for number, call in enumerate(calls)]
    torque, stiffness = (
        " + ".join(f"{what}_{number}" for number in range(len(calls))) for what in ("torque", "stiffness")
    )
    return [*body, f"return {torque or '0.0'}, {stiffness or '0.0'}"]


def _memory_body(writer: _Writer, hook: str, effects: tuple[Effect, ...]) -> list[str]:
    """Each effect's memory after a motion, independent of the others."""
    changing = [effect for effect in effects if hook in effect.hooks]
    return [*(f"{writer.memory(effect, '_, ')} = {writer.call(effect, hook)}" for effect in changing), "return"]


def _sensor_body(writer: _Writer, hook: str, effects: tuple[Effect, ...]) -> list[str]:
    """Memory of the sensors in order, each with the reading of those before it."""
    reading = _SENSORS[hook]
    signal = _SIGNAL[reading]
    body, needed = [], 0
    for effect in effects:
        if hook in effect.hooks:
            body.append(f"{writer.memory(effect, '_, ')} = {writer.call(effect, hook)}")
            needed = len(body)
        if reading in effect.hooks:
            body.append(f"{signal} = {writer.call(effect, reading)}")
    return [*body[:needed], "return"]


def _prepare_body(writer: _Writer, effects: tuple[Effect, ...]) -> list[str]:
    body = []
    for effect in effects:
        if effect.prepared:
            rows = (PREPARED_ROW[f"{effect.name}.{name}"] for name in effect.prepared)
            body.append(f"{_cells(rows)} = {writer.call(effect, 'prepare')}")
    return [*body, "return"]


def _valve_bodies(writer: _Writer, effects: tuple[Effect, ...]) -> tuple[list[str], list[str]]:
    """Whether a valve replaces the linear one, by its first parameter, its share; and that valve's step."""
    replacing = [effect for effect in effects if "valve" in effect.hooks]
    if not replacing:
        return ["return False"], ["return p"]
    if len(replacing) > 1:
        names = ", ".join(effect.name for effect in replacing)
        raise ValueError(f"the effects {names} all replace the valve; only one effect may")
    effect = replacing[0]
    target = f"p, {writer.memory(effect, '_, ')}"
    return [f"return w[{effect_rows(effect)[0]}, i] != 0.0"], [f"{target} = {writer.call(effect, 'valve')}", "return p"]


def _bodies(writer: _Writer, effects: tuple[Effect, ...]) -> dict[str, list[str]]:
    bodies = {hook: _signal_body(writer, hook, effects) for hook in _SIGNAL}
    bodies |= {hook: _sum_body(writer, hook, effects) for hook in _SUMS}
    bodies |= {hook: _sensor_body(writer, hook, effects) for hook in _SENSORS}
    bodies["set_point_trial"] = _signal_body(writer, "set_point", effects, keeps=False)
    bodies["moved"] = _memory_body(writer, "moved", effects)
    bodies["prepare"] = _prepare_body(writer, effects)
    bodies["valve_replaced"], bodies["valve"] = _valve_bodies(writer, effects)
    return bodies


@cache
def compose(effects: tuple[Effect, ...], laws: bool = True) -> Hooks:
    """Hooks of a set of effects, whose order is that of the catalogue.

    laws: whether the coefficients of learned laws are read; where they are not, only the textbook forms remain.
    Raises ValueError for a second effect that replaces the valve, or an effect that is not part of the catalogue.
    """
    for effect in effects:
        if effect not in CATALOGUE:
            raise ValueError(f"effect {effect.name} is not part of the catalogue")
    if list(effects) != [effect for effect in CATALOGUE if effect in effects]:
        raise ValueError("the effects of a set must be different and in the order of the catalogue")
    if not laws:
        effects = tuple(_textbook(effect) for effect in effects if not all(own.law for own in effect.parameters))
    writer = _Writer(laws)
    bodies = _bodies(writer, effects)
    arguments: dict[str, tuple[str, ...] | None] = {"valve_replaced": (), "set_point_trial": HOOKS["set_point"]}
    used = {hook for effect in effects for hook in effect.hooks}
    used |= {derived for derived, hook in _DERIVED.items() if hook in used}
    return Hooks(
        **{
            hook: writer.function(hook, bodies[hook], arguments.get(hook)) if hook in used else _unused(hook)
            for hook in Hooks._fields
        }
    )


def _textbook(effect: Effect) -> Effect:
    """The effect without the hooks that only keep memory of laws."""
    if not effect.law_hooks:
        return effect
    hooks = {hook: equation for hook, equation in effect.hooks.items() if hook not in effect.law_hooks}
    return replace(effect, hooks=hooks, law_hooks=())


@inline
def _nothing(w, i, *arguments):  # type: ignore[no-untyped-def]
    return None


@inline
def _first(w, i, signal, *arguments):  # type: ignore[no-untyped-def]
    return signal


@inline
def _zero(w, i, *arguments):  # type: ignore[no-untyped-def]
    return 0.0


@inline
def _two_zeros(w, i, *arguments):  # type: ignore[no-untyped-def]
    return 0.0, 0.0


@inline
def _never(w, i):  # type: ignore[no-untyped-def]
    return False


_UNUSED = {"torque": _two_zeros, "valve_replaced": _never}
_UNUSED |= dict.fromkeys(("pressure_source", "torque_damping", "damping", "dry"), _zero)
_UNUSED |= dict.fromkeys(("prepare", "moved", "angle_sensor", "force_sensor"), _nothing)


def _unused(hook: str) -> Any:
    """The function of a hook that no effect uses: shared, because each compiled function takes time to compile."""
    return _UNUSED.get(hook, _first)


OPEN_EFFECTS = tuple(effect for effect in CATALOGUE if "valve" not in effect.hooks)
"""Effects that a fit may vary: all but those that replace the valve by a switching one."""
HAND_EFFECTS = tuple(effect for effect in OPEN_EFFECTS if OTHER_MACHINES.isdisjoint(effect.needs))
"""Those of them that a hand can have."""

_OWNERS = [effect for effect in CATALOGUE for _ in effect.parameters]
_OWN = slice(ROW[CATALOGUE[0].parameters[0].key], len(ROW))
"""Rows of the parameters of all effects, which follow those of the plain plant in the order of the catalogue."""
_OWN_NEUTRAL = np.array([own.neutral_si for effect in CATALOGUE for own in effect.parameters])


def active_effects(parameters: Array) -> tuple[Effect, ...]:
    """Effects with an own parameter that differs from its neutral value at any joint, in the catalogue's order.

    parameters: (rows of JOINT_PARAMETERS, joints) in SI, or (rows, hands, joints). The other effects are identities and
    need not be compiled in.
    """
    own = np.moveaxis(parameters[_OWN], 0, -1)
    differs = (own != _OWN_NEUTRAL).reshape(-1, len(_OWN_NEUTRAL)).any(axis=0)
    return tuple(dict.fromkeys(_OWNERS[k] for k in np.flatnonzero(differs)))


_LAW_ROWS = [ROW[own.key] for effect in CATALOGUE for own in effect.parameters if own.law]
_LAW_NEUTRAL = np.array([own.neutral_si for effect in CATALOGUE for own in effect.parameters if own.law])


def has_laws(parameters: Array) -> bool:
    """Whether any coefficient of a learned law differs from its neutral value; (..., rows of JOINT_PARAMETERS), SI."""
    return bool(np.any(parameters[..., _LAW_ROWS] != _LAW_NEUTRAL))


@cache
def equations_key(*effects: str) -> str:
    """Hash of the sources of all equations, and the names of the effects compiled in: the key of a loop's cache."""
    here = Path(__file__).resolve().parents[1]
    files = sorted([*here.glob("*.py"), *here.glob("effects/*.py"), *here.glob("kernel/*.py")])
    sources = hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()
    return f"{sources} {' '.join(effects)}"
