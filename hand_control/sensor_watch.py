"""Sensors that contradict the motion: angles that step, freeze, or have the wrong sign or place; exchanged pressures.

A plausible number alone is not believed. Four tests, all in elapsed time but for the run of equal readings, and where
frames come too rarely for them, the hand is not driven on (WARN_S, UNCHECKED_S):

    test          what no motion gives                                               finds
    step          a break of the angle without the momentum that a real one leaves   mirrored, negated, exchanged and
                  behind (DEV, TRAVEL below)                                         displaced angles, in motion
    passivity     a joint moved by an outside torque above MAX_OUTSIDE_NM            what the others have missed
    first motion  after arming where the wrong sign explains pose and speed better,  a sign that was wrong before
                  a motion against the one that the pressure asks for
    channel       equal readings in motion; an angle beyond an end stop              frozen, far off

Passivity. The environment gives energy only through pushes of at most MAX_OUTSIDE_NM, and by what an elastic obstacle
has stored, while the pressure falls or after the joint was thrown into it. Each torque of Eq. 6 may be wrong by WRONG.
Contacts and friction never count.

First motion. The measured pressure drives Eqs. 6 and 8, quasi-static, with nominal constants; until the joint has
followed, its set-point rises slowly. A sensor cannot change its sign without a step, so that the joint is not suspected
again. Two angles that were exchanged before arming make no step; the place watch asks the joints.

While a test is undecided, no set-point exceeds the one from before; the first rise of each joint is slow. References:
Brogliato, Nonsmooth Mechanics, 2016 (restitution); Willems, Dissipative dynamical systems, 1972 (passivity).
"""

from __future__ import annotations

import math

import numpy as np

from hand_control import sensor_rows as row
from hand_control.declared import inlined
from hand_control.place_watch import (
    ALIKE,
    ENOUGH_S,
    NONE,
    RECENT_S,
    PlaceWatch,
    begin_again,
    check_places,
    following,
    hold_places,
    open_again,
)
from hand_control.place_watch import ROWS as PLACE_ROWS
from hand_control.sensor_lines import Contradiction, describe
from hand_control.step_watch import (
    ACTIVE,
    ANGLES_SWAPPED,
    BEYOND,
    FINE,
    FROZEN,
    LEAST_RAD,
    LONGEST_S,
    MAX_OUTSIDE_NM,
    MOMENTUM_S,
    PAUSE_S,
    PRESSURES_SWAPPED,
    SIGN,
    SPACING_S,
    UNCHECKED,
    UNDECIDED,
    WRONG,
    sample,
    steps,
)
from hand_model.arrays import Array
from hand_model.compile_cache import without_arrays
from hand_model.description import Hand
from hand_model.statics import torque

