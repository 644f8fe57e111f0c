"""Many joints at once, with equations and an integrator of their own, for benches of the controller.

Nothing is shared with `hand_model`. The valve has a dead time and one lag; the map and its creep are Eqs. 6 and 11-13
of Martin et al. 2004; friction is that of Canudas de Wit et al. 1995; an obstacle is a spring with a small damper.
Semi-implicit Euler steps of 0.1 ms. The two joints of a finger share an inertia.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hand_model.arrays import Array
from hand_model.description import Hand

STEP_S = 1e-4
NAMES = {
    "delay": "valve.dead_time_s", "lag": "valve.time_constant_s",
    "a0": "statics.a0_nm", "a1": "statics.a1_nm_per_rad", "a2": "statics.a2_nm_per_pa",
    "a3": "statics.a3_nm_per_pa_rad", "inertia": "dynamics.inertia_kg_m2",
    "drag": "dynamics.viscous_friction_nm_s_per_rad",
    "t_ext": "material.extension_time_s", "t_rec": "material.recovery_time_s",
    "reach": "material.phi_max_deg", "p_min": "material.p_min_pa", "b1": "material.b1_per_pa",
    "b0": "material.b0_per_pa", "coupling": "dynamics.coupling_inertia_kg_m2", "low": "end_stop.low_deg",
    "high": "end_stop.high_deg",
}  # fmt: skip
"""Rows of a plant that the description of the hand has, in SI units."""
DRAWN = ("delay", "lag", "a0", "a1", "a2", "a3", "inertia", "drag", "t_ext", "t_rec")
"""Rows that `draw` changes independently."""
ADDED = (
    "friction", "load", "wall_at", "wall_k", "weight", "attitude", "hole", "overlap", "skin", "rubber", "yielding",
    "liquid",
)  # fmt: skip
"""Rows without a number in the description: Coulomb friction [N m], load against flexion [N m], angle [rad] and
stiffness [N m/rad] of an obstacle; weight of the phalanx [N m] and the angle [rad] at which it hangs; share of the
absolute pressure [1/s] lost through a hole at sonic speed; pressure error [Pa] that a valve covers; stiffness of a skin
[N m/rad] to the neighbouring joint; torque of a rubber [N m] that hardens exponentially; shift of the rest angle
[rad] by retarded elasticity at supply pressure; growth of a chamber filled with a liquid [m^3/Pa], 0 for a gas."""
ROWS = (*NAMES, *ADDED)
Q = {name: row for row, name in enumerate(ROWS)}
(
    DELAY, LAG, A0, A1, A2, A3, INERTIA, DRAG, T_EXT, T_REC, REACH, P_MIN, B1, B0, COUPLING, LOW, HIGH,
    FRICTION, LOAD, WALL_AT, WALL_K, WEIGHT, ATTITUDE, HOLE, OVERLAP, SKIN, RUBBER, YIELDING, LIQUID,
) = range(len(ROWS))  # fmt: skip
STATES = ("p", "phi", "speed", "creep", "bristle", "torque", "wall", "fast", "slow")
P, PHI, SPEED, CREEP, BRISTLE, TORQUE, WALL, FAST, SLOW = range(len(STATES))
FAST_S, SLOW_S = 0.7, 6.0
"""Retardation times of the rows FAST and SLOW, pressures that follow the pressure."""
RUBBER_RAD, SKIN_RAD = math.radians(30.0), math.radians(60.0)
ROOM_PA = 101325.0
BRISTLE_RAD, STOP_NM_PER_RAD, WALL_DAMPING_S, MEMORY = math.radians(0.1), 5.0, 2e-4, 1024
STICTION, STRIBECK_RAD_S = 1.5, 0.1
"""Friction at rest over that of motion [-], and the speed over which it falls."""
REACH_PA, REACH_RAD = 5.0e5, math.radians(80.0)
SUPPLY_PA = 6.0e5


def nominal(hand: Hand, hands: int) -> Array:
    """Plants (ROWS, hands * joints), SI, with the numbers of the description, and nothing added."""
    q = np.zeros((len(ROWS), hands * len(hand.joints)))
    for name, key in NAMES.items():
        q[Q[name]] = np.tile(hand.row(key), hands)
    q[WALL_AT] = math.inf
    return q


def draw(hand: Hand, hands: int, error: float, rng: np.random.Generator) -> Array:
    """Plants (ROWS, hands * joints) whose DRAWN rows have uniform relative errors of at most `error` [-].

    A joint that needs more than REACH_PA to hold REACH_RAD is drawn again: its supply does not reach there.
    """
    exact = nominal(hand, hands)
    q, todo = exact.copy(), np.ones(exact.shape[1], dtype=np.bool_)
    while todo.any():
        for name in DRAWN:
            factor = rng.uniform(1.0 - error, 1.0 + error, len(todo))
            q[Q[name]] = np.where(todo, exact[Q[name]] * factor, q[Q[name]])
        leverage = q[A2] + q[A3] * REACH_RAD
        todo = (leverage <= 0.0) | (-(q[A0] + q[A1] * REACH_RAD) > REACH_PA * leverage)
    share = q[INERTIA] / exact[INERTIA]
    other = np.where((partner := partners(hand, hands)) >= 0, share[partner], 1.0)
    q[COUPLING] *= np.sqrt(share * other)  # a kinetic energy stays positive
    return q


def partners(hand: Hand, hands: int) -> NDArray[np.int64]:
    """Columns (n,) of the coupled joints of many hands side by side, -1 for none."""
    joints = len(hand.joints)
    first = np.repeat(np.arange(hands) * joints, joints)
    return np.where(np.tile(hand.partner, hands) >= 0, np.tile(hand.partner, hands) + first, -1).astype(np.int64)


@njit(cache=True)
def _lost(p, hole):  # type: ignore[no-untyped-def]
    """Pressure lost in a second [Pa/s]: flow at sonic speed above 0.9 bar, and below as an ellipse (ISO 6358)."""
    if hole <= 0.0 or p <= 0.0:
        return 0.0
    ratio = ROOM_PA / (p + ROOM_PA)
    part = 1.0 if ratio < 0.528 else math.sqrt(max(1.0 - ((ratio - 0.528) / 0.472) ** 2, 0.0))
    return hole * (p + ROOM_PA) * part


@njit(cache=True)
def _advance(q, s, past, count, u, partner, neighbour, steps):  # type: ignore[no-untyped-def]
    h = STEP_S
    for _ in range(steps):
        count += 1
        for i in range(s.shape[1]):
            past[count % MEMORY, i] = u[i]
            want = past[(count - round(q[DELAY, i] / h)) % MEMORY, i]
            leverage = q[A2, i] + q[A3, i] * s[PHI, i]
            error = min(max(want, 0.0), SUPPLY_PA) - s[P, i]
            if q[OVERLAP, i] > 0.0:  # a rounded edge: the valve sees the error less its covered part
                error -= q[OVERLAP, i] * math.tanh(error / q[OVERLAP, i])
            s[P, i] += h * (error / q[LAG, i] - _lost(s[P, i], q[HOLE, i]))
            p, phi, w = s[P, i], s[PHI, i], s[SPEED, i]
            if q[LIQUID, i] > 0.0:  # what moves in place of the piston raises or lowers the pressure at once
                s[P, i] -= h * leverage * w / (q[LIQUID, i] * (1.0 + 0.3 * p / SUPPLY_PA))
            up = (q[B1, i] * (p - q[P_MIN, i]) - s[CREEP, i]) / q[T_EXT, i]
            down = (q[B0, i] * p - s[CREEP, i]) / q[T_REC, i]
            s[CREEP, i] += h * (max(up, 0.0) + min(down, 0.0))
            s[FAST, i] += h * (p - s[FAST, i]) / FAST_S
            s[SLOW, i] += h * (p - s[SLOW, i]) / SLOW_S
            rest = s[CREEP, i] * q[REACH, i] + 0.5 * q[YIELDING, i] * (s[FAST, i] + s[SLOW, i]) / SUPPLY_PA
            torque = q[A0, i] + q[A1, i] * (phi - rest) + leverage * p - q[LOAD, i]
            torque -= q[WEIGHT, i] * math.sin(phi - q[ATTITUDE, i])
            if q[RUBBER, i] != 0.0:
                x = phi / RUBBER_RAD
                torque -= q[RUBBER, i] * (math.exp(x) - 1.0 - x)
            if q[SKIN, i] != 0.0:
                torque += q[SKIN, i] * SKIN_RAD * math.tanh((s[PHI, neighbour[i]] - phi) / SKIN_RAD)
            if q[FRICTION, i] > 0.0:
                z = s[BRISTLE, i]
                level = 1.0 + (STICTION - 1.0) * math.exp(-((w / STRIBECK_RAD_S) ** 2))
                z += h * (w - abs(w) * z / (BRISTLE_RAD * level))
                s[BRISTLE, i] = min(max(z, -STICTION * BRISTLE_RAD), STICTION * BRISTLE_RAD)
                torque -= q[FRICTION, i] * s[BRISTLE, i] / BRISTLE_RAD
            depth = phi - q[WALL_AT, i]
            s[WALL, i] = max(q[WALL_K, i] * (depth + WALL_DAMPING_S * w), 0.0) if depth > 0.0 else 0.0
            torque -= s[WALL, i]
            torque -= STOP_NM_PER_RAD * (max(phi - q[HIGH, i], 0.0) - max(q[LOW, i] - phi, 0.0))
            s[TORQUE, i] = torque - q[DRAG, i] * w
        for i in range(s.shape[1]):
            own, other = q[INERTIA, i] + h * q[DRAG, i], partner[i]
            a = s[TORQUE, i] / own
            if other >= 0:  # the two equations of a finger's accelerations, solved together
                mass, c = q[INERTIA, other] + h * q[DRAG, other], q[COUPLING, i]
                a = (mass * s[TORQUE, i] - c * s[TORQUE, other]) / (own * mass - c * c)
            s[SPEED, i] += h * a
            s[PHI, i] += h * s[SPEED, i]
    return count


class RoughPlants:
    """Joints (n,) at rest without pressure; `state` (STATES, n) in SI units, WALL the torque on the obstacle [N m]."""

    def __init__(self, q: Array, partner: NDArray[np.int64], period_s: float) -> None:
        """Begin at the rest angle with plants q (ROWS, n); partner (n,): column of the coupled joint, or -1."""
        self._q, self._partner = q, partner
        self._neighbour = np.where(partner >= 0, partner, np.maximum(np.arange(len(partner)) - 1, 0))
        self._steps, self._count = round(period_s / STEP_S), MEMORY
        self.state = np.zeros((len(STATES), q.shape[1]))
        self.state[PHI] = np.clip(-q[A0] / q[A1], q[LOW], q[HIGH])
        self._past = np.zeros((MEMORY, q.shape[1]))

    def advance(self, command_pa: Array) -> None:
        """Apply the commands (n,) [Pa] for one period."""
        args = self._q, self.state, self._past, self._count, command_pa, self._partner, self._neighbour, self._steps
        self._count = _advance(*args)
