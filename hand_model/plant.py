"""The plant kernel: valve, pressure, torque, creep and motion of many joints at a fixed step.

Per joint: the set-point passes a dead time and is cut to the supply; the pressure follows it by a first-order
lag with separate rate limits for fill and vent; the pressure makes torque by Eq. 11 with the creeping ratio of
Eq. 12; torque moves the phalanx by Eq. 8 against viscous friction, smooth end stops, an obstacle and a load.

Two phalanges of a finger share inertia. In relative joint angles the mass matrix of the pair is
[[J_p, J_c], [J_c, J_d]]: J_p with the distal joint locked, J_d the distal phalanx about its own joint, J_c the
coupling inertia, taken constant at its value in mid range. The distal joint's reaction on the proximal one is
therefore J_c times the distal acceleration; by virtual work the distal actuator's torque itself does no work
on the proximal angle. The thumb's opposition axis is perpendicular to its flexion axes and stays uncoupled.

Integrator: classical fourth-order Runge-Kutta, step at most STEP_S; the set-point is constant within a step
(a dead time that is no whole number of steps is the time-weighted mean of the two set-points it spans).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from hand_model.joint import one_sided
from hand_model.lanes import HALF, LANES
from hand_model.material import creep_rate
from hand_model.parameters import ROW
from hand_model.statics import torque

STEP_S = 0.5e-3
"""Largest integration step [s]."""
STATES = 4
P, PHI, OMEGA, CREEP = range(STATES)
"""Rows of a state array: pressure [Pa], angle [rad], speed [rad/s], creeping ratio."""
HISTORY = 128
"""Set-points kept for the dead time, one a step: 64 ms at the largest step."""

_FAST = {"contract", "nnan", "nsz"}
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


def steps_per_sample(period_s: float) -> int:
    """Number of integration steps in one sample period [s]; each is at most STEP_S long."""
    return max(1, math.ceil(period_s / STEP_S - 1e-9))


@njit(cache=True, fastmath=_FAST)
def _derivative(x, par, u, dx, net):  # type: ignore[no-untyped-def]
    """Fill dx (STATES, LANES) from x, parameters and set-points u (LANES,)."""
    for i in range(LANES):
        p, phi, omega, creep = x[P, i], x[PHI, i], x[OMEGA, i], x[CREEP, i]
        dx[P, i] = min(max((u[i] - p) / par[_TAU, i], -par[_VENT, i]), par[_FILL, i])
        dx[PHI, i] = omega
        dx[CREEP, i] = creep_rate(
            p, creep, par[_P_MIN, i], par[_B1, i], 1.0 / par[_T_EXT, i], par[_B0, i], 1.0 / par[_T_REC, i]
        )
        stop, damper, width = par[_K_STOP, i], par[_D_STOP, i], par[_W_STOP, i]
        net[i] = (
            torque(p, phi, creep, par[_A0, i], par[_A1, i], par[_A2, i], par[_A3, i], par[_PHI_MAX, i])
            - par[_D, i] * omega
            - par[_LOAD, i]
            - one_sided(phi - par[_HIGH, i], omega, stop, damper, width)
            + one_sided(par[_LOW, i] - phi, -omega, stop, damper, width)
            - one_sided(phi - par[_CONTACT, i], omega, par[_K_CONTACT, i], par[_D_CONTACT, i], par[_W_CONTACT, i])
        )
    for i in range(HALF):
        a, b, c = par[_J, i], par[_J, i + HALF], par[_JC, i]
        det = a * b - c * c
        dx[OMEGA, i] = (b * net[i] - c * net[i + HALF]) / det
        dx[OMEGA, i + HALF] = (a * net[i + HALF] - c * net[i]) / det


@njit(cache=True, fastmath=_FAST)
def _step(x, par, u, h, k1, k2, k3, k4, y, net):  # type: ignore[no-untyped-def]
    """Advance x (STATES, LANES) by one classical Runge-Kutta step of h [s]."""
    _derivative(x, par, u, k1, net)
    for s in range(STATES):
        for i in range(LANES):
            y[s, i] = x[s, i] + 0.5 * h * k1[s, i]
    _derivative(y, par, u, k2, net)
    for s in range(STATES):
        for i in range(LANES):
            y[s, i] = x[s, i] + 0.5 * h * k2[s, i]
    _derivative(y, par, u, k3, net)
    for s in range(STATES):
        for i in range(LANES):
            y[s, i] = x[s, i] + h * k3[s, i]
    _derivative(y, par, u, k4, net)
    for s in range(STATES):
        for i in range(LANES):
            x[s, i] += h / 6.0 * (k1[s, i] + 2.0 * k2[s, i] + 2.0 * k3[s, i] + k4[s, i])


@njit(cache=True, fastmath=_FAST)
def _delayed(history, head, par, h, u):  # type: ignore[no-untyped-def]
    """Set-points u (LANES,) in force now: delayed, then cut to 0 ... supply."""
    for i in range(LANES):
        delay = par[_DEAD, i] / h
        whole = int(delay)
        share = delay - whole
        now = history[(head - whole) % HISTORY, i]
        before = history[(head - whole - 1) % HISTORY, i]
        u[i] = min(max(now + share * (before - now), 0.0), par[_SUPPLY, i])


@njit(cache=True, fastmath=_FAST)
def _advance_block(x, par, history, head, commands, steps, h, out):  # type: ignore[no-untyped-def]
    """Advance one block through commands (samples, LANES); the state after each sample goes to out."""
    k1, k2, k3 = np.empty((STATES, LANES)), np.empty((STATES, LANES)), np.empty((STATES, LANES))
    k4, y = np.empty((STATES, LANES)), np.empty((STATES, LANES))
    net, u = np.empty(LANES), np.empty(LANES)
    for sample in range(commands.shape[0]):
        for _ in range(steps):
            head = (head + 1) % HISTORY
            history[head] = commands[sample]
            _delayed(history, head, par, h, u)
            _step(x, par, u, h, k1, k2, k3, k4, y, net)
        out[sample] = x
    return head


@njit(cache=True, parallel=True, fastmath=_FAST)
def advance(x, par, history, heads, commands, steps, h, out):  # type: ignore[no-untyped-def]
    """Advance blocks of joints in parallel, in place.

    x: (blocks, STATES, LANES) state.  par: (blocks, rows, LANES).  history: (blocks, HISTORY, LANES) set-points
    of the past steps, newest at heads[block].  commands: (blocks, samples, LANES) [Pa], each held for one sample.
    steps: steps a sample.  h: step [s].  out: (blocks, samples, STATES, LANES), the state at the end of each sample.
    """
    for block in prange(x.shape[0]):
        heads[block] = _advance_block(
            x[block], par[block], history[block], heads[block], commands[block], steps, h, out[block]
        )


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
        if longest / self.h > HISTORY - 2:
            raise ValueError(f"valve.dead_time_s {longest} exceeds {(HISTORY - 2) * self.h:.4f} s at this sample rate")

    def advance(self, commands: NDArray[np.float64]) -> NDArray[np.float64]:
        """Apply commands (blocks, samples, LANES) [Pa]; return states (blocks, samples, STATES, LANES)."""
        blocks, samples, _ = commands.shape
        out = np.empty((blocks, samples, STATES, LANES))
        advance(self.x, self.par, self.history, self.heads, commands, self.steps, self.h, out)
        return out