FROZEN_FRAMES, HELD_FRAMES, FROZEN_RAD_PER_S, FAST_NOISES = 14, 3, 0.05, 3.0
"""Bit-identical angles of a joint that moved at this speed. A channel repeats at most one in ten readings by chance at
any rate, so that many in a row are seen less often than once in a million hours. No set-point rises from the third on,
and from the first on of a joint that moves by FAST_NOISES times its mean second difference in a frame: none repeats."""
STOP_NM, BEYOND_RAD, BEYOND_S = 0.2, math.radians(1.5), 0.01
"""A joint is beyond its lower stop by more than this torque presses it and this angle, or by twice that beyond the
upper one, for longer than a glitch."""
LONGEST_LAG_S = 10.0
"""Drag is at least what stops a joint in this time: dry friction may be all that a described joint has."""
WARN_S, UNCHECKED_S, GAP_COUNTS_S, INTERVAL_S = 0.2, 1.0, 0.1, 0.2
"""Without a complete check for WARN_S no set-point rises, and a warning says so; after UNCHECKED_S the hand vents. A
gap counts as GAP_COUNTS_S at most: after this time set-points are no longer in force. INTERVAL_S: of the mean of the
times between frames."""
SPEED_S, SLOW_S, ACTIVE_RAD_PER_S, ACTIVE_S = 0.01, 0.1, 0.3, 0.04
POSE_NM = 0.012
"""Torque that pose and speed may leave unexplained by the pressure at arming: an error of the model, friction."""
PROVEN_RAD = math.radians(2.0)
"""A sign is proven, or refuted for ENOUGH_S, by a motion of PROVEN_RAD."""
OPPOSED = (0.45, 2.2)
"""Share of the predicted motion that is measured on a joint with the wrong sign whose constants are 30 % off."""
PRESSURE_S, LEAST_PA, UNEXPLAINED = 0.03, 1.2e4, 0.125
EXACT, EXACT_S, EXACT_PA = 0.005, 0.08, 4.0e3
"""Two pressures are exchanged where, for ENOUGH_S, the errors as exchanged are below UNEXPLAINED of those as wired,
and these exceed LEAST_PA and what motion displaces; or, for EXACT_S, below EXACT of them, and these exceed EXACT_PA.
What motion displaces is not for so long just what the set-points of both joints differ by, in opposite directions."""
ROWS = row.PLACES + PLACE_ROWS
"""Of the whole table."""
ELAPSED = 7
"""Of the spacing: time between the last two frames [s], after those between samples, and those of `_wait`."""
_KEYS = (
    "statics.a0_nm",
    "statics.a1_nm_per_rad",
    "statics.a2_nm_per_pa",
    "statics.a3_nm_per_pa_rad",
    "dynamics.inertia_kg_m2",
    "dynamics.viscous_friction_nm_s_per_rad",
    "dynamics.coupling_inertia_kg_m2",
    "end_stop.low_deg",
    "end_stop.high_deg",
)


@inlined
def _channel(s, c, i, phi, dt):  # type: ignore[no-untyped-def]
    """Verdict on bit-identical angles and on the end stops."""
    if phi != s[row.LAST, i]:
        s[row.RUN, i], s[row.RUN_SPEED, i] = 0.0, s[row.SPEED, i]
    else:
        s[row.RUN, i] += 1.0
    run = s[row.RUN, i] if abs(s[row.RUN_SPEED, i]) > FROZEN_RAD_PER_S else 0.0
    s[row.SPEED, i] += dt / (dt + SPEED_S) * ((phi - s[row.LAST, i]) / dt - s[row.SPEED, i])
    s[row.LAST, i] = phi
    s[row.PAUSE, i] = max(s[row.PAUSE, i] - dt, 0.0)
    fast = abs(s[row.RUN_SPEED, i]) * dt > FAST_NOISES * s[row.NOISE, i]
    s[row.HOLD, i] = 1.0 if run >= (1 if fast else HELD_FRAMES) or s[row.PAUSE, i] > 0.0 else 0.0
    if run >= FROZEN_FRAMES:
        return FROZEN
    beyond = phi < c[row.LOW, i] - c[row.PRESSED, i] or phi > c[row.HIGH, i] + 2.0 * c[row.PRESSED, i]
    s[row.OUT_S, i] = s[row.OUT_S, i] + dt if beyond else 0.0
    return BEYOND if s[row.OUT_S, i] > max(BEYOND_S, 1.5 * dt) else FINE


@inlined
def _outside(s, c, i, phi, p):  # type: ignore[no-untyped-def]
    """Outside torque on joint i at angle phi [rad] and pressure p [Pa], and by how much it may be wrong [N m]."""
    a1, a2, a3, d, v = c[row.A1, i], c[row.A2, i], c[row.A3, i], c[row.D, i], s[row.SPEED, i]
    terms = abs(c[row.A0, i]) + abs(a1 * phi) + (abs(a2) + abs(a3 * phi)) * p + d * abs(v)
    return d * v - torque(p, phi, 0.0, c[row.A0, i], a1, a2, a3, 0.0), WRONG * terms


