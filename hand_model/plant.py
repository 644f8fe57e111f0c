"""The plant kernel: valve, pressure, torque, creep and motion of many joints at a fixed step.

Per joint: the set-point is cut to the supply and passes a dead time; the pressure follows it by a first-order
lag with separate rate limits for fill and vent; the pressure makes torque by Eq. 11 with the creeping ratio of
Eq. 12; torque moves the phalanx by Eq. 8 against viscous friction, smooth end stops, an obstacle and a load.

Two phalanges of a finger share inertia. In relative joint angles the mass matrix of the pair is
[[J_p, J_c], [J_c, J_d]]: J_p with the distal joint locked, J_d the distal phalanx about its own joint, J_c the
coupling inertia, taken constant at its value in mid range. The distal joint's reaction on the proximal one is
therefore J_c times the distal acceleration; by virtual work the distal actuator's torque itself does no work
on the proximal angle. The thumb's opposition axis is perpendicular to its flexion axes and stays uncoupled.

Integrator: classical fourth-order Runge-Kutta, step at most STEP_S; the set-point is constant within a step
(where a dead time ends inside a step, the time-weighted mean of the two set-points that the step spans).

The compiler turns a loop over the pairs of lanes l and l + 8 into full vector registers. That needs one step of a
pair to be straight-line code without divisions, so all that is constant over a call is prepared once, in `_prepare`.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numba import carray, njit, prange
from numpy.typing import NDArray

from hand_model.joint import one_sided
from hand_model.kernel.plant_rows import PLANT_PARAMETERS, STEP_S
from hand_model.kernel.plant_rows import PLANT_ROW as ROW
from hand_model.lanes import HALF, LANES
from hand_model.material import creep_rate
from hand_model.stack_rows import stack_doubles
from hand_model.statics import torque

__all__ = ["CREEP", "HISTORY", "OMEGA", "PHI", "STATES", "STEP_S", "P", "Plant", "advance", "steps_per_sample"]

STATES = 4
P, PHI, OMEGA, CREEP = range(STATES)
"""Rows of a state array: pressure [Pa], angle [rad], speed [rad/s], creeping ratio."""
HISTORY = 128
"""Set-points kept for the dead time, one a sample: 64 ms of samples as short as the largest step."""
PARALLEL_STEPS = 1000
"""Block-steps (about 0.1 us each) from which a call is worth the start of a parallel region."""

_FAST = {"contract", "nnan", "nsz"}
_inline = njit(forceinline=True, fastmath=_FAST)
# Compiled anew with this kernel: taken from a cache, the same equations would round differently in the last bit,
# and the serial and the parallel kernel need not have been compiled in the same process.
_torque, _one_sided, _creep_rate = (_inline(getattr(f, "py_func", f)) for f in (torque, one_sided, creep_rate))

_ROWS = len(PLANT_PARAMETERS)
_DEAD = ROW["valve.dead_time_s"]
_TAU = ROW["valve.time_constant_s"]
_FILL = ROW["valve.fill_rate_pa_per_s"]
_VENT = ROW["valve.vent_rate_pa_per_s"]
_A0 = ROW["statics.a0_nm"]
_A1 = ROW["statics.a1_nm_per_rad"]
_A2 = ROW["statics.a2_nm_per_pa"]
_A3 = ROW["statics.a3_nm_per_pa_rad"]
_PHI_MAX = ROW["material.phi_max_deg"]
_P_MIN = ROW["material.p_min_pa"]
_B1 = ROW["material.b1_per_pa"]
_T_EXT = ROW["material.extension_time_s"]
_B0 = ROW["material.b0_per_pa"]
_T_REC = ROW["material.recovery_time_s"]
_J = ROW["dynamics.inertia_kg_m2"]
_D = ROW["dynamics.viscous_friction_nm_s_per_rad"]
_JC = ROW["dynamics.coupling_inertia_kg_m2"]
_LOW = ROW["end_stop.low_deg"]
_HIGH = ROW["end_stop.high_deg"]
_K_STOP = ROW["end_stop.stiffness_nm_per_rad"]
_D_STOP = ROW["end_stop.damping_nm_s_per_rad"]
_W_STOP = ROW["end_stop.engagement_deg"]
_LOAD = ROW["constant_load.torque_nm"]
_CONTACT = ROW["contact.angle_deg"]
_K_CONTACT = ROW["contact.stiffness_nm_per_rad"]
_D_CONTACT = ROW["contact.damping_nm_s_per_rad"]
_W_CONTACT = ROW["contact.engagement_deg"]
_SUPPLY = ROW["supply.pressure_pa"]

# Rows of the working array below the parameters: reciprocals, the inverse mass matrix (own and partner's torque),
# the step of a sample at which a set-point arrives, the set-points before and after that, the state.
_PER_TAU, _PER_T_EXT, _PER_T_REC, _PER_STOP, _PER_CONTACT, _OWN, _OTHER = range(_ROWS, _ROWS + 7)
_ARRIVAL, _BEFORE, _AFTER, _X = range(_ROWS + 7, _ROWS + 11)
_WORK = _X + STATES
_WORK_SIZE = _WORK * LANES


def steps_per_sample(period_s: float) -> int:
    """Number of integration steps in one sample period [s]; by definition each is at most STEP_S long."""
    return max(1, math.ceil(period_s / STEP_S - 1e-9))


@_inline
def _joint(w, i, x, u):  # type: ignore[no-untyped-def]
    """Pressure rate [Pa/s], creep rate [1/s] and net torque [N m] of lane i at state x and set-point u [Pa]."""
    p, phi, omega, creep = x
    filling = min(max((u - p) * w[_PER_TAU, i], -w[_VENT, i]), w[_FILL, i])
    creeping = _creep_rate(p, creep, w[_P_MIN, i], w[_B1, i], w[_PER_T_EXT, i], w[_B0, i], w[_PER_T_REC, i])
    k, d, width, per_width = w[_K_STOP, i], w[_D_STOP, i], w[_W_STOP, i], w[_PER_STOP, i]
    net = (
        _torque(p, phi, creep, w[_A0, i], w[_A1, i], w[_A2, i], w[_A3, i], w[_PHI_MAX, i])
        - w[_D, i] * omega
        - w[_LOAD, i]
        - _one_sided(phi - w[_HIGH, i], omega, k, d, width, per_width)
        + _one_sided(w[_LOW, i] - phi, -omega, k, d, width, per_width)
        - _one_sided(
            phi - w[_CONTACT, i], omega, w[_K_CONTACT, i], w[_D_CONTACT, i], w[_W_CONTACT, i], w[_PER_CONTACT, i]
        )
    )
    return filling, creeping, net


@_inline
def _derivative(w, i, a, b, u_a, u_b):  # type: ignore[no-untyped-def]
    """Time derivatives of the states a and b of the coupled lanes i and i + HALF."""
    j = i + HALF
    filling_a, creeping_a, net_a = _joint(w, i, a, u_a)
    filling_b, creeping_b, net_b = _joint(w, j, b, u_b)
    return (
        (filling_a, a[OMEGA], w[_OWN, i] * net_a + w[_OTHER, i] * net_b, creeping_a),
        (filling_b, b[OMEGA], w[_OWN, j] * net_b + w[_OTHER, j] * net_a, creeping_b),
    )


@_inline
def _set_point(w, i, n):  # type: ignore[no-untyped-def]
    """Set-point [Pa] in force at lane i in step n of a sample."""
    arrived = min(max(n + 1.0 - w[_ARRIVAL, i], 0.0), 1.0)
    return w[_BEFORE, i] + arrived * (w[_AFTER, i] - w[_BEFORE, i])


@_inline
def _state(w, i):  # type: ignore[no-untyped-def]
    return w[_X + P, i], w[_X + PHI, i], w[_X + OMEGA, i], w[_X + CREEP, i]


@_inline
def _store(w, i, x):  # type: ignore[no-untyped-def]
    w[_X + P, i], w[_X + PHI, i], w[_X + OMEGA, i], w[_X + CREEP, i] = x


@_inline
def _along(x, h, k):  # type: ignore[no-untyped-def]
    """State x moved by h along the derivative k."""
    return x[P] + h * k[P], x[PHI] + h * k[PHI], x[OMEGA] + h * k[OMEGA], x[CREEP] + h * k[CREEP]


@_inline
def _mean(k1, k2, k3, k4):  # type: ignore[no-untyped-def]
    """The derivative of the classical Runge-Kutta step, times 6."""
    return (
        k1[P] + 2.0 * (k2[P] + k3[P]) + k4[P],
        k1[PHI] + 2.0 * (k2[PHI] + k3[PHI]) + k4[PHI],
        k1[OMEGA] + 2.0 * (k2[OMEGA] + k3[OMEGA]) + k4[OMEGA],
        k1[CREEP] + 2.0 * (k2[CREEP] + k3[CREEP]) + k4[CREEP],
    )


@_inline
def _step(w, n, h):  # type: ignore[no-untyped-def]
    """Advance every lane by one classical Runge-Kutta step of h [s], the n-th of its sample."""
    for i in range(HALF):
        j = i + HALF
        a, b = _state(w, i), _state(w, j)
        u_a, u_b = _set_point(w, i, n), _set_point(w, j, n)
        a1, b1 = _derivative(w, i, a, b, u_a, u_b)
        a2, b2 = _derivative(w, i, _along(a, 0.5 * h, a1), _along(b, 0.5 * h, b1), u_a, u_b)
        a3, b3 = _derivative(w, i, _along(a, 0.5 * h, a2), _along(b, 0.5 * h, b2), u_a, u_b)
        a4, b4 = _derivative(w, i, _along(a, h, a3), _along(b, h, b3), u_a, u_b)
        _store(w, i, _along(a, h / 6.0, _mean(a1, a2, a3, a4)))
        _store(w, j, _along(b, h / 6.0, _mean(b1, b2, b3, b4)))


@_inline
def _copy_rows(source, first, count, target, at):  # type: ignore[no-untyped-def]
    """Copy `count` rows of lanes from row `first` on (assigning slices would compile for seconds)."""
    for row in range(count):
        for i in range(LANES):
            target[at + row, i] = source[first + row, i]


@_inline
def _prepare(w, x, par):  # type: ignore[no-untyped-def]
    """Fill the working array with parameters, what follows from them, and the state."""
    _copy_rows(par, 0, _ROWS, w, 0)
    _copy_rows(x, 0, STATES, w, _X)
    for i in range(LANES):
        w[_PER_TAU, i] = 1.0 / par[_TAU, i]
        w[_PER_T_EXT, i] = 1.0 / par[_T_EXT, i]
        w[_PER_T_REC, i] = 1.0 / par[_T_REC, i]
        w[_PER_STOP, i] = 1.0 / par[_W_STOP, i]
        w[_PER_CONTACT, i] = 1.0 / par[_W_CONTACT, i]
    for i in range(HALF):
        j = i + HALF
        own, other, shared = par[_J, i], par[_J, j], par[_JC, i]
        # Written so that a lane without a partner does not depend on its neighbour, not even in rounding.
        w[_OWN, i], w[_OWN, j] = 1.0 / (own - shared * shared / other), 1.0 / (other - shared * shared / own)
        w[_OTHER, i] = w[_OTHER, j] = -shared / (own * other - shared * shared)


@_inline
def _deliver(w, history, head, steps, h):  # type: ignore[no-untyped-def]
    """Set which set-points reach each lane's valve in this sample, and when: dead time, cut to 0 ... supply."""
    for i in range(LANES):
        delay = w[_DEAD, i] / h
        samples = int(delay / steps)
        w[_ARRIVAL, i] = delay - samples * steps
        w[_AFTER, i] = min(max(history[(head - samples) % HISTORY, i], 0.0), w[_SUPPLY, i])
        w[_BEFORE, i] = min(max(history[(head - samples - 1) % HISTORY, i], 0.0), w[_SUPPLY, i])


