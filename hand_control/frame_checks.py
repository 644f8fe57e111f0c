"""What the controller checks of every frame: plausible values, and pressures that follow.

Pressures that differ from what the set-points ask for:

    what                                                         reaction
    above the limit by more than OVER, for OVER_S                vent, latched
    a step that no valve gives and that stays, STEP_S            vent, latched: a sensor that is exchanged or at another
                                                                 scale, a tube that is off
    steeper than the valve gives in the first rise, STEEP_S      vent, latched: a sensor at another scale
    above what the model of the valve expects, NOT_FOLLOWING_S   vent, latched: the joint cannot be released otherwise
    below it                                                     no set-point rises; after SHORT_S a warning, the
                                                                 integrator of the joint stops, and no set-point is
                                                                 above TRUSTED times the pressure and TRUSTED_PA, until
                                                                 the pressure follows again: a leak, an empty supply or
                                                                 a closed valve gives less than commanded

Far off counts sooner, by the time integral of what exceeds the band: NOT_FOLLOWING_PA_S, and SHORT_S times BAND_PA.
The expectation is the set-point through the kernel's valve, whose time constant is lengthened by the dead time, from
the pressure measured at first, or through a valve SLOWER times as slow, or anything between the two. Motion displaces
fluid and changes the pressure (Eq. 7): the kernel's equation for the described fluid belongs to the expectation, and
what may be wrong with it widens the band, through the lag of the valve: UNCERTAIN of what a liquid does. Where the
description does not say that there is a liquid, motion does something from nothing to what a liquid does, always
against the change of volume: a joint that falls explains a pressure that is too high and none that is too low. After
GAP_S without a frame, in which the board may have vented, the expectation starts again.

A liquid that a shove pulls below the range of its sensor makes a frame count as missing, for SUCTION_S.
An angle may change by the largest jump within JUMP_S, and by FASTEST_RAD_PER_S over the time beyond, at any frame rate.
"""

from __future__ import annotations

import math

import numpy as np

from hand_control.declared import inlined
from hand_model.arrays import Array
from hand_model.compile_cache import without_arrays
from hand_model.description import Hand
from hand_model.effects.effect import ANGLE, SPEED
from hand_model.effects.gas_compression import pressure_source as gas_rate
from hand_model.effects.hydraulic import pressure_source as liquid_rate
from hand_model.kernel.step import valve_pressure