@inlined
def _is_active(s, c, i, phi, p, dt):  # type: ignore[no-untyped-def]
    """Whether joint i has moved for long enough with an outside torque beyond the largest one.

    An elastic obstacle gives back what it has stored: while the pressure falls, and after the joint has pressed into it
    with such a torque, as one does that its neighbour throws against it.
    """
    v = s[row.SPEED, i]
    s[row.P_SLOW, i] += dt / (dt + SLOW_S) * (p - s[row.P_SLOW, i])
    moves, work = abs(v) > ACTIVE_RAD_PER_S, math.inf
    for known in (p, s[row.DRIVE, i]):  # both ends of the time since the last frame
        outside, wrong = _outside(s, c, i, phi, known)
        given_back = outside < 0.0 and p < s[row.P_SLOW, i]
        moves = moves and not given_back and outside * v > 0.0 and abs(outside) > MAX_OUTSIDE_NM + wrong
        work = min(work, -outside * v * dt) if outside < -MAX_OUTSIDE_NM else -math.inf
    if work == -math.inf:
        s[row.STORED_J, i] *= SLOW_S / (dt + SLOW_S)
    else:
        s[row.STORED_J, i] = max(s[row.STORED_J, i] + work, 0.0)
    s[row.ACTIVE_S, i] = s[row.ACTIVE_S, i] + dt if moves and s[row.STORED_J, i] <= 0.0 else 0.0
    return s[row.ACTIVE_S, i] > max(ACTIVE_S, 2.5 * dt)


@inlined
def _first_motion(s, c, i, phi, p, dt):  # type: ignore[no-untyped-def]
    """Advance the motion that the pressure asks of joint i, and what is known of its sign; whether it is wrong."""
    at, p = s[row.MODEL, i], 0.5 * (p + s[row.DRIVE, i]) if dt > MOMENTUM_S else p
    balance = torque(p, at, 0.0, c[row.A0, i], c[row.A1, i], c[row.A2, i], c[row.A3, i], 0.0) - s[row.BIAS, i]
    stiff = max(-c[row.A1, i] - c[row.A3, i] * p, 0.0)
    now = at + balance * dt / (c[row.D, i] + stiff * dt)
    s[row.MODEL, i] = min(max(now, c[row.LOW, i]), c[row.HIGH, i])
    kept = 1.0 - dt / (dt + RECENT_S)
    s[row.W, i] = kept * (s[row.W, i] + s[row.MODEL, i] - at)
    s[row.U, i] = kept * (s[row.U, i] + phi - s[row.FROM, i])
    s[row.FROM, i] = phi
    w, u = abs(s[row.W, i]), s[row.U, i] if s[row.W, i] > 0.0 else -s[row.U, i]
    if s[row.DOUBTED, i] == 0.0 or w < PROVEN_RAD:
        return False
    if ALIKE[0] * w < u < ALIKE[1] * w:
        s[row.DOUBTED, i] = 0.0
    opposed = -OPPOSED[1] * w < u < -OPPOSED[0] * w
    s[row.SIGN_S, i] = s[row.SIGN_S, i] + dt if opposed else 0.0
    return s[row.SIGN_S, i] > ENOUGH_S