# One block's samples: x, par, history, head, commands, steps, h, out -> head.
_BLOCK_SIGNATURE = "int64(f8[:,::1], f8[:,::1], f8[:,::1], int64, f8[:,::1], int64, f8, f8[:,:,::1])"


def _equations() -> str:
    """Numba's cache looks at changes of one file alone; this key makes it look at every equation."""
    names = ("joint", "lanes", "material", "kernel/plant_rows", "stack_rows", "statics")
    sources = [(Path(__file__).parent / f"{name}.py").read_bytes() for name in names]
    return hashlib.sha256(b"".join(sources)).hexdigest()


def _block_kernel() -> Any:
    """One block through all its samples: the only machine code of the plant.

    Cached by itself and loaded before whatever calls it: a copy optimised once more inside a caller, as a cached
    caller brings along, would round differently, and a result would depend on what was compiled when.
    """
    key = _equations()

    def advance_block(x, par, history, head, commands, steps, h, out):  # type: ignore[no-untyped-def]
        _ = key
        w = carray(stack_doubles(_WORK_SIZE), (_WORK, LANES))
        _prepare(w, x, par)
        for sample in range(commands.shape[0]):
            head = (head + 1) % HISTORY
            _copy_rows(commands, sample, 1, history, head)
            _deliver(w, history, head, steps, h)
            for n in range(steps):
                _step(w, n, h)
            _copy_rows(w, _X, STATES, out[sample], 0)
        _copy_rows(w, _X, STATES, x, 0)
        return head

    return njit(cache=True, fastmath=_FAST)(advance_block)


