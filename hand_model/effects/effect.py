"""What an effect of the catalogue is: its parameters and memory, its equations at the hooks, how to try and state it.

An effect is one file of this package. Each of its own parameters has a neutral value that switches it off. An effect
that is a wrong number of the plain plant, and no further term, names that number among its keys and has no hooks.

Equations are pure functions of scalars. They know neither rows nor lanes; kernel/hooks.py calls them with

    q    tuple: own parameters in their order, then the numbers read, then the prepared constants; all in SI
    m    tuple of the effect's memory in its order; only where the effect declares memory
    h    step [s] since the last call;  e: what surrounds the joint, a tuple with the columns named below

    hook                  arguments                              returns
    prepare               q, h                                   the prepared constants, a tuple; once per call
    set_point             q, [m,] u, p, e, h                     u [Pa]; with memory (u, m)
    valve_error           q, error                               set-point minus pressure as the valve reacts to it [Pa]
    flow_limit            q, limit, p, fills                     limit [Pa/s] of filling or of venting; once per step
    pressure_source       q, [m,] p, e                           rate [Pa/s] in addition to the valve's; once per step
    pressure_reading      q, p                                   reading [Pa]
    pressure_true         q, reading                             p [Pa]; the inverse of pressure_reading
    actuator_pressure     q, [m,] p, h                           p at the actuator [Pa]; with memory (p, m)
    torque                q, [m,] phi, omega, p, creep_angle, e  torque added [N m], -d torque / d phi [N m/rad]
    torque_damping        the same                               damping that is part of that torque [N m s/rad]
    damping               q, omega                               damping added [N m s/rad]
    dry                   q, [m,] phi, omega, p                  magnitude of dry friction added [N m]
    moved                 q, m, before, after, h                 m after a motion between two angles [rad]
    angle_sensor          q, m, phi, h                           m after a step that ended at phi [rad]
    angle_reading         q, [m,] phi                            reading [rad]
    force_sensor          q, m, force, h                         m after a sample with the force [N]
    force_reading         q, [m,] force                          reading [N]
    valve                 q, m, p, u, e, h                       p [Pa] after h, and m; it replaces the linear valve

set_point, actuator_pressure, moved, angle_sensor and valve run once per integration step; force_sensor runs once per
sample, after which h is the sample period. u lies within 0 and the supply pressure; fills is true while the valve
fills; creep_angle is A phi_max of Eq. 11 [rad]. In the catalogue's order, the result of one effect is the input of the
next at set_point, valve_error, flow_limit, the readings and the sensors; sources, torques, damping and dry friction add
up. flow_limit and pressure_source get the pressure expected in the middle of the step.
Everything that divides by a parameter or takes an exponential of parameters alone belongs to `prepare`.

With neutral parameters, and memory as it starts, each equation returns its input unchanged to the last bit, or 0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from string import Formatter
from typing import Any

from hand_model.effects.constitution import Constitution
from hand_model.kernel.plant_rows import PLANT_ROW, Parameter

TIME, NEIGHBOUR, INFLOW, PARTNER, ANGLE, SPEED, ACCELERATION = range(7)
"""Columns of e: time [s]; angle of a neighbouring joint [rad]; sum of all pressure rises of the hand [Pa/s];
acceleration of the coupled phalanx [rad/s^2]; angle [rad], speed [rad/s] and acceleration [rad/s^2] of the joint."""
EXOGENOUS = 7
"""Number of columns of e."""
ATMOSPHERE_PA = 101325.0

PLACES = (
    "supply",
    "valve",
    "fluid",
    "material",
    "joint",
    "environment",
    "angle_sensor",
    "pressure_sensor",
    "force_sensor",
    "timing",
)
EXPERIMENTS = (
    "staircase",
    "slow_triangle",
    "steps",
    "multisine",
    "chirp",
    "hold",
    "free_decay",
    "closed_valve_push",
    "reversals",
    "taps",
    "second_attitude",
    "stops",
    "neighbour_moves",
    "free_space",
)
"""Excitations that an effect may name: those of `hand excite`, and four that a person arranges by hand."""
NEEDS: dict[str, str] = {
    "supply": "a supply that several valves share",
    "valve": "a valve between set-point and pressure",
    "chamber": "a chamber with a fluid",
    "fluid": "a fluid between supply and joint",
    "soft_material": "soft material, as silicone or rubber",
    "elastic_part": "a part that the motion bends; an axis that turns on and on has none",
    "other_joint": "a neighbouring joint",
    "rotation": "an axis that turns",
    "magnetic_sensor": "an angle sensor with a magnet",
    "input_sensor": "an input that is measured and not exact",
    "force_sensor": "a measured force",
    "force_sensing_resistor": "a force-sensing resistor",
    "long_recording": "a recording of at least ten minutes",
    "two_clocks": "signals that are stamped by clocks of their own",
    "one_axis": "a machine of one axis other than a hand",
    "drive": "a drive without a fluid, whose input is a command",
    "motor": "an electric motor or a gear",
    "one_load": "recordings with one load",
    "inexact_stiffness": "a stiffness that is not known exactly",
    "inexact_gain": "a gain that is not known exactly, or a controller",
}
"""What an effect may need of a machine. A hand has all of it but OTHER_MACHINES."""
MOTION = "motion"
"""What all effects need but those of AT_REST: a machine may lack it."""
AT_REST = frozenset(("supply", "valve", "fluid", "pressure_sensor", "timing"))
"""Places whose effects act on the pressure of a volume that does not move."""
OTHER_MACHINES = frozenset(("one_axis", "drive", "motor"))
HOOKS: dict[str, tuple[str, ...]] = {
    "prepare": ("h",),
    "set_point": ("u", "p", "e", "h"),
    "valve_error": ("error",),
    "flow_limit": ("limit", "p", "fills"),
    "pressure_source": ("p", "e"),
    "pressure_reading": ("p",),
    "pressure_true": ("reading",),
    "actuator_pressure": ("p", "h"),
    "torque": ("phi", "omega", "p", "creep_angle", "e"),
    "torque_damping": ("phi", "omega", "p", "creep_angle", "e"),
    "damping": ("omega",),
    "dry": ("phi", "omega", "p"),
    "moved": ("before", "after", "h"),
    "angle_sensor": ("phi", "h"),
    "angle_reading": ("phi",),
    "force_sensor": ("force", "h"),
    "force_reading": ("force",),
    "valve": ("p", "u", "e", "h"),
}
"""Arguments of every hook after q and m."""
WITHOUT_MEMORY = frozenset(
    ("prepare", "valve_error", "flow_limit", "pressure_reading", "pressure_true", "damping"),
)
"""Hooks that never take m."""
ONLY_WITH_MEMORY = frozenset(("moved", "angle_sensor", "force_sensor", "valve"))
STARTS = (0.0, "angle", "pressure")
"""What a memory may start at: 0, the first angle [rad], the first pressure [Pa]."""


WORDS = ("angle", "pressure", "torque", "flexion")
"""Words of a sentence that a report replaces by those of the machine at hand (quantities.py)."""


class Times(float):
    """A probe that is a factor on the nominal value."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Effect:
    """One entry of the catalogue.

    name: that of its file, and the group of its parameters.  place: one of PLACES.
    parameters: its own, whose order is that of their rows.  reads: keys of the plain plant, or of other effects, that
    its equations use.
    prepared: names of the constants that the hook `prepare` returns.
    memory: names, or names with what each starts at (STARTS); 0 where nothing is given.
    law_memory: names of memory that only law coefficients multiply; loops without laws leave it out.
    hooks: its equations by the name of the hook.  law_hooks: names of those that do nothing but keep memory of laws;
    loops without laws leave them out.
    keys: parameters that a fit may move, own ones and numbers of the plain plant.
    probes: starting points of a search, each a value per key in the key's unit, or Times(factor) of the nominal one.
    spread: prior standard deviation of the logarithm of a key; where none is given, 0.7 for a number of the plain
    plant, and the typical size for a parameter that has one.
    expected: prior mean, in the key's unit, of a key whose neutral value is out of reach.
    absent: typical size, in the key's unit, of a number of the plain plant that a machine may lack: far below it, the
    prior is linear, and factors of probes act on it.
    lasting: whether it is a part of the machine's build, so that it hardly begins or ends inside a recording.
    refines: names of effects of which it is a finer form; without one of them it is hardly there.
    alike: names of effects with the same equation, which no other set-points separate from it.
    scanned: the key of a period that is found in the data before the search; "" for none.
    shape: keys that set where, when or in which form the effect acts and not its size.
    says: a sentence in whose braces stand the last parts of keys, which a report replaces by number and unit, or WORDS.
    experiments: excitations that show it, the best first.  doc: what it is.  source: where the equations come from.
    everywhere: whether one cause acts on the whole hand and not on one joint.
    shared: keys, and coefficients of its law, whose values are those of the whole hand; others differ by joint.
    meets_others: whether its equations use NEIGHBOUR or INFLOW of e.  draws: whether they use INFLOW.
    constitution: the class of the effect, apart from its law; every entry of the catalogue has one.
    needs: what a machine must have for the effect to exist there, keys of NEEDS.  lacks: those that a machine has not,
    so that some coefficients of the law mean nothing there.

    Raises ValueError, one line with the effect's name, for anything that does not fit together.
    """

    name: str
    place: str
    says: str
    doc: str
    source: str
    parameters: tuple[Parameter, ...] = ()
    reads: tuple[str, ...] = ()
    prepared: tuple[str, ...] = ()
    memory: Mapping[str, float | str] | tuple[str, ...] = ()
    law_memory: tuple[str, ...] = ()
    hooks: Mapping[str, Callable[..., Any]] = field(default_factory=dict)
    law_hooks: tuple[str, ...] = ()
    keys: tuple[str, ...] = ()
    probes: tuple[tuple[float, ...], ...] = ()
    spread: Mapping[str, float] = field(default_factory=dict)
    expected: Mapping[str, float] = field(default_factory=dict)
    absent: Mapping[str, float] = field(default_factory=dict)
    shape: tuple[str, ...] = ()
    experiments: tuple[str, ...] = ()
    everywhere: bool = False
    shared: tuple[str, ...] = ()
    meets_others: bool = False
    draws: bool = False
    constitution: Constitution | None = None
    needs: tuple[str, ...] = ()
    scanned: str = ""
    lasting: bool = False
    refines: tuple[str, ...] = ()
    alike: tuple[str, ...] = ()
    lacks: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        """Refuse what does not fit together."""
        if self.place not in PLACES:
            raise self._error("place", self.place, PLACES)
        for text in ("says", "doc", "source"):
            if not getattr(self, text):
                raise ValueError(f"effect {self.name}: {text} is empty")
        for experiment in self.experiments:
            if experiment not in EXPERIMENTS:
                raise self._error("experiment", experiment, EXPERIMENTS)
        for need in (*self.needs, *(self.constitution.needs.values() if self.constitution else ())):
            if need not in NEEDS:
                raise self._error("need", need, NEEDS)
        self._check_parameters()
        self._check_keys()
        self._check_hooks()

    @property
    def of_the_hand(self) -> bool:
        """Whether one cause of this kind acts on the whole hand: all numbers of it are those of the hand."""
        return self.everywhere or (bool(self.shared) and set(self.keys) <= set(self.shared))

    @property
    def starts(self) -> dict[str, float | str]:
        """Names of the memory in order, with what each starts at."""
        return dict(self.memory) if isinstance(self.memory, Mapping) else dict.fromkeys(self.memory, 0.0)

    @property
    def coefficients(self) -> tuple[str, ...]:
        """Keys that a learned law sets free in addition to `keys`; none where only the textbook form exists."""
        known = self.constitution
        return tuple(key for key in known.coefficients if known.needs.get(key) not in self.lacks) if known else ()

    def on_machine(self, lacks: frozenset[str]) -> Effect:
        """The effect as it is on a machine that lacks some of NEEDS; itself where that changes nothing."""
        needs = self.constitution.needs.values() if self.constitution else ()
        return self if lacks.isdisjoint(needs) else replace(self, lacks=lacks)

    def _error(self, what: str, given: str, allowed: Iterable[str]) -> ValueError:
        return ValueError(f"effect {self.name}: {what} is '{given}'; it must be one of {', '.join(allowed)}")

    def _check_parameters(self) -> None:
        for parameter in self.parameters:
            if not parameter.key.startswith(f"{self.name}."):
                raise ValueError(f"effect {self.name}: parameter '{parameter.key}' must be in the group '{self.name}'")
            if parameter.neutral is None or not parameter.low <= parameter.neutral <= parameter.high:
                allowed = f"{parameter.low:g} to {parameter.high:g}"
                raise ValueError(
                    f"effect {self.name}: neutral value of '{parameter.key}' is {parameter.neutral};"
                    f" the allowed range is {allowed}"
                )
        for memory, start in self.starts.items():
            if start not in STARTS:
                raise self._error(f"start of memory '{memory}'", str(start), map(str, STARTS))
        for memory in self.law_memory:
            if memory not in self.starts:
                raise self._error("law_memory", memory, self.starts)
        for hook in self.law_hooks:
            if hook not in self.hooks:
                raise self._error("law_hooks", hook, self.hooks)

    def _check_keys(self) -> None:
        known = {*PLANT_ROW, *(parameter.key for parameter in self.parameters)}
        for key in self.keys:
            if key not in known:
                raise self._error("key", key, sorted(known))
        own = {"spread": self.spread, "expected": self.expected, "absent": self.absent, "shape": self.shape}
        own |= {"shared": self.shared}
        for what, keys in own.items():
            for key in keys:
                if key not in (*self.keys, *self.coefficients):
                    raise self._error(f"key of {what}", key, self.keys)
        self._check_coefficients(known)
        for probe in self.probes:
            if len(probe) != len(self.keys):
                raise ValueError(
                    f"effect {self.name}: a probe has {len(probe)} values; it must have {len(self.keys)}, one per key"
                )
        last = [*(key.rpartition(".")[2] for key in self.keys), *WORDS]
        for _, named, _, _ in Formatter().parse(self.says):
            if named is not None and named not in last:
                raise self._error("key in 'says'", named, last)

    def _check_coefficients(self, known: Iterable[str]) -> None:
        """Refuse a law coefficient that is unknown, that a plain fit moves, or that no learned law sets free."""
        every = self.constitution.coefficients if self.constitution else ()
        for key in every:
            if key not in known or key in self.keys:
                raise self._error("coefficient", key, sorted(set(known) - set(self.keys)))
        for parameter in self.parameters:
            if parameter.law and parameter.key not in every:
                raise self._error("law parameter", parameter.key, every)
            if parameter.law and not parameter.typical > 0.0:
                raise ValueError(f"effect {self.name}: the law parameter '{parameter.key}' has no typical size")

    def _check_hooks(self) -> None:
        for hook, function in self.hooks.items():
            if hook not in HOOKS:
                raise self._error("hook", hook, HOOKS)
            if hook in ONLY_WITH_MEMORY and not self.memory:
                raise ValueError(f"effect {self.name}: hook '{hook}' needs memory, but the effect declares none")
            code = getattr(function, "py_func", function).__code__
            given, wanted = code.co_varnames[: code.co_argcount], hook_arguments(hook, bool(self.memory))
            if given != wanted:
                raise self._error(f"arguments of '{hook}'", ", ".join(given), [", ".join(wanted)])
        if bool(self.prepared) != ("prepare" in self.hooks):
            raise ValueError(f"effect {self.name}: 'prepared' and the hook 'prepare' must be given together")


def hook_arguments(hook: str, remembers: bool) -> tuple[str, ...]:
    """Names of all arguments of a hook; remembers: whether the effect declares memory."""
    return ("q", *(("m",) if remembers and hook not in WITHOUT_MEMORY else ()), *HOOKS[hook])


def assemble(effects: Iterable[Effect]) -> tuple[Effect, ...]:
    """The catalogue of effects.

    Raises ValueError for a name or a parameter key that is used twice, for a key that an effect reads and no parameter
    has, and for an unknown name of `alike`.
    """
    catalogue = tuple(effects)
    names = [effect.name for effect in catalogue]
    keys = [parameter.key for effect in catalogue for parameter in effect.parameters]
    for what, values in (("effect", names), ("parameter", keys)):
        twice = sorted({value for value in values if values.count(value) > 1})
        if twice:
            raise ValueError(f"the catalogue of effects has the {what} '{twice[0]}' more than once")
    for effect in catalogue:
        for name in effect.alike:
            if name not in names:
                raise ValueError(f"effect {effect.name}: alike is '{name}', which is no effect")
        for key in effect.reads:
            if key not in (*PLANT_ROW, *keys):
                raise ValueError(f"effect {effect.name}: reads is '{key}', which is no parameter")
    return catalogue