FINE, NOT_FINITE, JUMPED = range(3)
"""Verdicts of `implausible`."""
OVER = 0.1
"""Share of the pressure limit by which a pressure may exceed it."""
OVER_S = 0.05
NOT_FOLLOWING_S, NOT_FOLLOWING_PA_S = 0.5, 5.0e3
BAND_PA = 2.0e4
BAND = 0.1
"""A pressure follows within BAND_PA plus BAND times the expected pressure."""
FOLLOWING, OVER_PRESSURE, STEPPED, STEEP_RISE, STUCK_HIGH, STUCK_LOW = range(6)
"""Verdicts of `PressureWatch`, the most urgent first after FOLLOWING."""
STEP_PA, STEP_LAGS, STEP_S, DRIVE_S = 2.0e4, 2.0, 0.008, 0.02
LEAST_STEP_PA, NOISES, NOISE_S, STEP_SHARE = 4.0e3, 8.0, 1.0, 0.25
CALM_S, CALM_FRAME_S = 0.05, 0.012
"""A step changes the difference to the expectation between two frames by STEP_PA and STEP_LAGS times what the valve
gives, lately, plus what the motion displaces. Half of it is still there after STEP_S: a spike is none. A dead time
delays what the valve gives, and after a gap of more than CALM_FRAME_S the set-points in force are not known: the board
vents by itself where it has got none.
A smaller step counts where it changes the pressure by STEP_SHARE, as another scale or another sensor does, and exceeds
LEAST_STEP_PA and NOISES times the mean second difference of NOISE_S; what the motion displaces then counts by its
change between two frames. Frames have come every CALM_FRAME_S for CALM_S."""
USUAL_S, USUAL_PA = 1.0, 8.0e3
"""A pressure is too low, too, where it falls below its usual difference to the expectation by USUAL_PA plus BAND, and
below the expectation by USUAL_PA: after a long release the usual difference is that of a slow valve, and it is kept
while the pressure is too low."""
RETURN_PA_PER_S = 1.0e6
"""How fast a set-point rises after a pressure was too low, until it is held back no longer."""
SHORT_S, TRUSTED, TRUSTED_PA = 0.1, 2.0, 3e4
"""A pressure that has been too low for SHORT_S justifies set-points up to TRUSTED times itself and TRUSTED_PA."""
FASTEST_RAD_PER_S = 70.0
"""Speed that no joint exceeds, also when an obstacle lets it go: an angle may change by so much in a gap."""
JUMP_S = 0.0075
"""Time within which an angle may change by max_jump_deg: one and a half periods of 200 Hz, as stamps may jitter."""
GAP_S = 0.1
"""After a longer time between two frames the board may have vented: the expectation starts again."""
UNCERTAIN = 1.5
"""Share of the pressure by displaced liquid that may be wrong: volume and leverage 30 % off, twice the lag."""
STEEP, STEEP_PA, STEEP_S, LEAST_RISE_PA, FIRST_PA, MEAN_S = 1.45, 2.0e3, 0.03, 5.0e3, 5.0e4, 0.3
QUICKER = 0.5
"""A pressure is at another scale where, in the first rise after arming, up to FIRST_PA, it rises above its mean by
STEEP times what the valve gives, STEEP_PA and what motion displaces, for STEEP_S. Twice the lag makes it slower only; a
valve that is quicker by QUICKER of its lag leads by this share of the distance to the set-point. An offset is in the
mean; the expectation, which starts with it, falls to the set-point, and its mean with it at once. Means are over
MEAN_S, and a rise is at least LEAST_RISE_PA."""
SHALLOW, SHALLOW_PA, LEAST_SHALLOW_PA = 0.7, 3.0e3, 1.5e4
"""A pressure is too low, too, below the share SHALLOW of an expectation of LEAST_SHALLOW_PA and more, by SHALLOW_PA
and what motion displaces."""
SPEED_FILTER_S = 0.02
SLOWER = 2.0
"""A valve may lag behind by this factor more than described."""
EXPECTED, _OVER, _HIGH, _LOW, _ANGLE, _SPEED, WIDER, DRIVEN, _PRESSURE, _HELD_BACK, _SLOW = range(11)
_OFF, _STEP, _STEP_AGE, _BEFORE, _HIGH_PA_S, _LOW_PA_S, _BELIEVED, _USUAL, _BEHIND, _DRIVE, SHORT = range(11, 22)
_CHANGE, _TURNED, _LAST_TURN, _NOISE, _CALM, _LOWER, _HIGHER = range(22, 29)
_MEAN, _MEAN_EXPECTED, _MEAN_SLOW, _DOUBLE_S, _RISEN = range(29, 34)
"""Rows of the state of `watch_pressures`. _SLOW: the expectation of a valve that lags by SLOWER times the time. _OFF:
difference to the expectation; _BEFORE: before the _STEP that is watched; _USUAL: its mean over USUAL_S. _BELIEVED:
set-point before the pressure was too low. _BEHIND: whether the set-point is still to return to what is asked.
_DRIVE: largest change between two frames that the valve gives, of the last DRIVE_S. SHORT: 1 where the pressure is too
low for what is asked, or the set-point is still to return, so that an integrator would run away. _CHANGE, _LAST_TURN:
of _OFF and of the angle in the last frame; _TURNED: by how much the latter has changed; _NOISE: mean second difference
of _OFF; _CALM: time without a gap. _LOWER, _HIGHER: how much lower and higher displaced fluid may make the pressure;
WIDER: the larger one. _MEAN, _MEAN_EXPECTED, _MEAN_SLOW: means of the pressure and of both expectations over MEAN_S;
_DOUBLE_S: for how long the pressure has risen too steeply; _RISEN: whether the first rise is over."""
_ROWS, ROWS = 34, 51
"""Rows of the state, and with the constants of the valves."""
(
    _TAU, _VENT, _FILL, _A2, _A3, _LIQUID, _GROWTH, _EXPONENT, _VOLUME, _GAS_GROWTH, _GAS_GAIN, _GAS_PER_RAD, _SUPPLY,
    _LIMIT, _PER_TAU, _PER_VOLUME, _PER_SUPPLY,
) = range(17)  # fmt: skip
_FLUID = (
    "statics.a2_nm_per_pa",
    "statics.a3_nm_per_pa_rad",
    "hydraulic.share",
    "hydraulic.volume_m3_per_pa",
    "gas_compression.exponent",
    "gas_compression.volume_m3",
    "gas_compression.volume_m3_per_pa",
    "gas_compression.with_pressure",
    "gas_compression.gain_per_rad",
    "supply.pressure_pa",
)
assert (ANGLE, SPEED) == (4, 5)
SUCTION_S = 0.05
"""A shove may pull a liquid below what a pressure sensor reads, but no longer than this: then it is a broken sensor."""


