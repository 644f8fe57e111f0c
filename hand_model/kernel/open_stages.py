"""The compiled loops of the open loop's stages: the valve on set-points, the joint on measured pressures.

No stage reads what another one predicts, so each has a loop of its own, with the effects that act in it.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hand_model.arrays import Array
from hand_model.compile_cache import carray, get_num_threads, is_kept, njit
from hand_model.effects import CATALOGUE
from hand_model.effects.effect import ACCELERATION, ANGLE, HOOKS, PARTNER, SPEED, Effect
from hand_model.kernel.compiled import specialise, stack_doubles
from hand_model.kernel.hooks import HAND_EFFECTS, OPEN_EFFECTS, Hooks, compose, equations_key
from hand_model.kernel.inline import FAST, inline
from hand_model.kernel.layout import (
    ACTUATOR,
    CREEP,
    INPUT,
    MEAN_CREEP,
    OMEGA,
    PHI,
    PHI_BEFORE,
    RISE,
    WORK,
    P,
    X,
)
from hand_model.kernel.narrow_loops import NarrowLoops
from hand_model.kernel.plant_rows import PLANT_PARAMETERS
from hand_model.kernel.rows import ROW, effect_rows
from hand_model.kernel.step import assemble, deliver, whole_below
from hand_model.kernel.terms import terms

LANES = 8
"""Parameter sets computed side by side: one vector of 512 bits, or two of 256 bits."""
STANDSTILL_RAD_S = 0.02
"""Speed below which friction of a machine with imposed motion acts in part only."""
_SIZE = WORK * LANES
_DEAD, _CLOCK, _SHARE = ROW["valve.dead_time_s"], ROW["clock_offset.offset_s"], ROW["clock_offset.share"]
_COMMAND = ROW["command_delay.dead_time_s"]
_J, _JC = ROW["dynamics.inertia_kg_m2"], ROW["dynamics.coupling_inertia_kg_m2"]


@inline
def _between(signal, x):  # type: ignore[no-untyped-def]
    """Linear interpolation of samples at the position x."""
    x = min(max(x, 0.0), signal.shape[0] - 1.0)
    a = min(int(x), signal.shape[0] - 2)
    return signal[a] + (x - a) * (signal[a + 1] - signal[a])


@inline
def _row(e, k):  # type: ignore[no-untyped-def]
    return e[k, 0], e[k, 1], e[k, 2], e[k, 3], e[k, 4], e[k, 5], e[k, 6]


@inline
def _row_between(e, k, x):  # type: ignore[no-untyped-def]
    """The surroundings at the share x from sample k to the next."""
    a, b, y = _row(e, k), _row(e, k + 1), 1.0 - x
    return (
        y * a[0] + x * b[0], y * a[1] + x * b[1], y * a[2] + x * b[2], y * a[3] + x * b[3],
        y * a[4] + x * b[4], y * a[5] + x * b[5], y * a[6] + x * b[6],
    )  # fmt: skip


@inline
def _deliver_part(w, u, k, dt, late, steps):  # type: ignore[no-untyped-def]
    """Set-points that reach the valves in part k of the samples, dt long, each lane by its own dead time and clock.

    Returns the first and the last step within which one of them changes.
    """
    last = u.shape[0] - 1
    first_split, last_split = steps, -1
    for i in range(LANES):
        lag = (w[_DEAD, i] + w[_CLOCK, i] * w[_SHARE, i] - late) / dt
        newest = k - int(whole_below(lag))
        split = deliver(w, i, u[min(max(newest - 1, 0), last)], u[min(max(newest, 0), last)], lag, steps)
        if split >= 0:
            first_split, last_split = min(first_split, split), max(last_split, split)
    return first_split, last_split


@inline
def _measure(w, reading, at, finer, late, dt):  # type: ignore[no-untyped-def]
    """Measured pressure at the position `at` in samples, each lane by its own clock."""
    for i in range(LANES):
        w[INPUT, i] = _between(reading, finer * (at + (w[_CLOCK, i] - w[_COMMAND, i] - late) / dt))


def _valve_stage(hooks: Hooks) -> dict[str, Any]:
    """One step of the pressures of all lanes, and their readings."""
    steps = assemble(hooks)
    pressure, split_pressure, keeps_rise = steps.pressure, steps.split_pressure, steps.uses_rise
    hook_pressure = hooks.pressure_reading

    @inline
    def risen(w, i, after, per_h):  # type: ignore[no-untyped-def]
        if keeps_rise:
            w[RISE, i] = (after - w[X + P, i]) * per_h
        w[X + P, i] = after

    @inline
    def valve_step(w, n, e, h):  # type: ignore[no-untyped-def]
        per_h = 1.0 / h
        for i in range(LANES):
            risen(w, i, pressure(w, i, n, e, h)[0], per_h)

    @inline
    def split_valve_step(w, n, e, h):  # type: ignore[no-untyped-def]
        per_h = 1.0 / h
        for i in range(LANES):
            risen(w, i, split_pressure(w, i, n, e, h)[0], per_h)

    @inline
    def read(w, out, k):  # type: ignore[no-untyped-def]
        for i in range(LANES):
            out[i, 0, k] = hook_pressure(w, i, w[X + P, i])

    return {
        "valve_step": valve_step,
        "split_valve_step": split_valve_step,
        "read": read,
        "hook_prepare": hooks.prepare,
    }


def _joint_stage(hooks: Hooks) -> dict[str, Any]:
    """One step of the joints of all lanes, free or with imposed motion, and the readings of angle and force."""
    steps, equations = assemble(hooks), terms(hooks)
    creep, single, move, remember = steps.creep, steps.single, steps.move, steps.remember
    free_torque = equations.free_torque
    hook_true, hook_actuator, hook_dry = hooks.pressure_true, hooks.actuator_pressure, hooks.dry
    hook_angle, hook_force_sensor, hook_force = hooks.angle_reading, hooks.force_sensor, hooks.force_reading

    @inline
    def joint_fluid(w, i, h):  # type: ignore[no-untyped-def]
        p = hook_actuator(w, i, hook_true(w, i, w[INPUT, i]), h)
        before = w[X + CREEP, i]
        after = creep(w, i, p, h)
        w[ACTUATOR, i], w[MEAN_CREEP, i], w[X + CREEP, i] = p, 0.5 * (before + after), after

    @inline
    def free_step(w, e, h):  # type: ignore[no-untyped-def]
        per_h = 1.0 / h
        for i in range(LANES):
            joint_fluid(w, i, h)
            move(w, i, single(w, i, -w[_JC, i] * e[PARTNER], e, h), h, per_h)
            remember(w, i, h)

    @inline
    def driven_step(w, e, phi, h):  # type: ignore[no-untyped-def]
        for i in range(LANES):
            joint_fluid(w, i, h)
            w[PHI_BEFORE, i], w[X + PHI, i], w[X + OMEGA, i] = w[X + PHI, i], phi, e[SPEED]
            remember(w, i, h)

    @inline
    def outside(w, i, e):  # type: ignore[no-untyped-def]
        """Torque [N m] that the surroundings must exert for the measured motion; Eq. 8 for M_d."""
        actuator = free_torque(w, i, e[ANGLE], e[SPEED], w[ACTUATOR, i], w[X + CREEP, i], e)
        return actuator - w[_J, i] * e[ACCELERATION] - w[_JC, i] * e[PARTNER]

    @inline
    def read(w, e, dt, lever, driven, out, k):  # type: ignore[no-untyped-def]
        for i in range(LANES):
            out[i, 0, k] = hook_angle(w, i, w[X + PHI, i])
            force = outside(w, i, e)
            if driven:
                direction = min(max(e[SPEED] / STANDSTILL_RAD_S, -1.0), 1.0)
                force = (force - direction * hook_dry(w, i, e[ANGLE], e[SPEED], w[ACTUATOR, i])) / lever
            else:
                force = max(force / lever, 0.0)
            hook_force_sensor(w, i, force, dt)
            out[i, 1, k] = hook_force(w, i, force)

    return {
        "free_step": free_step,
        "driven_step": driven_step,
        "read": read,
        "hook_prepare": hooks.prepare,
    }


# Global names of the loops below, given by `specialise` for a set of effects.
hook_prepare: Any = None
valve_step: Any = None
split_valve_step: Any = None
free_step: Any = None
driven_step: Any = None
read: Any = None


def _valve_loop(key: str) -> Callable[..., Any]:
    """The loop of one block of lanes through samples begin ... end, to be specialised; work: at begin, then at end."""

    def open_valve(work, u, e, parts, dt, steps, lever, driven, late, begin, end, out):  # type: ignore[no-untyped-def]
        _ = key
        w = carray(stack_doubles(_SIZE), (WORK, LANES))
        for row in range(WORK):
            for i in range(LANES):
                w[row, i] = work[row, i]
        h = dt / steps
        for i in range(LANES):
            hook_prepare(w, i, h)
        for k in range(begin, end):
            for part in range(parts):
                first = part * (steps // parts)
                first_split, last_split = _deliver_part(w, u, parts * k + part, dt / parts, late, steps // parts)
                for n in range(steps // parts):
                    now = _row_between(e, k, (first + n + 0.5) / steps)
                    if first_split <= n <= last_split:
                        split_valve_step(w, n, now, h)
                    else:
                        valve_step(w, n, now, h)
            read(w, out, k + 1)
        for row in range(WORK):
            for i in range(LANES):
                work[row, i] = w[row, i]

    return open_valve


def _joint_loop(key: str) -> Callable[..., Any]:
    """The same for the joint; reading: measured pressures, evenly over the samples."""

    def open_joint(work, reading, e, parts, dt, steps, lever, driven, late, begin, end, out):  # type: ignore[no-untyped-def]
        _ = key
        w = carray(stack_doubles(_SIZE), (WORK, LANES))
        for row in range(WORK):
            for i in range(LANES):
                w[row, i] = work[row, i]
        h = dt / steps
        for i in range(LANES):
            hook_prepare(w, i, h)
        for k in range(begin, end):
            for n in range(steps):
                middle = (n + 0.5) / steps
                _measure(w, reading, k + middle, parts, late, dt)
                now = _row_between(e, k, middle)
                if driven:
                    way = e[k + 1, ANGLE] - e[k, ANGLE]
                    driven_step(w, now, e[k, ANGLE] + (n + 1.0) / steps * way, h)
                else:
                    free_step(w, now, h)
            read(w, _row(e, k + 1), dt, lever, driven, out, k + 1)
        for row in range(WORK):
            for i in range(LANES):
                work[row, i] = w[row, i]

    return open_joint


_SIGNATURE = "(f8[:,::1], f8[::1], f8[:,::1], i8, f8, i8, f8, b1, f8, i8, i8, f8[:,:,:])"


class Stage:
    """One stage: which numbers its readings depend on, and the loops of the effects that act in it."""

    def __init__(
        self,
        outputs: int,
        states: tuple[int, ...],
        hooks: frozenset[str],
        spared: frozenset[str],
        build: tuple[Callable[[Hooks], dict[str, Any]], Callable[[str], Callable[..., Any]]],
    ) -> None:
        """outputs: number of readings.  states: rows of a state that the stage starts from.  hooks: of its effects.

        spared: groups of the plain plant's numbers that it does not read.  build: functions of a step, and the loop.
        """
        self.outputs, self.states = outputs, list(states)
        self._hooks, self._build = hooks, build
        own = self.of(CATALOGUE)
        elsewhere = [effect for effect in CATALOGUE if effect not in own and effect.hooks]
        unread = {ROW[number.key] for number in PLANT_PARAMETERS if number.key.partition(".")[0] in spared}
        unread |= {ROW[number.key] for effect in elsewhere for number in effect.parameters}
        self._of_hands, self._of_all = self.of(HAND_EFFECTS), self.of(OPEN_EFFECTS)
        self._rows = {row for row in range(len(ROW)) if row not in unread}
        laws = {ROW[number.key]: number.neutral_si for effect in own for number in effect.parameters if number.law}
        self._law_rows, self._law_neutral = list(laws), np.array(list(laws.values()))
        self._uncompiled, self.compile = cache(self._specialised), cache(self._compiled)
        self.rows = cache(self._rows_of)
        """Rows of the parameters on which the readings depend where given effects act."""
        self._narrow = NarrowLoops(self.compile, self._kept)

    def of(self, effects: tuple[Effect, ...]) -> tuple[Effect, ...]:
        """Those of the effects that act in this stage."""
        return tuple(effect for effect in effects if not self._hooks.isdisjoint(effect.hooks))

    def loop(self, columns: Array, effects: tuple[Effect, ...], steps: int, *, fixed: bool) -> Any:
        """The compiled loop for parameter sets (k, rows), SI, in which effects act; steps: of blocks that it will take.

        fixed: whether exactly these effects are compiled in, or all that a fit may vary where that saves compiling.
        """
        own = self.of(effects)
        laws = bool(np.any(columns[:, self._law_rows] != self._law_neutral))
        if fixed:
            return self.compile(own, laws)
        every = self._of_hands if all(effect in self._of_hands for effect in own) else self._of_all
        return self._narrow.loop(own, every, laws, steps)

    def run(self, loop: Any, work: Array, readings: Array, *inputs: Any) -> None:
        """Let a loop compute all blocks of a working array (blocks, WORK, LANES) and their readings, in threads.

        readings: (blocks LANES, outputs, samples), both SI.  inputs: the other arguments of the loop.
        """
        blocks = [(loop, work[n], readings[n * LANES : (n + 1) * LANES], inputs) for n in range(len(work))]
        if len(blocks) == 1 or get_num_threads() == 1:
            for block in blocks:
                _run_block(block)
        else:
            list(_threads().map(_run_block, blocks))

    def _rows_of(self, acting: tuple[Effect, ...]) -> NDArray[np.intp]:
        read = (effect_rows(effect, prepared=False) for effect in self.of(acting))
        return np.array(sorted(self._rows.union(*read)))

    def _specialised(self, effects: tuple[Effect, ...], laws: bool) -> Any:
        """The loop of one block of lanes, specialised and not yet compiled."""
        functions, template = self._build
        key = equations_key("open with laws" if laws else "open", *(effect.name for effect in effects))
        loop = specialise(template(key), functions(compose(effects, laws)))
        return njit(cache=True, nogil=True, fastmath=FAST, error_model="numpy")(loop)

    def _compiled(self, effects: tuple[Effect, ...], laws: bool = False) -> Any:
        loop = self._uncompiled(effects, laws)
        loop.compile(_SIGNATURE)
        return loop

    def _kept(self, effects: tuple[Effect, ...], laws: bool) -> bool:
        return is_kept(self._uncompiled(effects, laws), _SIGNATURE)


@cache
def _threads() -> ThreadPoolExecutor:
    """Threads that compute blocks of lanes; a compiled loop does not hold the interpreter's lock."""
    return ThreadPoolExecutor(get_num_threads(), thread_name_prefix="open loop")


def _run_block(block: tuple[Any, Array, Array, tuple[Any, ...]]) -> None:
    loop, work, readings, inputs = block
    loop(work, *inputs, readings)


_OF_VALVE = frozenset(("valve", "supply"))
_OF_JOINT = frozenset(("statics", "material", "dynamics", "end_stop", "constant_load", "contact"))
_VALVE_HOOKS = frozenset(("set_point", "valve_error", "flow_limit", "pressure_source", "pressure_reading", "valve"))
VALVE = Stage(
    1,
    (P,),
    _VALVE_HOOKS,
    _OF_JOINT,
    (_valve_stage, _valve_loop),
)
JOINT = Stage(
    2,
    (PHI, OMEGA, CREEP),
    frozenset(HOOKS) - _VALVE_HOOKS - {"prepare"},
    _OF_VALVE,
    (_joint_stage, _joint_loop),
)


def compile_loop(effects: tuple[Effect, ...], laws: bool = False) -> None:
    """Compile the loops of both stages for a set of effects in the order of the catalogue, or load them."""
    for stage in (VALVE, JOINT):
        stage.compile(stage.of(effects), laws)
