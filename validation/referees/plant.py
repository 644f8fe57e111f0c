"""A hand whose constitutive laws are tables, spectra and densities, so that any form can be drawn.

The equations that every hand of the description has (valve, Eqs. 6, 8, 11-13) are those of the trial's nominal model.
Each effect adds a law: a table over one state, weights over retardation times (Prony), weights over play radii
(Prandtl-Ishlinskii), or a few numbers. Nothing is shared with `hand_model`. Semi-implicit Euler; the joints of a hand
are computed together. Two sets of laws, one up to a frame and one from there on, let an effect begin or end.

Laws and their sources: flow of orifices, ISO 6358-1:2013; sums of plays, Krasnosel'skii and Pokrovskii 1989; Prony
spectra, Tschoegl 1989; friction, Dahl 1968 and Canudas de Wit 1995; polytropic chambers, Beater 2007.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray

from validation.trial.arrays import Array
from validation.trial.plant import PLAIN

POINTS, MODES, PLAYS, MEMORY = 129, 6, 8, 4096
FRAME_S = 0.005
TABLES: dict[str, tuple[float, float]] = {
    "valve_slope": (-4e5, 4e5),
    "fill_limit": (0.0, 6e5),
    "vent_limit": (0.0, 6e5),
    "leak": (0.0, 6e5),
    "tube": (-3e5, 3e5),
    "spring": (-0.3, 2.2),
    "spring_p": (-0.3, 2.2),
    "friction": (0.0, 1.0),
    "drag": (-1.0, 1.0),
    "stop": (0.0, 0.6),
    "wall": (0.0, 0.6),
    "weight": (-1.0, 3.0),
    "tendon": (-2.0, 2.0),
    "sensor": (-0.3, 2.2),
    "sensor_p": (0.0, 6e5),
    "ageing": (0.0, 1.0),
    "warming": (0.0, 1.0),
    "ripple": (-0.3, 2.2),
    "held": (-0.3, 2.2),
}
"""Laws that are tables, and the range of the state of each [SI]; outside, the end values hold.

valve_slope: Pa/s over the error.  fill_limit, vent_limit: Pa/s over the pressure.  leak: Pa/s over the pressure.
tube: Pa/s over the difference.  spring, spring_p: N m and N m/Pa over the angle.  friction: N m over the share
v / (v + FRICTION_SPEED) of the speed.  drag: N m over v / (|v| + DRAG_SPEED).  stop, wall: N m over the depth [rad].
weight: N m over the angle.  tendon: N m over the angle of the neighbour less one's own.  sensor: rad over the angle.
sensor_p: Pa over the pressure.  ageing: relative stiffness over the share of AGE or of TRAVEL.  warming: N m over the
warmth.  ripple, held: N m over the angle.
"""
NUMBERS = (
    "lag_pole", "lag_damping", "delay", "valve_own", "limits_own", "tube_own", "gas", "gas_volume", "gas_per_pa",
    "gas_dead", "bristle", "bristle_power", "bristle_damping", "friction_load", "gap_up", "gap_down", "gap_s",
    "gap_slope", "stop_at", "stop_damping", "wall_at", "wall_damping", "inertia", "load", "late", "late_damping",
    "age_by_use", "warm_s", "warm_by_work", "warm_by_pressure", "turn_hz", "turn_rad", "loop_by_pressure", "bouc",
    "bouc_scale", "bouc_power", "bouc_lean", "sag", "sag_volume", "sag_flow", "sag_start",
)  # fmt: skip
"""Laws that are numbers; 0 switches each off."""
C = {name: k for k, name in enumerate(NUMBERS)}
T = {name: k for k, name in enumerate(TABLES)}
FRICTION_SPEED, DRAG_SPEED = 0.3, 5.0
AGE_S, TRAVEL_RAD = 60.0, 60.0
WORK_W, ROOM_PA = 0.05, 101325.0
WANDER, EVENT, CROSS = range(3)
"""Added torques of what no catalogue holds: a random process, a schedule over time, another joint's state."""
(
    LAG_POLE, LAG_DAMPING, DELAY_MORE, VALVE_OWN, LIMITS_OWN, TUBE_OWN, GAS, GAS_V, GAS_PA, GAS_DEAD, BRISTLE,
    BR_POWER, BR_DAMP, FR_LOAD, GAP_UP, GAP_DOWN, GAP_S, GAP_SLOPE, STOP_AT, STOP_DAMP, WALL_AT, WALL_DAMP,
    INERTIA_MORE, LOAD, LATE, LATE_DAMP, BY_USE, WARM_S, BY_WORK, BY_PA, TURN_HZ, TURN_RAD, LOOP_PA, BOUC, BOUC_SCALE,
    BOUC_POWER, BOUC_LEAN, SAG, SAG_V, SAG_FLOW, SAG_START,
) = range(len(NUMBERS))  # fmt: skip
assert C["sag_start"] == SAG_START
(
    SLOPE, FILLS, VENTS, LEAKS, TUBE, SPRING, SPRING_P, FRICTION, DRAGS, STOP, WALL, WEIGHT, TENDON, SENSOR, SENSOR_P,
    AGEING, WARMING, RIPPLE, HELD,
) = range(len(TABLES))  # fmt: skip
assert T["held"] == HELD
_RANGES = np.array(list(TABLES.values()))
(
    DELAY, LAG, FILL, VENT, A0, A1, A2, A3, REACH, P_MIN, B1, T_EXT, B0, T_REC, INERTIA, DRAG, COUPLING, LOW, HIGH,
    STOP_K, STOP_D, SUPPLY, LEVER,
) = range(len(PLAIN))  # fmt: skip