@inlined
def _pressures(s, i, k, expected, wider, pressure, dt):  # type: ignore[no-untyped-def]
    """Whether the pressures of joints i and k are those that the set-points of the other one give."""
    share, least, surely = dt / (dt + PRESSURE_S), 2.0 * EXACT_PA**2, 2.0 * (LEAST_PA + max(wider[i], wider[k])) ** 2
    as_is = (pressure[i] - expected[i]) ** 2 + (pressure[k] - expected[k]) ** 2
    swapped = (pressure[i] - expected[k]) ** 2 + (pressure[k] - expected[i]) ** 2
    s[row.PE, i] += share * (as_is - s[row.PE, i])
    s[row.PX, i] += share * (swapped - s[row.PX, i])
    step = max(abs(pressure[i] - s[row.P_LAST, i]), abs(pressure[k] - s[row.P_LAST, k]))
    if step > LEAST_PA or abs(pressure[i] - pressure[k]) < 2.0 * LEAST_PA:
        s[row.P_PROVEN, i] = 0.0  # a sensor changes its place with a step only, or where the pressures are alike
    if s[row.PX, i] > surely and s[row.PE, i] < UNEXPLAINED * s[row.PX, i]:
        s[row.P_PROVEN, i] += dt
    may_be = s[row.P_PROVEN, i] < ENOUGH_S
    wrong = may_be and s[row.PE, i] > surely and s[row.PX, i] < UNEXPLAINED * s[row.PE, i]
    exact = may_be and s[row.PE, i] > least and s[row.PX, i] < EXACT * s[row.PE, i]
    s[row.PSWAP_S, i] = s[row.PSWAP_S, i] + dt if wrong else 0.0
    s[row.EXACT_S, i] = s[row.EXACT_S, i] + dt if exact else 0.0
    if wrong or exact:
        s[row.HOLD, i] = s[row.HOLD, k] = 1.0
    return s[row.PSWAP_S, i] > ENOUGH_S or s[row.EXACT_S, i] > EXACT_S


@without_arrays
def check_sensors(table, spacing, links, liquid, position, pressure, expected, wider, drive, dt):  # type: ignore[no-untyped-def]
    """Verdict, joint and other joint of a frame; updates the arrays of `SensorWatch.arrays` in place.

    position [rad], pressure, expected, wider, drive [Pa]: (joints,), see `SensorWatch.check`.  dt: [s].
    """
    n, verdict, joint, other = len(position), FINE, 0, -1
    s, c, places = table[: row.ROWS], table[row.ROWS : row.PLACES], table[row.PLACES :]
    partner, above, after = links[0], links[1], links[2]
    for i in range(n):
        found = _channel(s, c, i, position[i], dt)
        if found == FINE and _is_active(s, c, i, position[i], drive[i], dt):
            found = ACTIVE
        if _first_motion(s, c, i, position[i], drive[i], dt):
            found = SIGN
        if found != FINE:
            verdict, joint = found, i
    for i in range(n):
        k = above[i]
        if k >= 0 and not liquid and _pressures(s, i, k, expected, wider, pressure, dt):
            verdict, joint, other = PRESSURES_SWAPPED, i, k
    for i in range(n):
        s[row.P_LAST, i], s[row.DRIVE, i] = pressure[i], drive[i]
    pair = check_places(places, after, s[row.W], s[row.U], position, s[row.MODEL], dt)
    if pair != NONE and verdict == FINE:
        verdict, joint, other = ANGLES_SWAPPED, pair, after[pair]
    _wait(spacing, dt)
    spacing[4] += dt
    if spacing[4] >= SPACING_S and verdict == FINE:
        before, age, rare = sample(s, spacing, position, pressure, spacing[4])
        spacing[4] = 0.0
        if rare and spacing[6] > MOMENTUM_S:
            open_again(places, after)
        if age > 0.0:
            spacing[5] = 0.0
            verdict, joint, other = steps(s, c, partner, before, age, rare)
            if verdict == UNDECIDED:
                s[row.PAUSE, joint] = s[row.PAUSE, other] = PAUSE_S
                begin_again(places, after, joint, other, s[row.W], s[row.U])
                verdict, joint, other = FINE, 0, -1
    if verdict == FINE and spacing[5] > UNCHECKED_S:
        return UNCHECKED, 0, -1
    return verdict, joint, other


@inlined
def _wait(spacing, dt):  # type: ignore[no-untyped-def]
    """Count the time without a complete check, and the mean time between frames, dt [s] after the last one."""
    spacing[5] += dt
    spacing[6] += dt / (dt + INTERVAL_S) * (dt - spacing[6])