def is_suction(position: Array, pressure: Array, elapsed_s: float) -> bool:
    """Whether a frame is to count as missing: position (n,) [rad] is measured, some pressure (n,) [Pa] is not.

    elapsed_s: [s] since the last frame that counted.  Only where the hand is filled with a liquid, and for SUCTION_S.
    """
    return 0.0 < elapsed_s <= SUCTION_S and bool(np.isfinite(position).all() > np.isfinite(pressure).all())


@without_arrays
def allowed_jump(max_jump, elapsed_s):  # type: ignore[no-untyped-def]
    """Largest plausible change of an angle [rad] over elapsed_s [s] between two frames; max_jump: within JUMP_S."""
    return max_jump + FASTEST_RAD_PER_S * max(elapsed_s - JUMP_S, 0.0)


@without_arrays
def implausible(position, velocity, pressure, last_position, max_jump):  # type: ignore[no-untyped-def]
    """Verdict and the joint it concerns: the first that is not finite, else the one with the largest jump.

    position and last_position [rad], velocity [rad/s], pressure [Pa]: (joints,).  max_jump: [rad] between frames.
    """
    worst, largest = 0, max_jump
    for j in range(len(position)):
        if not math.isfinite(position[j] + velocity[j] + pressure[j]):
            return NOT_FINITE, j
        jump = abs(position[j] - last_position[j])
        if jump > largest:
            worst, largest = j, jump
    return (JUMPED if largest > max_jump else FINE), worst


@inlined
def _displaced(v, i, p, angle, speed):  # type: ignore[no-untyped-def]
    """Pressure rate [Pa/s] of joint i by displaced fluid, and how much lower and higher it may be [Pa/s]; Eq. 7."""
    around = (0.0, 0.0, 0.0, 0.0, angle, speed, 0.0)
    a2, a3, growth = v[_A2, i], v[_A3, i], v[_GROWTH, i]
    full = liquid_rate((1.0, growth, a2, a3, v[_PER_VOLUME, i]), p, around)
    gas = 0.0
    if v[_EXPONENT, i] > 0.0:
        law = (v[_EXPONENT, i], v[_VOLUME, i], v[_GAS_GROWTH, i], v[_GAS_GAIN, i], v[_GAS_PER_RAD, i])
        # Without an exchange of heat, which would need memory: its share is 0.
        gas = gas_rate((*law, 0.0, 0.0, a2, a3, v[_SUPPLY, i], v[_PER_SUPPLY, i], 0.0), (0.0,), p, around)
    if v[_LIQUID, i] > 0.0:
        return full * v[_LIQUID, i] + gas, UNCERTAIN * abs(full), UNCERTAIN * abs(full)
    return gas, max(-full, gas, 0.0), max(full, -gas, 0.0)


@inlined
def _expect(s, v, i, u, angle, dt):  # type: ignore[no-untyped-def]
    """Advance the expected pressure of joint i by dt [s]; returns how far its band is below and above it [Pa]."""
    tau, per_tau = v[_TAU, i], v[_PER_TAU, i]
    rate, lower, higher = 0.0, 0.0, 0.0
    if dt > 0.0:
        share = dt / (dt + SPEED_FILTER_S)
        s[_SPEED, i] += share * ((angle - s[_ANGLE, i]) / dt - s[_SPEED, i])
        s[_ANGLE, i] = angle
        rate, lower, higher = _displaced(v, i, s[EXPECTED, i], angle, s[_SPEED, i])
    s[EXPECTED, i] = max(valve_pressure(s[EXPECTED, i], u, per_tau, v[_VENT, i], v[_FILL, i], dt) + rate * dt, 0.0)
    slow = valve_pressure(s[_SLOW, i], u, per_tau / SLOWER, v[_VENT, i], v[_FILL, i], dt)
    s[_SLOW, i] = max(slow + rate * dt, 0.0)
    if v[_LIQUID, i] > 0.0:
        s[DRIVEN, i] = valve_pressure(s[DRIVEN, i], u, per_tau, v[_VENT, i], v[_FILL, i], dt)
    share, band = dt / (dt + tau), BAND_PA + BAND * s[EXPECTED, i]
    s[_LOWER, i] += share * (lower * tau - s[_LOWER, i])
    s[_HIGHER, i] += share * (higher * tau - s[_HIGHER, i])
    s[WIDER, i] = max(s[_LOWER, i], s[_HIGHER, i])
    return band + s[_LOWER, i], band + s[_HIGHER, i]


