"""The closed loop: one stage feeds the next, for the joints of one hand or of many.

    set-points -> dead time -> valve -> tube -> actuator torque and creep -> motion -> readings

A block is LANES = 16 joints wide, so that the compiler fills vector registers with the coupled pairs of lanes l and
l + 8; joints without a partner take what is left. Within a step every joint is advanced from the same instant: pairs
are solved together, and what a joint meets of others otherwise is predicted: the neighbour's angle in the middle of
the step by its speed, the inflow of the whole hand by a trial of the step (inflow.py). Blocks are independent and run
in parallel.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hand_model.arrays import Array
from hand_model.compile_cache import carray, is_kept, njit, prange
from hand_model.effects.effect import Effect
from hand_model.kernel.compiled import specialise, stack_doubles
from hand_model.kernel.hooks import HAND_EFFECTS, Hooks, active_effects, compose, equations_key, has_laws
from hand_model.kernel.inflow import flows as inflow_stages
from hand_model.kernel.inline import FAST, inline
from hand_model.kernel.lanes import HALF, LANES, idle_parameters, map_hands, neighbour_lanes
from hand_model.kernel.layout import (
    ACCELERATION,
    ACTUATOR,
    CREEP,
    FILLING,
    INFLOW_OF_HAND,
    MEAN_CREEP,
    NEIGHBOUR_ANGLE,
    OMEGA,
    PHI,
    RISE,
    SPEED_AFTER,
    WORK,
    P,
    X,
    prepare_rows,
)
from hand_model.kernel.rows import ROW, STARTS, STATES, STEP_S
from hand_model.kernel.step import assemble, deliver, steps_per_sample

HISTORY = 128
"""Set-points kept for the dead time, one a sample."""
PARALLEL_STEPS = 1000
"""Block-steps (about 0.1 us each) from which a call is worth the start of a parallel region."""
_SIZE = WORK * LANES
_DEAD = ROW["valve.dead_time_s"]


@inline
def _copy(source, target):  # type: ignore[no-untyped-def]
    """Copy all rows of lanes; assigning slices would take seconds to compile."""
    for row in range(WORK):
        for i in range(LANES):
            target[row, i] = source[row, i]


# Global names of the loops below, given by `specialise` for a set of effects.
draws = meets_others = prepares = remembers = reads_pressure = reads_angle = False
hook_prepare: Any = None
hook_pressure_reading: Any = None
hook_angle_reading: Any = None
changes: Any = None
flows: Any = None
split_flows: Any = None
note: Any = None
fluids: Any = None
split_fluids: Any = None
motions: Any = None
memories: Any = None
advance_block: Any = None


def _loop(key: str) -> Callable[..., Any]:
    """The loop of one block through its samples, to be specialised."""

    def advance_block(work, neighbour, history, head, commands, clock, steps, h, out):  # type: ignore[no-untyped-def]
        _ = key
        w = carray(stack_doubles(_SIZE), (WORK, LANES))
        _copy(work, w)
        dt = steps * h
        if prepares:
            for i in range(LANES):
                hook_prepare(w, i, h)
        for k in range(commands.shape[0]):
            head = (head + 1) % HISTORY
            for i in range(LANES):
                history[head, i] = commands[k, i]
            first_split, last_split = steps, -1
            for i in range(LANES):
                lag = w[_DEAD, i] / dt
                newest = head - int(lag)
                split = deliver(w, i, history[(newest - 1) % HISTORY, i], history[newest % HISTORY, i], lag, steps)
                if split >= 0:
                    first_split, last_split = min(first_split, split), max(last_split, split)
            first_change, last_change = changes(w, steps) if draws else (steps, -1)
            for n in range(steps):
                if meets_others:
                    for i in range(LANES):
                        w[NEIGHBOUR_ANGLE, i] = w[X + PHI, neighbour[i]] + 0.5 * h * w[X + OMEGA, neighbour[i]]
                if first_split <= n <= last_split:
                    if draws:
                        split_flows(w, n, clock, h)
                    split_fluids(w, n, clock, h)
                else:
                    if draws:
                        flows(w, n, clock, h, first_change <= n <= last_change)
                    fluids(w, n, clock, h)
                if draws:
                    note(w, first_change <= n <= last_change, h)
                motions(w, clock, h)
                if remembers:
                    memories(w, h)
                clock += h
            for i in range(LANES):
                out[k, P, i] = hook_pressure_reading(w, i, w[X + P, i]) if reads_pressure else w[X + P, i]
                out[k, PHI, i] = hook_angle_reading(w, i, w[X + PHI, i]) if reads_angle else w[X + PHI, i]
                out[k, OMEGA, i] = w[X + OMEGA, i]
                out[k, CREEP, i] = w[X + CREEP, i]
        _copy(w, work)
        return head, clock

    return advance_block


def _stages(hooks: Hooks, meets_others: bool, draws: bool) -> dict[str, Any]:
    """The stages of one step: the fluid of a lane, the motion of a pair of lanes, what follows from a lane's motion."""
    steps = assemble(hooks)
    pressure, split_pressure, creep = steps.pressure, steps.split_pressure, steps.creep
    pair, slide, stick, move, remember = steps.pair, steps.slide, steps.stick, steps.move, steps.remember
    hook_actuator, lags = hooks.actuator_pressure, hooks.uses("actuator_pressure")
    keeps_rise = steps.uses_rise

    @inline
    def around(w, i, clock, h):  # type: ignore[no-untyped-def]
        phi, omega, acceleration = w[X + PHI, i], w[X + OMEGA, i], w[ACCELERATION, i]
        ahead, speed = phi + 0.5 * h * omega, omega + 0.5 * h * acceleration
        if meets_others:
            return clock + 0.5 * h, w[NEIGHBOUR_ANGLE, i], w[INFLOW_OF_HAND, i], 0.0, ahead, speed, acceleration
        return clock + 0.5 * h, 0.0, 0.0, 0.0, ahead, speed, acceleration

    @inline
    def keep(w, i, after, mean, h, per_h):  # type: ignore[no-untyped-def]
        if draws:
            w[FILLING, i] = max(after - w[X + P, i], 0.0) * per_h
        if keeps_rise:
            w[RISE, i] = (after - w[X + P, i]) * per_h
        w[X + P, i] = after
        p = hook_actuator(w, i, mean, h) if lags else mean
        before = w[X + CREEP, i]
        creeping = creep(w, i, p, h)
        w[ACTUATOR, i], w[MEAN_CREEP, i], w[X + CREEP, i] = p, 0.5 * (before + creeping), creeping

    @inline
    def fluids(w, n, clock, h):  # type: ignore[no-untyped-def]
        per_h = 1.0 / h
        for i in range(LANES):
            after, mean = pressure(w, i, n, around(w, i, clock, h), h)
            keep(w, i, after, mean, h, per_h)

    @inline
    def split_fluids(w, n, clock, h):  # type: ignore[no-untyped-def]
        per_h = 1.0 / h
        for i in range(LANES):
            after, mean = split_pressure(w, i, n, around(w, i, clock, h), h)
            keep(w, i, after, mean, h, per_h)

    @inline
    def rubbing_motions(w, clock, h):  # type: ignore[no-untyped-def]
        per_h = 1.0 / h
        others = 0
        for i in range(HALF):
            j = i + HALF
            _, _, goes_on = slide(w, i, j, around(w, i, clock, h), around(w, j, clock, h), h)
            others += 0 if goes_on else 1
        if others > 0:  # to solve the stop of a joint takes as much time as all of its torques
            for i in range(HALF):
                stick(w, i, i + HALF)
        for i in range(LANES):
            move(w, i, w[SPEED_AFTER, i], h, per_h)

    @inline
    def motions(w, clock, h):  # type: ignore[no-untyped-def]
        per_h = 1.0 / h
        for i in range(HALF):
            j = i + HALF
            a, b = pair(w, i, j, around(w, i, clock, h), around(w, j, clock, h), h)
            move(w, i, a, h, per_h)
            move(w, j, b, h, per_h)

    @inline
    def memories(w, h):  # type: ignore[no-untyped-def]
        for i in range(LANES):
            remember(w, i, h)

    stages = {"fluids": fluids, "split_fluids": split_fluids, "memories": memories}
    stages["motions"] = rubbing_motions if steps.rubs else motions
    return stages | inflow_stages(steps, around)


