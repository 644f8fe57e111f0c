"""The plant of the trial, with equations and an integrator of its own: the diagnosis must not recognise its own code.

Where a textbook has two forms of an equation, this plant uses the one that `hand_model` does not use: LuGre friction
(Canudas de Wit 1995), Bouc-Wen hysteresis (Wen 1976), creep of two Kelvin-Voigt modes, choked orifices with the smooth
ellipse of ISO 6358 for flow limits, a turbulent leak, a line of two volumes, a Hertzian obstacle, an exponential
spring, a smooth dead zone. The integrator is the semi-implicit Euler method at 0.1 ms, which is not that of
`hand_model`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from validation.trial.arrays import Array

PLAIN = (
    "delay", "lag", "fill", "vent", "a0", "a1", "a2", "a3", "reach", "p_min", "b1", "t_ext", "b0", "t_rec",
    "inertia", "drag", "coupling", "low", "high", "stop_k", "stop_d", "supply", "lever",
)  # fmt: skip
EFFECTS = (
    "droop", "droop_share", "lag_more", "delay_more", "band", "choke", "bouc_valve", "leak", "tube", "volume",
    "mode_1", "mode_2", "loop", "loop_scale", "expo", "age", "warm", "warm_tau", "lugre", "breakaway", "square_drag",
    "gap", "stop_at", "stop_soft", "weight", "weight_phase", "mass", "tendon", "wall_at", "wall_k", "wall_plain",
    "load", "eccentric", "eccentric_phase", "gain", "offset", "late", "p_gain", "p_offset",
    "shake", "shake_hz", "ripple", "wander", "chatter", "switch", "force_gain", "force_creep", "force_loop",
)  # fmt: skip
NAMES = (*PLAIN, *EFFECTS)
ROW = {name: index for index, name in enumerate(NAMES)}
"""Row of each parameter: the plain joint, then the effects, whose rows are 0 where the effect is absent."""

STEP_S = 1e-4
ROOM_PA = 101325.0
MEMORY = 4096
TURN_N = 0.3
"""Change of force after which the loop of a force sensor has turned around, except for 1/e."""

(
    DELAY, LAG, FILL, VENT, A0, A1, A2, A3, REACH, P_MIN, B1, T_EXT, B0, T_REC, INERTIA, DRAG, COUPLING, LOW, HIGH,
    STOP_K, STOP_D, SUPPLY, LEVER, DROOP, DROOP_SHARE, LAG_MORE, DELAY_MORE, BAND, CHOKE, BOUC, LEAK, TUBE, VOLUME,
    MODE_1, MODE_2, LOOP, LOOP_SCALE, EXPO, AGE, WARM, WARM_TAU, LUGRE, BREAKAWAY, SQUARE, GAP, STOP_AT, STOP_SOFT,
    WEIGHT, PHASE, MASS, TENDON, WALL_AT, WALL_K, WALL_PLAIN, LOAD, ECC, ECC_PHASE, GAIN, OFFSET, LATE, P_GAIN,
    P_OFFSET, SHAKE, SHAKE_HZ, RIPPLE, WANDER, CHATTER, SWITCH, F_GAIN, F_CREEP, F_LOOP,
) = range(len(NAMES))  # fmt: skip
assert ROW["force_loop"] == F_LOOP
_MODE_TAU = (8.0, 45.0)


@njit(cache=True, inline="always")
def _spring(depth, k, width):  # type: ignore[no-untyped-def]
    """Torque of a stop at a depth [rad]; its stiffness k [N m/rad] grows over the first `width` [rad]."""
    if depth <= 0.0:
        return 0.0
    return k * depth * depth / (2.0 * width) if depth < width else k * (depth - 0.5 * width)


@njit(cache=True)
def simulate(q, u, frame_s, step_s, start_phi, partner, neighbour, wander, out):  # type: ignore[no-untyped-def]
    """Write readings of pressure [Pa], angle [rad], speed [rad/s] and force [N] to out (4, frames, joints).

    q: parameters (rows, joints).  u: set-points (frames, joints) [Pa], constant between two frames.  start_phi: angles
    (joints,) [rad].  partner, neighbour: (joints,) columns, -1 for no partner.  wander: (frames,) random process of
    unit size.
    """
    frames, joints = u.shape
    steps = int(round(frame_s / step_s))  # noqa: RUF046 - in compiled code round gives a float
    h = frame_s / steps
    p, line_1, line_2 = np.zeros(joints), np.zeros(joints), np.zeros(joints)
    phi, om, acc = start_phi.copy(), np.zeros(joints), np.zeros(joints)
    creep, m1, m2 = np.zeros(joints), np.zeros(joints), np.zeros(joints)
    bristle, loop, zv, warm = np.zeros(joints), np.zeros(joints), np.zeros(joints), np.zeros(joints)
    link, read_1, read_2 = start_phi.copy(), start_phi.copy(), start_phi.copy()
    pad, pad_peak, pushed, turned = np.zeros(joints), np.zeros(joints), np.zeros(joints), np.zeros(joints)
    u_last, rise = np.zeros(joints), np.zeros(joints)
    past = np.zeros((MEMORY, joints))
    reservoir, n = 1.0, 0
    for k in range(frames):
        t = k * frame_s
        for i in range(joints):
            out[0, k, i] = (1.0 + q[P_GAIN, i]) * p[i] + q[P_OFFSET, i]
            shown = read_2[i] if q[LATE, i] > 0.0 else (link[i] if q[GAP, i] > 0.0 else phi[i])
            wobble = q[ECC, i] * (math.sin(2.0 * shown + q[ECC_PHASE, i]) + 0.3 * math.sin(shown))
            out[1, k, i] = (1.0 + q[GAIN, i]) * shown + q[OFFSET, i] + wobble
            out[2, k, i] = om[i]
            out[3, k, i] = pad[i]
        for _ in range(steps):
            drawn = 0.0
            for i in range(joints):
                drawn += max(rise[i], 0.0)
            reservoir += h * ((1.0 - reservoir) / 0.3 - q[DROOP, 0] * drawn / q[SUPPLY, 0])
            n += 1
            for i in range(joints):
                past[n % MEMORY, i] = u[k, i]
                back = int(round((q[DELAY, i] + q[DELAY_MORE, i]) / h))  # noqa: RUF046 - as above
                want = past[(n - back) % MEMORY, i] if n > back else 0.0
                want = min(want, q[SUPPLY, i]) * (1.0 - q[DROOP_SHARE, i] * (1.0 - reservoir))
                if q[BOUC, i] > 0.0:
                    du = want - u_last[i]
                    width = q[BOUC, i]
                    zv[i] += du * (1.0 - abs(zv[i] / width) * (1.0 if du * zv[i] > 0.0 else 0.0))
                    zv[i] = min(max(zv[i], -width), width)
                    u_last[i] = want
                    want -= zv[i]
                error = want - p[i]
                if q[BAND, i] > 0.0:
                    error -= q[BAND, i] * math.tanh(error / q[BAND, i])
                tau = q[LAG, i] + q[LAG_MORE, i] * (1.0 if error > 0.0 else 1.1)
                rate = min(max(error / tau, -q[VENT, i]), q[FILL, i])
                if q[CHOKE, i] > 0.0:
                    high, here = q[SUPPLY, i] + ROOM_PA, p[i] + ROOM_PA
                    r_in, r_out = min(here / high, 1.0), ROOM_PA / max(here, ROOM_PA)
                    fill = q[CHOKE, i] * high * math.sqrt(max(1.0 - max((r_in - 0.35) / 0.65, 0.0) ** 2, 0.0))
                    vent = q[CHOKE, i] * here * math.sqrt(max(1.0 - max((r_out - 0.35) / 0.65, 0.0) ** 2, 0.0))
                    rate = min(max(rate, -vent), fill)
                rate -= q[LEAK, i] * math.sqrt(max(p[i], 0.0) * 1.0e5)
                if q[VOLUME, i] > 0.0:
                    v = 2.0e-6 + 1.2e-12 * p[i] + (q[A2, i] + 0.5 * q[A3, i] * phi[i]) * phi[i]
                    rate -= q[VOLUME, i] * 1.2 * (p[i] + ROOM_PA) * (q[A2, i] + q[A3, i] * phi[i]) * om[i] / v
                if q[CHATTER, i] > 0.0:
                    swing = 2.0 * math.pi * 6.0
                    rate += q[CHATTER, i] * swing * math.cos(swing * t) * (1.0 if p[i] > 1e4 else 0.0)
                rise[i] = rate
                p[i] = max(p[i] + h * rate, -2e4)
                line_1[i] += h * (p[i] - line_1[i]) / max(0.5 * q[TUBE, i], h)
                line_2[i] += h * (line_1[i] - line_2[i]) / max(0.5 * q[TUBE, i], h)
                inner = line_2[i] if q[TUBE, i] > 0.0 else p[i]
                up = (q[B1, i] * (inner - q[P_MIN, i]) - creep[i]) / q[T_EXT, i]
                down = (q[B0, i] * inner - creep[i]) / q[T_REC, i]
                creep[i] += h * (max(up, 0.0) + min(down, 0.0))
                m1[i] += h * (inner / 5e5 - m1[i]) / _MODE_TAU[0]
                m2[i] += h * (inner / 5e5 - m2[i]) / _MODE_TAU[1]
                warm[i] += h * (1.0 - warm[i]) / max(q[WARM_TAU, i], 1.0)
                eased = creep[i] * q[REACH, i] + q[MODE_1, i] * m1[i] + q[MODE_2, i] * m2[i]
                a1 = q[A1, i] * (1.0 + q[AGE, i] * t * (1.0 + 0.002 * t))
                if q[SWITCH, i] != 0.0 and math.sin(0.9 * t + 1.3 * math.sin(0.37 * t)) > 0.2:
                    a1 *= 1.0 + q[SWITCH, i]
                torque = q[A0, i] + a1 * (phi[i] - eased) + (q[A2, i] + q[A3, i] * phi[i]) * inner
                torque += q[WARM, i] * warm[i]
                torque -= q[EXPO, i] * (math.exp(phi[i] / 0.7) - 1.0 - phi[i] / 0.7)
                if q[LOOP, i] > 0.0:
                    turn = 1.0 if om[i] * loop[i] > 0.0 else 0.0
                    loop[i] += h * om[i] / q[LOOP_SCALE, i] * (1.0 - turn * loop[i] * loop[i])
                    torque -= q[LOOP, i] * loop[i]
                if q[LUGRE, i] > 0.0:
                    sigma = q[LUGRE, i] / 0.002
                    level = q[LUGRE, i] + q[BREAKAWAY, i] * math.exp(-((om[i] / 0.1) ** 2))
                    slide = (om[i] - sigma * abs(om[i]) / level * bristle[i]) / (1.0 + h * sigma * abs(om[i]) / level)
                    bristle[i] += h * slide
                    torque -= sigma * bristle[i] + 0.02 * math.sqrt(sigma * q[INERTIA, i]) * slide
                torque -= q[SQUARE, i] * om[i] * abs(om[i])
                torque -= q[WEIGHT, i] * math.sin(phi[i] + q[PHASE, i])
                torque -= q[TENDON, i] * math.sin(phi[neighbour[i]] - phi[i] * 0.3)
                torque -= q[LOAD, i]
                wall = max(phi[i] - q[WALL_AT, i], 0.0)
                push = q[WALL_K, i] * wall * math.sqrt(wall * 20.0) * (1.0 + 0.3 * om[i])
                if q[WALL_PLAIN, i] > 0.0:
                    push = _spring(phi[i] - q[WALL_AT, i], q[WALL_K, i], 0.0175)
                torque -= push
                torque += q[SHAKE, i] * math.sin(2.0 * math.pi * q[SHAKE_HZ, i] * t)
                torque += q[RIPPLE, i] * math.sin(14.0 * phi[i])
                torque += q[WANDER, i] * wander[k]
                top = min(q[HIGH, i], q[STOP_AT, i])
                k_stop = q[STOP_SOFT, i] if q[STOP_AT, i] < q[HIGH, i] else q[STOP_K, i]
                above, below = phi[i] - top, q[LOW, i] - phi[i]
                torque -= _spring(above, k_stop, 0.0175) * (1.0 + q[STOP_D, i] / k_stop * om[i])
                torque += _spring(below, q[STOP_K, i], 0.0175) * (1.0 - q[STOP_D, i] / q[STOP_K, i] * om[i])
                if partner[i] >= 0:
                    torque -= q[COUPLING, i] * acc[partner[i]]
                mass = q[INERTIA, i] + q[MASS, i]
                before = om[i]
                om[i] = (om[i] + h * torque / mass) / (1.0 + h * q[DRAG, i] / mass)
                phi[i] += h * om[i]
                acc[i] += 0.2 * ((om[i] - before) / h - acc[i])
                slack = phi[i] - link[i]
                half = 0.5 * q[GAP, i]
                if abs(slack) > half:
                    link[i] += (slack - (half if slack > 0.0 else -half)) * min(h / 0.002, 1.0)
                seen = link[i] if q[GAP, i] > 0.0 else phi[i]
                if q[LATE, i] > 0.0:
                    read_1[i] += h * (seen - read_1[i]) / (0.5 * q[LATE, i] + h)
                    read_2[i] += h * (read_1[i] - read_2[i]) / (0.5 * q[LATE, i] + h)
                force = push / q[LEVER, i]
                pad_peak[i] += h * (force - pad_peak[i]) / 12.0
                pad[i] = (1.0 + q[F_GAIN, i]) * force + q[F_CREEP, i] * pad_peak[i]
                if q[F_LOOP, i] > 0.0:
                    way = (force - pushed[i]) / TURN_N
                    turned[i] = (turned[i] + way) / (1.0 + abs(way))
                    pad[i] -= q[F_LOOP, i] * force * turned[i]
                pushed[i] = force
            t += h


def record(
    q: Array,
    u: Array,
    frame_s: float,
    partner: NDArray[np.int64],
    neighbour: NDArray[np.int64],
    *,
    wander: Array,
    step_s: float = STEP_S,
) -> Array:
    """Readings (4, frames, joints) without noise: pressure [Pa], angle [rad], speed [rad/s], force [N].

    The vented joints begin at their rest angles.  q: (rows, joints).  u: set-points (frames, joints) [Pa].  partner,
    neighbour: (joints,) columns.  wander: (frames,) random process of unit size.
    """
    out = np.empty((4, *u.shape))
    rest_angle = np.clip(-q[A0] / q[A1], q[LOW], q[HIGH])
    simulate(q, u, frame_s, step_s, rest_angle, partner, neighbour, wander, out)
    return out