@inlined
def _lasts(s, i, time, integral, excess, dt):  # type: ignore[no-untyped-def]
    """For how long [s] and by how much in all [Pa s] the pressure of joint i is outside its band, by excess [Pa]."""
    if excess > 0.0:
        s[time, i] += dt
        s[integral, i] += excess * dt
    else:
        s[time, i] = s[integral, i] = 0.0


@inlined
def _is_short(s, i):  # type: ignore[no-untyped-def]
    """Whether the pressure of joint i has been too low for long enough to be reported."""
    return s[_LOW, i] > SHORT_S or s[_LOW_PA_S, i] > SHORT_S * BAND_PA


@inlined
def _bend(s, i, change, turned, dt):  # type: ignore[no-untyped-def]
    """How far [Pa] the difference to the expectation has changed, and otherwise than in the frame before.

    change: of the difference [Pa], turned: of the angle [rad], in the last dt [s]; _TURNED becomes that of `turned`.
    """
    bend = abs(change - s[_CHANGE, i])
    s[_NOISE, i] += dt / (dt + NOISE_S) * (min(bend, STEP_PA / NOISES) - s[_NOISE, i])
    s[_CALM, i] = s[_CALM, i] + dt if 0.0 < dt <= CALM_FRAME_S else 0.0
    s[_CHANGE, i] = change
    s[_TURNED, i], s[_LAST_TURN, i] = turned - s[_LAST_TURN, i], turned
    return min(bend, abs(change))


@inlined
def _is_steep(s, i, asked, p, dt):  # type: ignore[no-untyped-def]
    """Whether the pressure p [Pa] of joint i has risen so much more than the valve gives that its scale is wrong.

    asked: set-point [Pa].
    """
    share = dt / (dt + MEAN_S)
    rise, expected, slow = p - s[_MEAN, i], s[EXPECTED, i] - s[_MEAN_EXPECTED, i], s[_SLOW, i] - s[_MEAN_SLOW, i]
    s[_MEAN, i] += share * rise
    s[_MEAN_EXPECTED, i] += share * expected if expected > 0.0 else expected
    s[_MEAN_SLOW, i] += share * slow if slow > 0.0 else slow
    if s[_RISEN, i] > 0.0:
        return False
    given = max(expected, slow)
    quick = given + QUICKER * max(asked - s[EXPECTED, i], 0.0)
    steep = given > LEAST_RISE_PA and rise > max(STEEP * given, quick) + STEEP_PA + s[_HIGHER, i]
    s[_DOUBLE_S, i] = s[_DOUBLE_S, i] + dt if steep else 0.0
    s[_RISEN, i] = 1.0 if s[EXPECTED, i] > FIRST_PA and not steep else 0.0
    return s[_DOUBLE_S, i] > STEEP_S


@inlined
def _steps(s, v, i, asked, p, expected, turned, dt):  # type: ignore[no-untyped-def]
    """Whether the pressure p [Pa] of joint i has stepped as no valve does, and has stayed there.

    asked: set-point [Pa].  expected: change of the expectation [Pa], which the pressure of a valve with another lag may
    have ahead of it or behind it.  turned: motion of the joint [rad] in the last dt [s].
    """
    off, before = p - s[EXPECTED, i], s[_OFF, i]
    s[_OFF, i] = off
    bend = _bend(s, i, off - before, turned, dt)
    if s[_STEP, i] != 0.0:
        s[_STEP_AGE, i] += dt
        if (off - s[_BEFORE, i]) / s[_STEP, i] < 0.5:
            s[_STEP, i] = 0.0
        return s[_STEP, i] != 0.0 and s[_STEP_AGE, i] > STEP_S
    toward = abs(asked - s[_PRESSURE, i])
    if dt > CALM_FRAME_S:
        toward = max(toward, s[_PRESSURE, i])
    drive = max(toward * min(dt * v[_PER_TAU, i], 1.0), abs(expected))
    s[_DRIVE, i] = max(drive, s[_DRIVE, i] * DRIVE_S / (dt + DRIVE_S))
    if dt > 0.0 and _is_step(s, v, i, off - before, bend, turned, p, dt):
        s[_STEP, i], s[_STEP_AGE, i], s[_BEFORE, i] = off - before, 0.0, before
    return False