_BLOCK = "(f8[:,::1], i8[::1], f8[:,::1], i8, f8[:,::1], f8, i8, f8, f8[:,:,::1])"


@dataclass(frozen=True, slots=True)
class Loops:
    """The compiled loop of one block, and the loop over many blocks in parallel, for a set of effects."""

    block: Any
    blocks: Callable[[], Any]


def _parallel(key: str) -> Callable[..., Any]:
    """The loop over blocks, to be specialised."""

    def advance_blocks(work, neighbour, history, heads, commands, clock, steps, h, out):  # type: ignore[no-untyped-def]
        _ = key
        for block in prange(work.shape[0]):
            head, sets = heads[block], commands[block]
            heads[block], _ = advance_block(
                work[block], neighbour[block], history[block], head, sets, clock, steps, h, out[block]
            )

    return advance_blocks


def _key_of(effects: tuple[Effect, ...], laws: bool) -> str:
    return equations_key("closed with laws" if laws else "closed", *(effect.name for effect in effects))


@cache
def _uncompiled(effects: tuple[Effect, ...], laws: bool) -> Any:
    """The loop of one block, specialised and not yet compiled."""
    hooks = compose(effects, laws)
    meets_others, draws = any(effect.meets_others for effect in effects), any(effect.draws for effect in effects)
    names = {
        **_stages(hooks, meets_others, draws),
        "meets_others": meets_others,
        "draws": draws,
        "prepares": hooks.uses("prepare"),
        "remembers": hooks.uses("moved") or hooks.uses("angle_sensor"),
        "reads_pressure": hooks.uses("pressure_reading"),
        "reads_angle": hooks.uses("angle_reading"),
        "hook_prepare": hooks.prepare,
        "hook_pressure_reading": hooks.pressure_reading,
        "hook_angle_reading": hooks.angle_reading,
    }
    return njit(cache=True, fastmath=FAST, error_model="numpy")(specialise(_loop(_key_of(effects, laws)), names))