@without_arrays
def hold_sensors(table, spacing, command):  # type: ignore[no-untyped-def]
    """Limit the set-points of suspected joints in place to the last ones from before; whether one is lower now.

    Where the sensors are not checked, no set-point rises: one that fell does not return to where it was.

    table, spacing: the first of SensorWatch.arrays.  command: (joints,) [Pa].
    """
    s, limits, unchecked = table[: row.ROWS], False, spacing[5] > WARN_S
    for i in range(len(command)):
        if s[row.HOLD, i] > 0.0 or unchecked:
            limits |= command[i] > s[row.BELIEVED_PA, i]
            command[i] = min(command[i], s[row.BELIEVED_PA, i])
        if unchecked or s[row.HOLD, i] <= 0.0:
            s[row.BELIEVED_PA, i] = command[i]
    return hold_places(table[row.PLACES :], command, s[row.P_LAST], spacing[ELAPSED]) or limits


class SensorWatch:
    """Compares angles and pressures of one hand with its motion, frame by frame.

    arrays: the first arguments of `check_sensors`.  gap_s: longest time between frames [s] after which the tests go on.
    """

    def __init__(self, hand: Hand, memory: Array | None = None) -> None:
        """Begin without evidence; `start` gives a measurement. memory: (ROWS, joints), 0; None: an array of its own."""
        sensors = hand.sensors
        self._joints = hand.joints
        pressed = STOP_NM / hand.row("end_stop.stiffness_nm_per_rad") + hand.row("end_stop.engagement_deg")
        constants = np.array([*(hand.row(key) for key in _KEYS), 2.0 * sensors.hall.zero_rad, pressed + BEYOND_RAD])
        constants[row.D] = np.maximum(constants[row.D], constants[row.J] / LONGEST_LAG_S)
        table = np.zeros((ROWS, len(hand.joints))) if memory is None else memory
        self._state, self._constants = table[: row.ROWS], table[row.ROWS : row.PLACES]
        self._constants[:] = constants
        self._channels = (sensors.angle_channel, sensors.pressure_channel)
        self._places = PlaceWatch(following(sensors.angle_channel), table[row.PLACES :])
        self._spacing = np.zeros(ELAPSED + 1)
        self._period_s = 1.0 / hand.rate_hz
        self._liquid = bool(hand.row("hydraulic.share").max() > 0.0)
        links = np.array([hand.partner, following(sensors.pressure_channel), self._places.after], dtype=np.int64)
        self.arrays = (table, self._spacing, links, self._liquid)
        self._none = np.zeros(len(hand.joints))
        self.gap_s = LONGEST_S

    def start(self, position: Array, velocity: Array, pressure: Array) -> None:
        """Begin without evidence at position (n,) [rad], velocity (n,) [rad/s] and pressure (n,) [Pa].

        The joints may move: after a fault they are often armed again while they fall.
        """
        s, c = self._state, self._constants
        s[:] = 0.0
        self._restart(position, pressure)
        self._spacing[5:ELAPSED] = 0.0, self._period_s

        def balance(angle: Array) -> Array:
            nm: Array = np.asarray(torque(pressure, angle, 0.0, c[row.A0], c[row.A1], c[row.A2], c[row.A3], 0.0))
            return nm

        def unexplained(angle: Array, speed: Array) -> Array:
            # The first speed may be that of a step of the sensor: no more of it counts than the balance gives.
            nm = balance(angle)
            left: Array = nm - np.clip(c[row.D] * speed, np.minimum(nm, 0.0), np.maximum(nm, 0.0))
            return left

        mirrored, negated = c[row.MIRROR] - position, -position
        of_mirrored, of_negated = np.abs(unexplained(mirrored, -velocity)), np.abs(unexplained(negated, -velocity))
        as_measured = np.abs(balance(position) - c[row.D] * velocity)
        other = np.where(of_mirrored < of_negated, mirrored, negated)
        doubted = (as_measured > POSE_NM) & (np.minimum(of_mirrored, of_negated) < as_measured)
        s[row.DOUBTED], s[row.NOISE] = doubted, LEAST_RAD
        s[row.MODEL] = np.clip(np.where(doubted, other, position), c[row.LOW], c[row.HIGH])
        s[row.BIAS] = np.clip(unexplained(s[row.MODEL], np.where(doubted, -velocity, velocity)), -POSE_NM, POSE_NM)
        s[row.BELIEVED_PA] = np.maximum(pressure, 0.0)
        self._places.start(pressure)

    def _restart(self, position: Array, pressure: Array) -> None:
        """Start the tests at rest; what was found is kept."""
        s = self._state
        s[[row.Z, row.A, row.B, row.C, row.X, row.LAST, row.FROM]] = position
        s[[row.P_LAST, row.P_SLOW, row.P_B, row.P_C, row.P_X, row.P_E, row.DRIVE]] = pressure
        zero = [row.RUN, row.RUN_SPEED, row.SPEED, row.OUT_S, row.ACTIVE_S, row.W, row.U, row.SIGN_S, row.PE, row.PX]
        s[[*zero, row.PSWAP_S, row.EXACT_S, row.STORED_J]] = 0.0
        self._spacing[:5] = (math.inf, math.inf, math.inf, math.inf, 0.0)

    def check(
        self,
        position: Array,
        pressure: Array,
        expected: Array,
        driven: Array,
        elapsed_s: float,
        wider: Array | None = None,
    ) -> Contradiction | None:
        """What contradicts the motion, elapsed_s [s] after the last frame; None where nothing does.

        position (n,) [rad], pressure (n,) [Pa]: measured, finite.  expected: (n,) [Pa], of set-points and motion.
        driven: (n,) [Pa], of the set-points alone; it counts where a liquid lets the motion itself change the pressure.
        wider: (n,) [Pa], by how much expected may be wrong by what the motion displaces; None: by nothing.
        """
        drive = driven if self._liquid else pressure
        if elapsed_s <= 0.0 or elapsed_s > self.gap_s:
            self._spacing[ELAPSED] = 0.0 if elapsed_s <= 0.0 else 3.0 * self._period_s
            if elapsed_s > 0.0:
                self._restart(position, drive)
                self._places.restart()
                _wait(self._spacing, min(elapsed_s, GAP_COUNTS_S))
            return self.contradiction(UNCHECKED, 0, -1) if self._spacing[5] > UNCHECKED_S else None
        self._spacing[ELAPSED] = elapsed_s
        wide = self._none if wider is None else wider
        found = check_sensors(*self.arrays, position, pressure, expected, wide, drive, elapsed_s)
        return self.contradiction(*found)

    def contradiction(self, verdict: int, joint: int, other: int) -> Contradiction | None:
        """What `check_sensors` has found; None where nothing contradicts the motion."""
        return None if verdict == FINE else Contradiction(verdict, joint, other, float(self._state[row.DEV, joint]))

    def hold(self, command: Array) -> bool:
        """Limit set-points (n,) [Pa] in place: none above the last one from before the present evidence.

        Returns whether one is lower now.
        """
        return bool(hold_sensors(*self.arrays[:2], command))

    @property
    def unchecked(self) -> str:
        """Why the sensors have not been checked for WARN_S and more; empty where they are."""
        return self._every(LONGEST_S) if self._spacing[5] > WARN_S else ""

    @property
    def checked_less(self) -> str:
        """Why the sensors are checked without a momentum, and set-points rise slowly; empty where one is seen."""
        return self._every(MOMENTUM_S) if self._spacing[6] > MOMENTUM_S else ""

    def _every(self, needed_s: float) -> str:
        return f"frames every {1e3 * self._spacing[6]:.0f} ms, checks need {1e3 * needed_s:.0f} ms"

    def line(self, found: Contradiction) -> str:
        """What was found: joints, channels, evidence and what to check."""
        return describe(found, self._joints, self._channels, f"{UNCHECKED_S:g} s: {self.unchecked}")