_advance_block = _block_kernel()


@cache
def _kernel(parallel: bool) -> Callable[..., None]:
    """The loop over blocks, compiled on first use and cached on disk."""
    key = f"{parallel} {_equations()}"  # or the two loops would share one cache entry
    _advance_block.compile(_BLOCK_SIGNATURE)

    def advance_blocks(x, par, history, heads, commands, steps, h, out):  # type: ignore[no-untyped-def]
        _ = key
        for block in prange(x.shape[0]):
            heads[block] = _advance_block(
                x[block], par[block], history[block], heads[block], commands[block], steps, h, out[block]
            )

    compiled: Callable[..., None] = njit(cache=True, parallel=parallel, fastmath=_FAST)(advance_blocks)
    return compiled


def advance(
    x: NDArray[np.float64],
    par: NDArray[np.float64],
    history: NDArray[np.float64],
    heads: NDArray[np.int64],
    commands: NDArray[np.float64],
    steps: int,
    h: float,
    out: NDArray[np.float64],
) -> None:
    """Advance blocks of joints by Eqs. 6 to 13 in place, in parallel where that pays, to the same result.

    x: (blocks, STATES, LANES) state.  par: (blocks, rows, LANES).  history: (blocks, HISTORY, LANES) set-points
    of the past samples, newest at heads[block].  commands: (blocks, samples, LANES) [Pa], each held for one sample.
    steps: steps a sample.  h: step [s].  out: (blocks, samples, STATES, LANES), the state at the end of each sample.
    All arrays are C-contiguous float64, heads int64.
    """
    blocks, samples, _ = commands.shape
    few = blocks == 1 or blocks * samples * steps < PARALLEL_STEPS
    _kernel(parallel=not few)(x, par, history, heads, commands, steps, h, out)