@cache
def loops(effects: tuple[Effect, ...], laws: bool = False) -> Loops:
    """The loops for a set of effects in the order of the catalogue; the empty set is the plain plant.

    laws: whether they read the coefficients of learned laws.
    """
    block = _uncompiled(effects, laws)
    block.compile(_BLOCK)

    @cache
    def blocks() -> Any:
        named = specialise(_parallel(_key_of(effects, laws)), {"advance_block": block})
        return njit(cache=True, parallel=True)(named)

    return Loops(block, blocks)


@cache
def _compiled_in(acting: tuple[Effect, ...], laws: bool, one_block: bool) -> tuple[Effect, ...]:
    """The effects of the loop that computes those which act; what is neutral changes no bit.

    To compile their own loop takes seconds. Where the disk does not hold it, but holds the one of all effects of a hand
    as after a build, that one serves, although its steps take several times as long (about 0.4 us). one_block: whether
    the joints are of one hand and fit into one block, because some of the other effects act between joints.
    """
    may = one_block and not laws and set(acting) <= set(HAND_EFFECTS)
    if may and not is_kept(_uncompiled(acting, laws), _BLOCK) and is_kept(_uncompiled(HAND_EFFECTS, laws), _BLOCK):
        return HAND_EFFECTS
    return acting