@dataclass(slots=True)
class Laws:
    """All laws of a hand of n joints; as made, all are neutral.

    number (NUMBERS, n), table (TABLES, n, POINTS).  prony (2, MODES, n): weights [rad/Pa] and retardation times [s].
    valve_plays (2, PLAYS, n): weights [-] and radii [Pa].  loops (2, PLAYS, n): stiffnesses [N m/rad] and radii [rad].
    added (3, frames, n): torques [N m], by WANDER, EVENT, CROSS; CROSS is a gain [N m/rad] on the neighbour's angle.
    """

    joints: int
    frames: int
    number: Array = field(init=False)
    table: Array = field(init=False)
    prony: Array = field(init=False)
    valve_plays: Array = field(init=False)
    loops: Array = field(init=False)
    added: Array = field(init=False)

    def __post_init__(self) -> None:
        """Begin with neutral laws."""
        n = self.joints
        self.number, self.table = np.zeros((len(NUMBERS), n)), np.zeros((len(TABLES), n, POINTS))
        self.prony, self.valve_plays, self.loops = (np.ones((2, k, n)) for k in (MODES, PLAYS, PLAYS))
        for part in (self.prony, self.valve_plays, self.loops):
            part[0] = 0.0
        self.added = np.zeros((3, self.frames, n))
        self.number[C["stop_at"]] = self.number[C["wall_at"]] = 99.0

    def tabulate(self, name: str, joint: int, law: object) -> None:
        """Set the table of a joint from a function of its state (POINTS,)."""
        self.table[T[name], joint] = law(states(name))  # type: ignore[operator]

    def arrays(self) -> tuple[Array, ...]:
        """The arrays in the order of `simulate`."""
        return self.number, self.table, self.prony, self.valve_plays, self.loops, self.added

    def copy(self) -> Laws:
        """A copy that shares nothing."""
        out = Laws(self.joints, self.frames)
        for mine, other in zip(self.arrays(), out.arrays(), strict=True):
            other[:] = mine
        return out


def states(name: str) -> Array:
    """The states (POINTS,) of a table."""
    low, high = TABLES[name]
    return np.linspace(low, high, POINTS)


@njit(cache=True)
def _at(table, k, i, x):  # type: ignore[no-untyped-def]
    """Value of table k of joint i at the state x, linear between the points."""
    low, high = _RANGES[k, 0], _RANGES[k, 1]
    place = min(max((x - low) / (high - low), 0.0), 1.0) * (POINTS - 1)
    left = min(int(place), POINTS - 2)
    share = place - left
    return (1.0 - share) * table[k, i, left] + share * table[k, i, left + 1]


