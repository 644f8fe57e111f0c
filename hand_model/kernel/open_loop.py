"""The open loop: every stage on measured inputs, for many parameter sets of one joint.

    set-points        -> valve stage  -> predicted pressure reading
    measured pressure -> joint stage  -> predicted angle reading
    measured motion   -> force stage  -> predicted force reading

An error in one stage leaves the others alone, which is what fits and the diagnosis need. The terms and steps are
those of the closed loop; lanes are parameter sets, which share their inputs. A machine whose motion is imposed takes
its measured angle, and its force is predicted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from hand_model.arrays import Array
from hand_model.compile_cache import carray, is_kept, njit, prange
from hand_model.effects import CATALOGUE
from hand_model.effects.effect import (
    ACCELERATION,
    ANGLE,
    EXOGENOUS,
    NEIGHBOUR,
    PARTNER,
    SPEED,
    TIME,
    Effect,
)
from hand_model.kernel.compiled import specialise, stack_doubles
from hand_model.kernel.hooks import (
    HAND_EFFECTS,
    OPEN_EFFECTS,
    Hooks,
    active_effects,
    compose,
    equations_key,
    has_laws,
)
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
    prepare_rows,
)
from hand_model.kernel.narrow_loops import NarrowLoops
from hand_model.kernel.rows import ROW, STARTS, STATES, STEP_S, memory_rows
from hand_model.kernel.step import assemble, deliver, steps_per_sample, whole_below
from hand_model.kernel.terms import terms

LANES = 8
"""Parameter sets computed side by side: one vector of 512 bits, or two of 256 bits."""
READINGS = ("pressure", "angle", "force")
"""What the stages predict, in order: pressure [Pa], angle [rad] and force [N]."""
OUTPUTS = len(READINGS)
STANDSTILL_RAD_S = 0.02
"""Speed below which friction of a machine with imposed motion acts in part only."""
_SIZE = WORK * LANES
_DEAD, _CLOCK, _SHARE = ROW["valve.dead_time_s"], ROW["clock_offset.offset_s"], ROW["clock_offset.share"]
_COMMAND = ROW["command_delay.dead_time_s"]
_J, _JC = ROW["dynamics.inertia_kg_m2"], ROW["dynamics.coupling_inertia_kg_m2"]


@dataclass(frozen=True, slots=True)
class MeasuredInputs:
    """What was measured at the inputs of the stages of one joint.

    set_point_pa: (parts (samples - 1) + 1,) [Pa], `parts` evenly over each sample; each holds until the next.
    pressure_pa: (finer (samples - 1) + 1,) [Pa] without gaps, `finer` readings evenly over each sample.
    surroundings: (samples, 7): time [s], neighbour's
    angle [rad], inflow of the whole hand [Pa/s], partner's acceleration [rad/s^2], the joint's angle [rad], speed
    [rad/s] and acceleration [rad/s^2].  period_s: sample period [s].  late_s: time by which pressures were read after
    the ticks of everything else [s], less than a sample.
    """

    set_point_pa: Array
    pressure_pa: Array
    surroundings: Array
    period_s: float
    late_s: float = 0.0


def surroundings_of(
    time_s: Array,
    motion: tuple[Array, Array, Array],
    neighbour_rad: Array | float = 0.0,
    partner_rad_s2: Array | float = 0.0,
) -> Array:
    """The surroundings (samples, EXOGENOUS) of a joint; the inflow of the whole hand is 0.

    time_s: (samples,) [s].  motion: angle [rad], speed [rad/s] and acceleration [rad/s^2] of the joint, (samples,).
    neighbour_rad: angle of another joint.  partner_rad_s2: acceleration of the joint that is coupled to it.
    """
    e = np.zeros((len(time_s), EXOGENOUS))
    e[:, TIME] = time_s
    e[:, ANGLE], e[:, SPEED], e[:, ACCELERATION] = motion
    e[:, NEIGHBOUR], e[:, PARTNER] = neighbour_rad, partner_rad_s2
    return e


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


def _stages(hooks: Hooks) -> dict[str, Any]:
    """One step and the readings, for all lanes."""
    steps, equations = assemble(hooks), terms(hooks)
    pressure, split_pressure, creep = steps.pressure, steps.split_pressure, steps.creep
    single, move, remember, keeps_rise = steps.single, steps.move, steps.remember, steps.uses_rise
    free_torque = equations.free_torque
    hook_true, hook_actuator, hook_dry = hooks.pressure_true, hooks.actuator_pressure, hooks.dry
    hook_pressure, hook_angle = hooks.pressure_reading, hooks.angle_reading
    hook_force_sensor, hook_force = hooks.force_sensor, hooks.force_reading

    @inline
    def joint_fluid(w, i, h):  # type: ignore[no-untyped-def]
        p = hook_actuator(w, i, hook_true(w, i, w[INPUT, i]), h)
        before = w[X + CREEP, i]
        after = creep(w, i, p, h)
        w[ACTUATOR, i], w[MEAN_CREEP, i], w[X + CREEP, i] = p, 0.5 * (before + after), after

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
            out[i, 0, k] = hook_pressure(w, i, w[X + P, i])
            out[i, 1, k] = hook_angle(w, i, w[X + PHI, i])
            force = outside(w, i, e)
            if driven:
                direction = min(max(e[SPEED] / STANDSTILL_RAD_S, -1.0), 1.0)
                force = (force - direction * hook_dry(w, i, e[ANGLE], e[SPEED], w[ACTUATOR, i])) / lever
            else:
                force = max(force / lever, 0.0)
            hook_force_sensor(w, i, force, dt)
            out[i, 2, k] = hook_force(w, i, force)

    return {
        "valve_step": valve_step,
        "split_valve_step": split_valve_step,
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
block_loop: Any = None


def _loop(key: str) -> Callable[..., Any]:
    """The loop of one block of lanes through samples begin ... end, to be specialised; work: at begin, then at end."""

    def open_block(work, u, parts, reading, e, dt, steps, lever, driven, late, begin, end, out):  # type: ignore[no-untyped-def]
        _ = key
        w = carray(stack_doubles(_SIZE), (WORK, LANES))
        for row in range(WORK):
            for i in range(LANES):
                w[row, i] = work[row, i]
        h = dt / steps
        finer = (reading.shape[0] - 1) / max(e.shape[0] - 1, 1)
        for i in range(LANES):
            hook_prepare(w, i, h)
        for k in range(begin, end):
            for part in range(parts):
                first = part * (steps // parts)
                first_split, last_split = _deliver_part(w, u, parts * k + part, dt / parts, late, steps // parts)
                for n in range(steps // parts):
                    middle = (first + n + 0.5) / steps
                    _measure(w, reading, k + middle, finer, late, dt)
                    now = _row_between(e, k, middle)
                    if first_split <= n <= last_split:
                        split_valve_step(w, n, now, h)
                    else:
                        valve_step(w, n, now, h)
                    if driven:
                        way = e[k + 1, ANGLE] - e[k, ANGLE]
                        driven_step(w, now, e[k, ANGLE] + (first + n + 1.0) / steps * way, h)
                    else:
                        free_step(w, now, h)
            read(w, _row(e, k + 1), dt, lever, driven, out, k + 1)
        for row in range(WORK):
            for i in range(LANES):
                work[row, i] = w[row, i]

    return open_block


def _blocks(key: str) -> Callable[..., Any]:
    """All blocks in parallel, to be specialised; the loop of a block is compiled alone so that it is vectorised."""

    def open_lanes(w, u, parts, reading, e, dt, steps, lever, driven, late, begin, end, out):  # type: ignore[no-untyped-def]
        _ = key
        for block in prange(w.shape[0]):
            lanes = out[LANES * block : LANES * (block + 1)]
            block_loop(w[block], u, parts, reading, e, dt, steps, lever, driven, late, begin, end, lanes)

    return open_lanes


_OTHERS = [own for effect in OPEN_EFFECTS if effect not in HAND_EFFECTS for own in effect.parameters]
_OTHER_ROWS, _OTHER_NEUTRAL = [ROW[own.key] for own in _OTHERS], np.array([own.neutral_si for own in _OTHERS])


_OWN = {effect.name: [ROW[own.key] for own in effect.parameters] for effect in CATALOGUE}
"""Rows of the parameters of each effect."""


_BLOCK = "(f8[:,::1], f8[::1], i8, f8[::1], f8[:,::1], f8, i8, f8, b1, f8, i8, i8, f8[:,:,::1])"
_LANES = "(f8[:,:,::1], f8[::1], i8, f8[::1], f8[:,::1], f8, i8, f8, b1, f8, i8, i8, f8[:,:,::1])"


@cache
def _uncompiled(effects: tuple[Effect, ...], laws: bool) -> tuple[Any, Any]:
    """The loop of one block and that of all blocks, specialised and not yet compiled."""
    key = equations_key("open with laws" if laws else "open", *(effect.name for effect in effects))
    stages = _stages(compose(effects, laws))
    block = njit(cache=True, fastmath=FAST, error_model="numpy")(specialise(_loop(key), stages))
    lanes = njit(cache=True, parallel=True)(specialise(_blocks(key), {"block_loop": block}))
    return block, lanes


@cache
def compile_loop(effects: tuple[Effect, ...], laws: bool = False) -> Any:
    """The compiled open loop for a set of effects in the order of the catalogue, with or without learned laws."""
    block, lanes = _uncompiled(effects, laws)
    block.compile(_BLOCK)
    lanes.compile(_LANES)
    return lanes


def _kept(effects: tuple[Effect, ...], laws: bool) -> bool:
    return is_kept(_uncompiled(effects, laws)[0], _BLOCK)


NARROW = NarrowLoops(compile_loop, _kept)


def _loop_for(columns: Array, effects: tuple[Effect, ...] | None, steps: int) -> Any:
    """The compiled loop for parameter sets (k, rows), see `open_loop`; steps: of blocks that it will take."""
    laws = has_laws(columns)
    if effects is not None:
        return compile_loop(effects, laws)
    every = OPEN_EFFECTS if np.any(columns[:, _OTHER_ROWS] != _OTHER_NEUTRAL) else HAND_EFFECTS
    return NARROW.loop(active_effects(columns.T), every, laws, steps)


def open_loop(
    columns: Array,
    start: Array,
    inputs: MeasuredInputs,
    *,
    lever_m: float = 1.0,
    step_s: float = STEP_S,
    driven: bool = False,
    effects: tuple[Effect, ...] | None = None,
    changed: tuple[int, Array] | None = None,
) -> Array:
    """Readings (columns, OUTPUTS, samples) that each parameter set predicts from each stage's measured inputs.

    Eqs. 6, 8, 11 and 12 with a set of effects.

    columns: (columns, rows of JOINT_PARAMETERS) SI.  start: (columns, STATES) at the first sample.  lever_m: arm of the
    force sensor [m].  step_s: largest integration step [s].  driven: the motion is imposed, and the force is predicted.
    effects: those compiled in, in the order of the catalogue; by default those that act, or all that a fit may vary
    (`NarrowLoops`), without those of other machines where none of them acts.  changed: a sample from which on other
    parameter sets, of the same shape, hold; the state goes on, and the effects that change begin as at a first sample.
    """
    count, samples = len(columns), len(inputs.surroundings)
    blocks = -(-count // LANES)
    parts = max(1, (len(inputs.set_point_pa) - 1) // max(samples - 1, 1))
    steps = parts * steps_per_sample(inputs.period_s / parts, step_s)
    w = np.zeros((blocks * LANES, WORK))
    w[:count, X : X + STATES], w[count:, X : X + STATES] = start, start[-1]
    for row, kind in STARTS:
        w[:, row] = w[:, X + PHI] if kind == "angle" else inputs.pressure_pa[0]
    work = np.ascontiguousarray(w.reshape(blocks, LANES, WORK).transpose(0, 2, 1))
    out = np.empty((blocks * LANES, OUTPUTS, samples))
    out[:, 0, 0], out[:, 1, 0], out[:, 2, 0] = w[:, X + P], w[:, X + PHI], 0.0
    measured = (inputs.set_point_pa, inputs.pressure_pa, inputs.surroundings)
    u, p, e = (np.ascontiguousarray(signal, dtype=np.float64) for signal in measured)
    periods = [(0, samples - 1, columns)]
    if changed is not None:
        periods = [(0, changed[0], columns), (changed[0], samples - 1, changed[1])]
    loop = _loop_for(np.concatenate([each for _, _, each in periods]), effects, blocks * samples * steps)
    for begin, end, holding in periods:
        if begin > 0:
            e = _begun(work, columns, holding, p[(len(p) - 1) // max(samples - 1, 1) * begin], e, begin)
        lanes = np.concatenate([holding, np.repeat(holding[-1:], blocks * LANES - count, axis=0)])
        work[:, : len(ROW)] = lanes.reshape(blocks, LANES, len(ROW)).transpose(0, 2, 1)
        prepare_rows(work, inputs.period_s / steps)
        loop(work, u, parts, p, e, inputs.period_s, steps, lever_m, driven, inputs.late_s, begin, end, out)
    return out[:count]


def _begun(work: Array, before: Array, after: Array, pressure_pa: float, e: Array, sample: int) -> Array:
    """Give the memory of the effects that change at a sample its start, in place; returns the surroundings from there.

    work: (blocks, WORK, LANES).  before, after: parameter sets (columns, rows).  pressure_pa: measured then.  e: the
    surroundings (samples, EXOGENOUS); their time begins at the sample, too, where nothing else acts.
    """
    begun = [effect for effect in CATALOGUE if np.any(before[:, _OWN[effect.name]] != after[:, _OWN[effect.name]])]
    for effect in begun:
        for row, start in zip(memory_rows(effect), effect.starts.values(), strict=True):
            work[:, row] = work[:, X + PHI] if start == "angle" else pressure_pa if start == "pressure" else 0.0
    if set(active_effects(after.T)) <= set(begun):
        e = e.copy()
        e[:, TIME] -= e[sample, TIME]
    return e