@inlined
def _is_step(s, v, i, change, bend, turned, p, dt):  # type: ignore[no-untyped-def]
    """Whether neither valve nor motion explains the change, or the smaller bend [Pa], of the pressure p [Pa]."""
    given = STEP_LAGS * s[_DRIVE, i]
    small = max(LEAST_STEP_PA, NOISES * s[_NOISE, i]) + given
    if s[_CALM, i] < CALM_S or bend < STEP_SHARE * max(p, s[_PRESSURE, i]):
        small = math.inf
    if abs(change) <= STEP_PA + given and bend <= small:
        return False
    _, lower, higher = _displaced(v, i, s[EXPECTED, i], s[_ANGLE, i], 1.0)
    per_rad = max(lower, higher)
    moved = max(abs(turned), abs(s[_SPEED, i]) * dt)
    turn = max(abs(s[_TURNED, i]), abs(turned - s[_SPEED, i] * dt))
    large = STEP_PA + given + STEP_LAGS * per_rad * moved
    return abs(change) > large or bend > small + STEP_LAGS * per_rad * turn


@without_arrays
def watch_pressures(table, command, pressure, position, dt):  # type: ignore[no-untyped-def]
    """Verdict of `PressureWatch.check` and its joint; updates the state in the table (ROWS, joints) in place.

    command, pressure [Pa], position [rad]: (joints,).  dt: [s].
    """
    s, valve = table[:_ROWS], table[_ROWS:]
    verdict, worst = FOLLOWING, 0
    for i in range(len(command)):
        # A set-point in force of 0 Pa was not reduced by `hold`: the board has vented by itself.
        asked = command[i] + s[_HELD_BACK, i] if command[i] > 0.0 else 0.0
        turned = position[i] - s[_ANGLE, i]
        before = s[EXPECTED, i]
        below, above = _expect(s, valve, i, asked, position[i], dt)
        least = min(s[EXPECTED, i], s[_SLOW, i])
        low, high = least - below, max(s[EXPECTED, i], s[_SLOW, i]) + above
        low = min(low + max(BAND_PA - USUAL_PA + s[_USUAL, i], 0.0), least - USUAL_PA)
        if least > LEAST_SHALLOW_PA:
            low = max(low, SHALLOW * least - s[_LOWER, i] - SHALLOW_PA)
        s[_OVER, i] = s[_OVER, i] + dt if pressure[i] > (1.0 + OVER) * valve[_LIMIT, i] else 0.0
        _lasts(s, i, _HIGH, _HIGH_PA_S, pressure[i] - high, dt)
        _lasts(s, i, _LOW, _LOW_PA_S, low - pressure[i], dt)
        stepped = _steps(s, valve, i, asked, pressure[i], s[EXPECTED, i] - before, turned, dt)
        steep = _is_steep(s, i, asked, pressure[i], dt)
        if s[_LOW, i] == 0.0:
            s[_USUAL, i] += min(dt / USUAL_S, 1.0) * (s[_OFF, i] - s[_USUAL, i])
        s[_PRESSURE, i] = pressure[i]
        found = FOLLOWING
        if s[_OVER, i] > OVER_S:
            found = OVER_PRESSURE
        elif stepped:
            found = STEPPED
        elif steep:
            found = STEEP_RISE
        elif s[_HIGH, i] > NOT_FOLLOWING_S or s[_HIGH_PA_S, i] > NOT_FOLLOWING_PA_S:
            found = OVER_PRESSURE if s[_OVER, i] > 0.0 else STUCK_HIGH
        elif _is_short(s, i):
            found = STUCK_LOW
        if found != FOLLOWING and (verdict == FOLLOWING or found < verdict):
            verdict, worst = found, i
    return verdict, worst