@njit(cache=True)
def _wall(depth, k, width):  # type: ignore[no-untyped-def]
    if depth <= 0.0:
        return 0.0
    return k * depth * depth / (2.0 * width) if depth < width else k * (depth - 0.5 * width)


@njit(cache=True)
def _pole(x, v, goal, wh, damping, h):  # type: ignore[no-untyped-def]
    """Speed of a pair of poles, w h from the pole and the step, after an implicit step."""
    return (v + wh * wh / h * (goal - x)) / (1.0 + 2.0 * damping * wh + wh * wh)


@njit(cache=True)
def _rate(q, c, tab, i, want, p, phi, om):  # type: ignore[no-untyped-def]
    """Rate of the pressure [Pa/s] of joint i: valve, limits of its flow, leak, and the motion (Eq. 7)."""
    error = want - p
    rate = _at(tab, SLOPE, i, error) if c[VALVE_OWN, i] > 0.0 else error / q[LAG, i]
    rate = min(max(rate, -q[VENT, i]), q[FILL, i])
    if c[LIMITS_OWN, i] > 0.0:
        rate = min(max(rate, -_at(tab, VENTS, i, p)), _at(tab, FILLS, i, p))
    rate -= _at(tab, LEAKS, i, p)
    if c[GAS, i] > 0.0:
        swept = q[A2, i] + q[A3, i] * phi
        volume = c[GAS_V, i] + c[GAS_PA, i] * p + (q[A2, i] + 0.5 * q[A3, i] * phi) * phi
        rate -= c[GAS, i] * (p + ROOM_PA) * swept * om / (max(volume, 0.2 * c[GAS_V, i]) + c[GAS_DEAD, i])
    return rate


@njit(cache=True)
def _plays(state, weights, i, x):  # type: ignore[no-untyped-def]
    """Sum of the play operators of joint i (Prandtl-Ishlinskii) at the input x: what the input loses."""
    total = 0.0
    for m in range(PLAYS):
        w, r = weights[0, m, i], weights[1, m, i]
        if w != 0.0:
            state[m, i] = min(max(state[m, i], x - r), x + r)
            total += w * (x - state[m, i])
    return total


@njit(cache=True)
def _dissipated(q, c, tab, z, loop, i, p, om, h):  # type: ignore[no-untyped-def]
    """Torque [N m] of sliding friction with a bristle, of drag and of a Bouc-Wen loop."""
    torque = -_at(tab, DRAGS, i, om / (abs(om) + DRAG_SPEED))
    if c[BRISTLE, i] > 0.0:
        level = max(_at(tab, FRICTION, i, abs(om) / (abs(om) + FRICTION_SPEED)) * (1.0 + c[FR_LOAD, i] * p), 1e-9)
        stiff = level / c[BRISTLE, i]
        ratio = min(abs(z[0, i]) / c[BRISTLE, i], 1.0)
        slides = ratio ** c[BR_POWER, i] if om * z[0, i] > 0.0 else 0.0
        slip = om * (1.0 - slides)
        z[0, i] = min(max(z[0, i] + h * slip, -c[BRISTLE, i]), c[BRISTLE, i])
        torque -= stiff * z[0, i] + c[BR_DAMP, i] * slip
    if c[BOUC, i] > 0.0:
        turn = c[BOUC_LEAN, i] + (1.0 - c[BOUC_LEAN, i]) * (1.0 if om * loop[i] > 0.0 else -1.0)
        loop[i] += h * om / c[BOUC_SCALE, i] * (1.0 - turn * abs(loop[i]) ** c[BOUC_POWER, i])
        loop[i] = min(max(loop[i], -1.5), 1.5)
        torque -= c[BOUC, i] * (1.0 + c[LOOP_PA, i] * p) * loop[i]
    return torque