class Plant:
    """Many joints at once, advanced sample by sample: the state, the parameters and the dead-time memory."""

    def __init__(self, par: NDArray[np.float64], x: NDArray[np.float64], period_s: float) -> None:
        """Begin at x (blocks, STATES, LANES) with par (blocks, rows, LANES), vented, sampling every period_s [s]."""
        if not (math.isfinite(period_s) and period_s > 0.0):
            raise ValueError(f"period_s is {period_s!r}; it must be a positive number of seconds")
        self.par = np.ascontiguousarray(par)
        self.x = np.array(x, order="C")
        self.steps = steps_per_sample(period_s)
        self.h = period_s / self.steps
        self.history = np.zeros((len(self.par), HISTORY, LANES))
        self.heads = np.zeros(len(self.par), dtype=np.int64)
        longest = float(self.par[:, _DEAD].max())
        if longest > (HISTORY - 2) * period_s:
            raise ValueError(
                f"valve.dead_time_s is {longest:g}; at {1.0 / period_s:g} samples a second the allowed range is"
                f" 0 to {(HISTORY - 2) * period_s:g}"
            )

    def advance(self, commands: NDArray[np.float64]) -> NDArray[np.float64]:
        """Apply commands (blocks, samples, LANES) [Pa]; return states (blocks, samples, STATES, LANES)."""
        blocks, samples, _ = commands.shape
        out = np.empty((blocks, samples, STATES, LANES))
        advance(self.x, self.par, self.history, self.heads, commands, self.steps, self.h, out)
        return out
