"""The open loop: every stage on measured inputs, for many parameter sets of one joint.

    set-points        -> valve stage  -> predicted pressure reading
    measured pressure -> joint stage  -> predicted angle reading
    measured motion   -> force stage  -> predicted force reading

An error in one stage leaves the others alone, which is what fits and the diagnosis need. The terms and steps are
those of the closed loop; lanes are parameter sets, which share their inputs. A machine whose motion is imposed takes
its measured angle, and its force is predicted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hand_model.arrays import Array
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
from hand_model.kernel.hooks import active_effects
from hand_model.kernel.layout import PHI, WORK, X, prepare_rows
from hand_model.kernel.open_stages import JOINT, LANES, VALVE, Stage
from hand_model.kernel.rows import ROW, STARTS, STATES, STEP_S, memory_rows
from hand_model.kernel.step import steps_per_sample

READINGS = ("pressure", "angle", "force")
"""What the stages predict, in order: pressure [Pa], angle [rad] and force [N]."""
OUTPUTS = len(READINGS)


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


_OWN = {effect.name: [ROW[own.key] for own in effect.parameters] for effect in CATALOGUE}
"""Rows of the parameters of each effect."""


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
    samples = len(inputs.surroundings)
    parts = max(1, (len(inputs.set_point_pa) - 1) // max(samples - 1, 1))
    steps = parts * steps_per_sample(inputs.period_s / parts, step_s)
    measured = (inputs.set_point_pa, inputs.pressure_pa, inputs.surroundings)
    u, p, e = (np.ascontiguousarray(signal, dtype=np.float64) for signal in measured)
    finer = (len(p) - 1) // max(samples - 1, 1)
    edges, holding, around = [0, samples - 1], [columns], [e]
    begun: list[Effect] = []
    if changed is not None:
        edges, holding = [0, changed[0], samples - 1], [columns, changed[1]]
        differs = (columns != changed[1]).any(axis=0)
        begun = [each for each in CATALOGUE if differs[_OWN[each.name]].any()]
        around.append(_later(e, changed[0], begun, changed[1]))
    acting = active_effects(np.concatenate(holding).T) if effects is None else effects
    out = np.empty((-(-len(columns) // LANES) * LANES, OUTPUTS, samples))
    first = 0
    for stage, signal, per_sample in ((VALVE, u, parts), (JOINT, p, finer)):
        chosen, kinds = _distinct(stage, acting, start, holding)
        filled = chosen + chosen[-1:] * (-len(chosen) % LANES)
        readings = out[: len(filled), first : first + stage.outputs]
        work = _at_start(start[filled], float(p[0]))
        some = np.concatenate([sets[chosen] for sets in holding])
        loop = stage.loop(some, acting, len(work) * samples * steps, fixed=effects is not None)
        readings[:, 0, 0] = work[:, X + stage.states[0]].ravel()
        readings[:, 1:, 0] = 0.0
        for sets, surroundings, (begin, end) in zip(holding, around, pairwise(edges), strict=True):
            if begin > 0:
                _begin(work, begun, float(p[finer * begin]))
            work[:, : len(ROW)] = sets[filled].reshape(-1, LANES, len(ROW)).transpose(0, 2, 1)
            prepare_rows(work, inputs.period_s / steps)
            times = (per_sample, inputs.period_s, steps, lever_m, driven, inputs.late_s, begin, end)
            stage.run(loop, work, readings, signal, surroundings, *times)
        for row in reversed(range(len(kinds))):  # a set's kind is no later than itself
            if kinds[row] != row:
                out[row, first : first + stage.outputs] = readings[kinds[row]]
        first += stage.outputs
    return out[: len(columns)]


def _distinct(
    stage: Stage, acting: tuple[Effect, ...], start: Array, holding: Sequence[Array]
) -> tuple[list[int], list[int]]:
    """Parameter sets that differ for a stage: the first of each kind, and the number of the kind of every set.

    A fit moves one number at a time, and most numbers change one stage alone.
    """
    read = np.concatenate([start[:, stage.states], *(sets[:, stage.rows(acting)] for sets in holding)], axis=1)
    numbers, size = read.tobytes(), read.itemsize * read.shape[1]
    known: dict[bytes, int] = {}
    kinds = [known.setdefault(numbers[at : at + size], len(known)) for at in range(0, len(numbers), size)]
    return [kinds.index(kind) for kind in range(len(known))], kinds


def _at_start(start: Array, pressure_pa: float) -> Array:
    """Working array (blocks, WORK, LANES) of starts (blocks LANES, STATES) before the first sample."""
    w = np.zeros((len(start), WORK))
    w[:, X : X + STATES] = start
    for row, kind in STARTS:
        w[:, row] = w[:, X + PHI] if kind == "angle" else pressure_pa
    return np.ascontiguousarray(w.reshape(-1, LANES, WORK).transpose(0, 2, 1))


def _begin(work: Array, begun: Sequence[Effect], pressure_pa: float) -> None:
    """Give the memory of effects that begin to act its start, in place; pressure_pa: measured then."""
    for effect in begun:
        for row, start in zip(memory_rows(effect), effect.starts.values(), strict=True):
            work[:, row] = work[:, X + PHI] if start == "angle" else pressure_pa if start == "pressure" else 0.0


def _later(e: Array, sample: int, begun: Sequence[Effect], columns: Array) -> Array:
    """The surroundings (samples, EXOGENOUS) from a sample on, at which their time begins if nothing else acts."""
    if sample > 0 and set(active_effects(columns.T)) <= set(begun):
        e = e.copy()
        e[:, TIME] -= e[sample, TIME]
    return e