@njit(cache=True)
def simulate(q, before, after, since, u, frame_s, step_s, start, partner, neighbour, out):  # type: ignore[no-untyped-def]
    """Write pressure [Pa], angle [rad], speed [rad/s] and force on an obstacle [N] to out (4, frames, joints).

    q: (PLAIN, joints).  before, after: arrays of Laws up to the frame `since` and from there.  u: set-points [Pa]
    (frames, joints).  start: angles (joints,) [rad].  partner, neighbour: (joints,) columns, -1 for no partner.
    """
    frames, n = u.shape
    steps = int(round(frame_s / step_s))  # noqa: RUF046 - in compiled code round gives a float
    h = frame_s / steps
    p, inner, filtered, speed_f = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    phi, om, acc, creep, warm = start.copy(), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    modes, vplay, play = np.zeros((MODES, n)), np.zeros((PLAYS, n)), np.zeros((PLAYS, n))
    for m in range(PLAYS):
        play[m] = start
    z, loop, link, seen, seen_v = np.zeros((1, n)), np.zeros(n), start.copy(), start.copy(), np.zeros(n)
    travel, shown, rise, push = np.zeros(n), start.copy(), np.zeros(n), np.zeros(n)
    past = np.zeros((MEMORY, n))
    tank, pumping, count = 1.0, True, 0
    for k in range(frames):
        number, tab, prony, valve_plays, loops, added = after if k >= since else before
        t = k * frame_s
        for i in range(n):
            out[0, k, i] = p[i] + _at(tab, SENSOR_P, i, p[i])
            out[1, k, i] = shown[i] + _at(tab, SENSOR, i, shown[i])
            out[2, k, i], out[3, k, i] = om[i], push[i] / q[LEVER, i]
        for _ in range(steps):
            t += h
            count += 1
            sag = 0.0
            if number[SAG, 0] > 0.0:
                drawn = 0.0
                for i in range(n):
                    drawn += max(rise[i], 0.0)
                pumping = tank < number[SAG_START, 0] or (pumping and tank < 1.0)
                tank += h * ((number[SAG_FLOW, 0] if pumping else 0.0) - drawn / number[SAG_V, 0])
                tank = min(max(tank, 0.0), 1.0)
                sag = number[SAG, 0] * (1.0 - tank)
            for i in range(n):
                past[count % MEMORY, i] = u[k, i]
                back = int(round((q[DELAY, i] + number[DELAY_MORE, i]) / h))  # noqa: RUF046 - as above
                want = past[(count - back) % MEMORY, i] if count > back else 0.0
                want = min(want, q[SUPPLY, i] * (1.0 - sag)) * (1.0 - 0.5 * sag)
                want -= _plays(vplay, valve_plays, i, want)
                if number[LAG_POLE, i] > 0.0:
                    speed_f[i] = _pole(
                        filtered[i], speed_f[i], want, number[LAG_POLE, i] * h, number[LAG_DAMPING, i], h
                    )
                    filtered[i] += h * speed_f[i]
                    want = max(filtered[i], 0.0)
                rise[i] = _rate(q, number, tab, i, want, p[i], phi[i], om[i])
                p[i] = max(p[i] + h * rise[i], -2e4)
                if number[TUBE_OWN, i] > 0.0:
                    flow = _at(tab, TUBE, i, p[i] - inner[i])
                    least = min(p[i] - inner[i], 0.0)
                    inner[i] += min(max(h * flow, least), max(p[i] - inner[i], 0.0))
                else:
                    inner[i] = p[i]
                torque = _torque(q, number, tab, prony, i, inner[i], phi[i], creep, modes, h)
                torque -= _plays(play, loops, i, phi[i]) * (1.0 + number[LOOP_PA, i] * inner[i])
                aged = travel[i] / TRAVEL_RAD if number[BY_USE, i] > 0.0 else t / AGE_S
                torque += q[A1, i] * phi[i] * _at(tab, AGEING, i, aged)
                heat = 1.0
                if number[BY_WORK, i] > 0.0:
                    heat = min(abs(torque * om[i]) / WORK_W, 3.0)
                elif number[BY_PA, i] > 0.0:
                    heat = inner[i] / 2e5
                warm[i] += h * (heat - warm[i]) / max(number[WARM_S, i], 1.0)
                torque += _at(tab, WARMING, i, warm[i])
                torque += _dissipated(q, number, tab, z, loop, i, inner[i], om[i], h)
                turned = number[TURN_RAD, i] * math.sin(2.0 * math.pi * number[TURN_HZ, i] * t)
                torque -= _at(tab, WEIGHT, i, phi[i] + turned)
                torque -= _at(tab, TENDON, i, phi[neighbour[i]] - phi[i])
                torque += _at(tab, RIPPLE, i, phi[i]) - number[LOAD, i]
                torque += added[WANDER, k, i] + added[EVENT, k, i] + added[CROSS, k, i] * phi[neighbour[i]]
                push[i] = _at(tab, WALL, i, phi[i] - number[WALL_AT, i]) if phi[i] > number[WALL_AT, i] else 0.0
                push[i] *= max(1.0 + number[WALL_DAMP, i] * om[i], 0.0)
                torque -= push[i]
                if phi[i] > number[STOP_AT, i]:
                    torque -= _at(tab, STOP, i, phi[i] - number[STOP_AT, i]) * max(
                        1.0 + number[STOP_DAMP, i] * om[i], 0.0
                    )
                above, below = phi[i] - q[HIGH, i], q[LOW, i] - phi[i]
                torque -= _wall(above, q[STOP_K, i], 0.0175) * (1.0 + q[STOP_D, i] / q[STOP_K, i] * om[i])
                torque += _wall(below, q[STOP_K, i], 0.0175) * (1.0 - q[STOP_D, i] / q[STOP_K, i] * om[i])
                if partner[i] >= 0:
                    torque -= q[COUPLING, i] * acc[partner[i]]
                mass, last = q[INERTIA, i] + number[INERTIA_MORE, i], om[i]
                om[i] = (om[i] + h * torque / mass) / (1.0 + h * q[DRAG, i] / mass)
                phi[i] += h * om[i]
                travel[i] += h * abs(om[i])
                acc[i] += 0.2 * ((om[i] - last) / h - acc[i])
                shown[i] = phi[i]
                if number[GAP_S, i] > 0.0:
                    slack = phi[i] - link[i]
                    free = min(max(slack, -number[GAP_DOWN, i]), number[GAP_UP, i])
                    link[i] += (slack - free) * min(h / number[GAP_S, i], 1.0) + number[GAP_SLOPE, i] * h * om[i]
                    shown[i] = link[i]
                if number[LATE, i] > 0.0:
                    seen_v[i] = _pole(seen[i], seen_v[i], shown[i], h / number[LATE, i], number[LATE_DAMP, i], h)
                    seen[i] += h * seen_v[i]
                    shown[i] = seen[i]


