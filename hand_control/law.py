"""The control law of every joint: discrete PID around a static-model feed-forward. Structure of arrays, numba.

The PID works in torque and the model turns torque into pressure, so that its gains mean the same at every angle:

    e   = phi_ref - phi                                                                   [rad]
    tau = Kp e + I + Kd (phi_ref' - phi'),   I' = Ki e                                    [N m]
    p   = p_hold(phi_ref) + T p_hold'(phi_ref) phi_ref' + (tau + d phi_ref') / (a2 + a3 phi_ref)

p_hold is the pressure at which Eq. 6 gives no torque at the reference; T, the valve's lag and dead time, leads a
moving reference by as much as the valve follows it late. The derivative acts on the measured speed, so a step
of the reference gives no kick. p is cut to 0 ... the lowest of the pressure limit and the torque ceiling, the
pressure at which Eq. 6 gives the maximum torque at the measured angle.

Anti-windup: the integrator stands still while p is cut and the error would drive it further into the limit; it
is bounded; it can be frozen. A joint whose measurement or reference is not finite keeps its last command, which
is finite: no non-finite number leaves the law.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hand_model.description import Hand
from hand_model.statics import pressure_for_torque, torque

Array = NDArray[np.float64]

A0, A1, A2, A3, LEAD, VISCOUS, KP, KI, KD, I_MAX, P_MAX, HIGH = range(12)
"""Rows of the gains."""
INTEGRAL, COMMAND = range(2)
"""Rows of the law's state: integral [N m], last command [Pa]."""
PRESSURE, TORQUE, SATURATED = range(3)
"""Rows of the output: pressure command [Pa], estimated torque [N m], 1 where cut."""
_MIN_LEVERAGE = 1e-9


@njit(cache=True, inline="always", error_model="numpy")
def _hold(reference, g, i):  # type: ignore[no-untyped-def]
    """Pressure [Pa] that holds a reference, its slope [Pa/rad] and the leverage there, from Eq. 6 with no torque."""
    phi = min(reference, g[HIGH, i])  # the description guarantees leverage up to the joint's limit
    leverage = max(g[A2, i] + g[A3, i] * phi, _MIN_LEVERAGE)
    slope = (g[A3, i] * g[A0, i] - g[A1, i] * g[A2, i]) / (leverage * leverage)
    return pressure_for_torque(0.0, phi, 0.0, g[A0, i], g[A1, i], g[A2, i], g[A3, i], 0.0), slope, leverage


@njit(cache=True, error_model="numpy")  # a division by zero gives what is not finite, and that is caught
def tick(g, state, reference, speed, limit, position, velocity, pressure, dt, integrate, out):  # type: ignore[no-untyped-def]
    """One tick of every joint.

    g: gains (12, n).  state: (2, n), changed.  reference [rad], speed [rad/s], limit [N m], position [rad],
    velocity [rad/s], pressure [Pa]: (n,).  dt: [s].  integrate: False freezes the integrators.  out: (3, n).
    """
    for i in range(g.shape[1]):
        phi = position[i]
        out[TORQUE, i] = torque(pressure[i], phi, 0.0, g[A0, i], g[A1, i], g[A2, i], g[A3, i], 0.0)
        error = reference[i] - phi
        hold, slope, leverage = _hold(reference[i], g, i)
        tau = g[KP, i] * error + state[INTEGRAL, i] + g[KD, i] * (speed[i] - velocity[i])
        wanted = hold + g[LEAD, i] * slope * speed[i] + (tau + g[VISCOUS, i] * speed[i]) / leverage
        at = min(phi, g[HIGH, i])
        ceiling = pressure_for_torque(limit[i], at, 0.0, g[A0, i], g[A1, i], g[A2, i], g[A3, i], 0.0)
        ceiling = min(max(ceiling, 0.0), g[P_MAX, i])
        if not math.isfinite(wanted + ceiling):
            out[PRESSURE, i] = state[COMMAND, i]
            out[SATURATED, i] = 0.0
            continue
        command = min(max(wanted, 0.0), ceiling)
        cut = wanted - command
        if integrate and cut * error <= 0.0:
            step = state[INTEGRAL, i] + g[KI, i] * error * dt
            state[INTEGRAL, i] = min(max(step, -g[I_MAX, i]), g[I_MAX, i])
        state[COMMAND, i] = command
        out[PRESSURE, i] = command
        out[SATURATED, i] = 1.0 if cut != 0.0 else 0.0


def gains(hand: Hand, kp: Array, ki: Array, kd: Array, i_max: Array) -> Array:
    """Gains (12, n) of a hand: PID gains per joint, (n,), beside its model."""
    g = np.empty((12, len(hand.joints)))
    for row, key in enumerate(("a0_nm", "a1_nm_per_rad", "a2_nm_per_pa", "a3_nm_per_pa_rad")):
        g[row] = hand.row(f"statics.{key}")
    g[LEAD] = hand.row("valve.time_constant_s") + hand.row("valve.dead_time_s")
    g[VISCOUS] = hand.row("dynamics.viscous_friction_nm_s_per_rad")
    g[KP], g[KI], g[KD], g[I_MAX] = kp, ki, kd, i_max
    g[P_MAX] = hand.limits.max_pressure_pa
    g[HIGH] = hand.limits.high_rad
    return g


class Law:
    """The law's memory between ticks: integrators and last commands of one hand."""

    def __init__(self, g: Array) -> None:
        """Begin released: no integral, no pressure."""
        self.gains = g
        self.state = np.zeros((2, g.shape[1]))
        self.out = np.zeros((3, g.shape[1]))

    def release(self) -> None:
        """Forget the past: integrators and commands to 0."""
        self.state[:] = 0.0

    def tick(
        self,
        reference: Array,
        speed: Array,
        limit: Array,
        position: Array,
        velocity: Array,
        pressure: Array,
        dt: float,
        integrate: bool = True,
    ) -> Array:
        """One tick, see `tick`; returns out (3, n), overwritten by the next."""
        tick(self.gains, self.state, reference, speed, limit, position, velocity, pressure, dt, integrate, self.out)
        return self.out