class ClosedLoop:
    """The joints of hands of one build, Eqs. 6 to 13 with a set of effects, advanced sample by sample."""

    def __init__(
        self,
        parameters: Array,
        partner: NDArray[np.int64],
        state: Array,
        period_s: float,
        *,
        effects: tuple[Effect, ...] | None = None,
        step_s: float = STEP_S,
    ) -> None:
        """Begin at `state`, vented for long, sampling every period_s [s].

        parameters: (hands, rows of JOINT_PARAMETERS, joints) SI.  partner: (joints,) index of the coupled joint or -1.
        state: (hands, STATES, joints).  effects: those compiled in, by default the ones that act in `parameters`, or
        all of a hand where that loop is compiled already.  step_s: largest integration step [s]. A joint's neighbour,
        where an effect needs one, is its partner, or else the joint before it. Raises ValueError for a period that is
        not positive, a dead time longer than the memory of set-points, or more than 16 joints with effects between
        joints.
        """
        if not (math.isfinite(period_s) and period_s > 0.0):
            raise ValueError(f"period_s is {period_s!r}; it must be a positive number of seconds")
        self._check_dead_time(parameters, period_s)
        self._hands, _, self._joints = parameters.shape
        laws, one_block = has_laws(parameters.transpose(0, 2, 1)), self._hands == 1 and self._joints <= LANES
        acting = active_effects(parameters.transpose(1, 0, 2))
        chosen = _compiled_in(acting, laws, one_block) if effects is None else effects
        self._loops = loops(chosen, laws)
        apart = any(effect.meets_others for effect in chosen)
        self._map = map_hands(partner, self._hands, apart=apart)
        self._steps = steps_per_sample(period_s, step_s)
        self._h = period_s / self._steps
        self._clock = 0.0
        self._neighbour = neighbour_lanes(self._map, partner, self._hands)
        self._history = np.zeros((self._map.blocks, HISTORY, LANES))
        self._heads = np.zeros(self._map.blocks, dtype=np.int64)
        self._work = np.zeros((self._map.blocks, WORK, LANES))
        self._work[:, : len(ROW)] = self._map.scatter(_side_by_side(parameters), idle_parameters())
        self._work[:, X : X + STATES] = self._map.scatter(_side_by_side(state), np.zeros(STATES))
        for row, kind in STARTS:
            self._work[:, row] = self._work[:, X + (PHI if kind == "angle" else P)]
        prepare_rows(self._work, self._h)

    @staticmethod
    def _check_dead_time(parameters: Array, period_s: float) -> None:
        longest, allowed = float(parameters[:, _DEAD].max()), (HISTORY - 2) * period_s
        if longest > allowed:
            raise ValueError(
                f"valve.dead_time_s is {longest:g}; at {1.0 / period_s:g} samples a second the allowed range is"
                f" 0 to {allowed:g}"
            )

    @property
    def state(self) -> Array:
        """True state now, (hands, STATES, joints), SI."""
        rows = self._map.gather(self._work[:, X : X + STATES])
        return np.ascontiguousarray(rows.reshape(STATES, self._hands, self._joints).transpose(1, 0, 2))

    def shift(self, change: Array) -> None:
        """Add a change (hands, STATES, joints), SI, to the true state; the memory of the effects stays."""
        rows = self._map.scatter(_side_by_side(change), np.zeros(STATES))
        self._work[:, X : X + STATES] += rows

    def hold_history(self, pressure_pa: Array) -> None:
        """Fill the dead-time memory as if pressure_pa (hands, joints) had been commanded for long."""
        self._history[:] = self._lanes(pressure_pa[:, None])[:, :1]

    def change(self, key: str, values: Array) -> None:
        """Give one parameter other values (hands, joints) in SI from now on.

        Its effect must be one of those compiled in. The dead time cannot be changed, and a coefficient of a learned law
        only where one differs from its neutral value at the start.
        """
        self._work[self._map.block, ROW[key], self._map.lane] = values.ravel()
        prepare_rows(self._work, self._h)

    def advance(self, pressure_pa: Array) -> Array:
        """Apply set-points (hands, samples, joints) [Pa]; return readings (hands, samples, STATES, joints).

        Pressure and angle are what ideal converters read from the sensors, with the sensors' effects; speed and
        creeping ratio are true. Raises ValueError for another shape.
        """
        if pressure_pa.ndim != 3 or pressure_pa.shape[::2] != (self._hands, self._joints):
            raise ValueError(
                f"pressure_pa has the shape {pressure_pa.shape}; it must be ({self._hands}, samples, {self._joints})"
            )
        commands = self._lanes(pressure_pa)
        blocks, samples = self._map.blocks, commands.shape[1]
        out = np.empty((blocks, samples, STATES, LANES))
        if blocks == 1 or blocks * samples * self._steps < PARALLEL_STEPS:
            for block in range(blocks):
                self._heads[block], _ = self._loops.block(
                    self._work[block], self._neighbour[block], self._history[block], self._heads[block],
                    commands[block], self._clock, self._steps, self._h, out[block],
                )  # fmt: skip
        else:
            memory = (self._work, self._neighbour, self._history, self._heads)
            self._loops.blocks()(*memory, commands, self._clock, self._steps, self._h, out)
        self._clock += samples * self._steps * self._h
        split = out[self._map.block, :, :, self._map.lane].reshape(self._hands, self._joints, samples, STATES)
        return np.ascontiguousarray(split.transpose(0, 2, 3, 1))

    def _lanes(self, pressure_pa: Array) -> Array:
        lanes = np.zeros((self._map.blocks, pressure_pa.shape[1], LANES))
        lanes[self._map.block, :, self._map.lane] = pressure_pa.transpose(0, 2, 1).reshape(-1, pressure_pa.shape[1])
        return lanes


def _side_by_side(values: Array) -> Array:
    """(hands, rows, joints) to (rows, hands * joints)."""
    return values.transpose(1, 0, 2).reshape(values.shape[1], -1)