@without_arrays
def cap_pressures(s, command, dt):  # type: ignore[no-untyped-def]
    """Limit set-points (joints,) [Pa] in place, dt [s] after the last call, see `PressureWatch.hold`.

    s: state (rows, joints).  While a pressure is too low none is above the last one from before; afterwards they return
    along a ramp.
    """
    for i in range(len(command)):
        asked, short = command[i], s[_LOW, i] > 0.0 or s[_STEP, i] != 0.0
        s[_HELD_BACK, i] = 0.0
        if short:
            command[i] = min(asked, s[_BELIEVED, i])
        elif s[_BEHIND, i] > 0.0:
            command[i] = min(asked, s[_BELIEVED, i] + RETURN_PA_PER_S * dt)
        s[_BEHIND, i] = 1.0 if command[i] < asked else 0.0
        s[_BELIEVED, i] = max(s[_BELIEVED, i], command[i]) if short else command[i]
        low = short and _is_short(s, i)
        if low:
            most = max(TRUSTED * s[_PRESSURE, i], 0.0) + TRUSTED_PA
            s[_HELD_BACK, i] = max(command[i] - most, 0.0)
            command[i] -= s[_HELD_BACK, i]
        s[SHORT, i] = 1.0 if low or command[i] < asked else 0.0


class PressureWatch:
    """Compares the pressures of one hand with its set-points, frame by frame.

    expected: pressure of set-points and motion now, (n,) [Pa].  driven: what the set-points alone give, (n,) [Pa],
    of a hand filled with a liquid.  wider: by how much expected may be wrong by the motion, (n,) [Pa]. Each check
    overwrites them.  short: (n,) 1 where a pressure is too low for what is asked, or its set-point is still to return;
    `hold` overwrites it.  high_s: (n,) how long a pressure has been too high.  gap_s: longest time between frames [s]
    after which nothing starts again.
    """

    def __init__(self, hand: Hand, memory: Array | None = None) -> None:
        """Expect no pressure; `start` sets the first one. memory: (ROWS, n), 0; None: an array of its own."""
        lag = hand.row("valve.time_constant_s") + hand.row("valve.dead_time_s")
        valve = [lag, hand.row("valve.vent_rate_pa_per_s"), hand.row("valve.fill_rate_pa_per_s")]
        self._table = np.zeros((ROWS, len(hand.joints))) if memory is None else memory
        inverse = [1.0 / row for row in (lag, hand.row("hydraulic.volume_m3_per_pa"), hand.row("supply.pressure_pa"))]
        self._table[_ROWS:] = [*valve, *(hand.row(key) for key in _FLUID), hand.limits.max_pressure_pa, *inverse]
        self._state, self._limit_pa = self._table[:_ROWS], self._table[_ROWS + _LIMIT]
        self.gap_s = GAP_S
        self.expected: Array = self._state[EXPECTED]
        self.driven: Array = self._state[DRIVEN]
        self.wider: Array = self._state[WIDER]
        self.short: Array = self._state[SHORT]
        self.high_s: Array = self._state[_HIGH]
        self._still = np.zeros(len(hand.joints))

    def start(self, pressure: Array, position: Array | None = None) -> None:
        """Expect the measured pressure (n,) [Pa] of joints that stand still at position (n,) [rad]."""
        self._state[:] = 0.0
        self._state[[EXPECTED, DRIVEN, _SLOW, _PRESSURE, _MEAN, _MEAN_EXPECTED, _MEAN_SLOW]] = pressure
        self._state[_BELIEVED] = np.maximum(pressure, 0.0)
        self._state[_DRIVE] = self._limit_pa
        self._state[_NOISE] = STEP_PA / NOISES
        self._state[_ANGLE] = self._still if position is None else position

    def check(self, command: Array, pressure: Array, dt: float, position: Array | None = None) -> tuple[int, int]:
        """Verdict and its joint after dt [s] under command (n,) [Pa], now at pressure (n,) [Pa].

        position: (n,) [rad]; None: the joints stand still. After a gap the measured pressure is expected.
        """
        if dt > GAP_S:
            self._skip(pressure, position)
            dt = 0.0
        angle = self._still if position is None else position
        return watch_pressures(self._table, command, pressure, angle, dt)  # type: ignore[no-any-return]

    def hold(self, command: Array, dt: float) -> None:
        """Limit set-points (n,) [Pa] in place to what the measured pressure justifies, dt [s] after the last frame."""
        cap_pressures(self._state, command, dt)

    def _skip(self, pressure: Array, position: Array | None) -> None:
        """Expect the measured state after a gap; how long a pressure has been off is kept."""
        self._state[[EXPECTED, DRIVEN, _SLOW, _PRESSURE, _MEAN, _MEAN_EXPECTED, _MEAN_SLOW]] = pressure
        self._state[[_SPEED, _OFF, _STEP, _CALM]] = 0.0
        self._state[_DRIVE] = self._limit_pa
        self._state[_ANGLE] = self._still if position is None else position