@njit(cache=True)
def _torque(q, c, tab, prony, i, p, phi, creep, modes, h):  # type: ignore[no-untyped-def]
    """Torque [N m] of the actuator: Eq. 6 with creep (Eqs. 11-13), a spectrum of retardations, and springs."""
    up = (q[B1, i] * (p - q[P_MIN, i]) - creep[i]) / q[T_EXT, i]
    down = (q[B0, i] * p - creep[i]) / q[T_REC, i]
    creep[i] += h * (max(up, 0.0) + min(down, 0.0))
    eased = creep[i] * q[REACH, i]
    for m in range(MODES):
        if prony[0, m, i] != 0.0:
            modes[m, i] += h * (p - modes[m, i]) / prony[1, m, i]
            eased += prony[0, m, i] * modes[m, i]
    torque = q[A0, i] + q[A1, i] * (phi - eased) + (q[A2, i] + q[A3, i] * phi) * p
    return torque - _at(tab, SPRING, i, phi) - _at(tab, SPRING_P, i, phi) * p - _at(tab, HELD, i, phi)


def record(
    q: Array,
    laws: tuple[Laws, Laws],
    u: Array,
    frame_s: float,
    partner: NDArray[np.int64],
    neighbour: NDArray[np.int64],
    *,
    since: int = 0,
    step_s: float = 1e-4,
) -> Array:
    """Readings (4, frames, joints) without noise, in SI; see `simulate`. The vented joints begin at rest."""
    out = np.empty((4, *u.shape))
    rest = np.clip(-q[A0] / q[A1], q[LOW], q[HIGH])
    before, after = (part.arrays() for part in laws)
    simulate(q[: len(PLAIN)], before, after, since, u, frame_s, step_s, rest, partner, neighbour, out)
    return out
