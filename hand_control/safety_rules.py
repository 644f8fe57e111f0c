"""The rules of `firmware/hand_safety.c` in Python: pure, on whole numbers, times [us] as arguments that do not wrap.

It is the reference that the C is compared with. `hand_control/safety_numbers.py` declares its numbers and its table.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from hand_control.safety_numbers import LIMITS, NUMBERS

FULL_TURN_URAD = 6_300_000
HALF_RANGE_US = 1 << 31
"""A longer interval of two ticks cannot be distinguished from a clock that went back."""
_N = {name: int(number.value) for name, number in NUMBERS.items() if number.unit != "s"}


class State(IntEnum):
    """State of the layer."""

    VENTED = 0
    RAMPING = 1
    DRIVING = 2


class Fault(IntEnum):
    """Why the hand was vented; the first fault stays until `reset`."""

    NONE = 0
    COMMAND_LOST = 1
    SENSORS_LOST = 2
    HEARTBEAT_LOST = 3
    OVER_PRESSURE = 4
    CLOCK = 5
    CONFIGURATION = 6


class Answer(IntEnum):
    """What became of a command."""

    ACCEPTED = 0
    WRONG_COUNT = 1
    WRONG_LIFETIME = 2
    REPLAYED = 3
    WRONG_PRESSURE = 4


@dataclass(frozen=True, slots=True)
class JointLimits:
    """Limits of one joint, in the units of their names; the fields of LIMITS."""

    max_pressure_pa: int
    max_torque_nnm: int
    a0_nnm: int
    a1_nnm_per_rad: int
    a2_pnm_per_pa: int
    a3_pnm_per_pa_rad: int
    phi_max_urad: int
    low_urad: int
    high_urad: int

    def leverage(self, angle_urad: int) -> int:
        """Torque per pressure [1e-15 N m/Pa]."""
        exact = self.a2_pnm_per_pa * 1_000_000 + self.a3_pnm_per_pa_rad * angle_urad
        return exact // 1000 if exact >= 0 else -(-exact // 1000)

    def usable(self) -> bool:
        """Whether the limits make sense: signs, ranges, and a joint that pressure flexes."""
        return (
            0 < self.max_pressure_pa <= _N["highest_pa"]
            and self.max_torque_nnm > 0
            and self.a1_nnm_per_rad <= 0 <= self.phi_max_urad <= FULL_TURN_URAD
            and -FULL_TURN_URAD <= self.low_urad < self.high_urad <= FULL_TURN_URAD
            and min(self.leverage(self.low_urad), self.leverage(self.high_urad)) > 0
        )

    def torque_ceiling(self, angle_urad: int) -> int:
        """Highest pressure [Pa] at which the torque of a fully crept joint stays within its limit and margin."""
        at = min(max(angle_urad, self.low_urad), self.high_urad)
        allowed = self.max_torque_nnm * (1000 + _N["torque_permille"]) * 1000
        room = allowed - self.a0_nnm * 1_000_000 - self.a1_nnm_per_rad * (at - self.phi_max_urad)
        return min(room // self.leverage(at), self.max_pressure_pa) if room > 0 else 0

    @property
    def over_pa(self) -> int:
        """Pressure [Pa] above which the actuator is over its limit."""
        return self.max_pressure_pa + self.max_pressure_pa * _N["over_permille"] // 1000


def limits_of(rows: np.ndarray[tuple[int, int], np.dtype[np.int32]]) -> tuple[JointLimits, ...]:
    """JointLimits from the rows (n, 9) of `safety_numbers.joint_limits` [their integers]."""
    return tuple(JointLimits(**dict(zip(LIMITS, map(int, row), strict=True))) for row in rows)


@dataclass(slots=True)
class Counted:
    """Something that arrives with a number: when the last one arrived, its number, and whether it is recent."""

    at_us: int = 0
    number: int | None = None
    recent: bool = False

    def take(self, now_us: int, number: int) -> None:
        """Count an arrival."""
        self.at_us, self.number, self.recent = now_us, number, True


class SafetyLayer:
    """The state machine of one hand.

    state, fault: State and Fault; ints, because memory may be damaged.  output_pa: set-points of the last tick [Pa].
    late, integrate: whether the newest sample is late, and whether integrators may run.
    torque_limited, rate_limited: whether the last tick reduced a set-point.
    """

    def __init__(self, joints: Sequence[JointLimits], max_joints: int = 16) -> None:
        """Begin vented; limits that cannot be used keep the hand vented for good."""
        fits = 0 < len(joints) <= max_joints
        self.good = fits and all(joint.usable() for joint in joints)
        self.joints = tuple(joints) if fits else ()
        self.state: int = State.VENTED
        self.fault: int = Fault.NONE if self.good else Fault.CONFIGURATION
        self.late, self.integrate, self.torque_limited, self.rate_limited = True, False, False, False
        self._tick_us, self._lifetime_us, self._ramp_us = 0, 0, 0
        self._sample, self._command, self._beat = Counted(), Counted(), Counted()
        self._over_us, self._command_pa, self._pressure_pa, self._angle_urad, self.output_pa = (
            [0] * len(self.joints) for _ in range(5)
        )

    def command(self, now_us: int, sequence: int, lifetime_us: int, pressure_pa: Sequence[int]) -> Answer:
        """Take a command of set-points [Pa] with a lifetime [us]."""
        if len(pressure_pa) != len(self.joints):
            return Answer.WRONG_COUNT
        if not 0 < lifetime_us <= _N["lifetime_us"]:
            return Answer.WRONG_LIFETIME
        last = self._command.number
        if last is not None and not 0 < (sequence - last) % 2**32 < _N["sequence_window"]:
            return Answer.REPLAYED
        if any(not 0 <= p <= joint.max_pressure_pa for p, joint in zip(pressure_pa, self.joints, strict=True)):
            return Answer.WRONG_PRESSURE
        self._command.take(now_us, sequence)
        self._lifetime_us, self._command_pa = lifetime_us, list(pressure_pa)
        return Answer.ACCEPTED

    def new_session(self) -> None:
        """Accept any sequence number next: another sender begins."""
        self._command.number = None

    def sample(
        self, now_us: int, sequence: int, valid: bool, pressure_pa: Sequence[int], angle_urad: Sequence[int]
    ) -> bool:
        """Take a sample of every joint; returns whether it counts."""
        believed = all(abs(p) <= _N["highest_pa"] for p in pressure_pa)
        believed = believed and all(abs(angle) <= FULL_TURN_URAD for angle in angle_urad)
        if not valid or sequence == self._sample.number or not believed:
            return False
        gap_us = now_us - self._sample.at_us
        self.integrate = self._sample.recent and 0 <= gap_us <= _N["freeze_us"]
        step_us = 0
        if self._sample.number is not None:  # on the board, the gap to a sample that is forgotten may have wrapped
            step_us = _step(gap_us) if self._sample.recent else _N["step_us"]
        self._pressure_pa, self._angle_urad = list(pressure_pa), list(angle_urad)
        for i, joint in enumerate(self.joints):
            self._over_us[i] = self._over_us[i] + step_us if pressure_pa[i] > joint.over_pa else 0
            self._over_us[i] = min(self._over_us[i], _N["over_us"] + 1)
        if any(over_us > _N["over_us"] for over_us in self._over_us):
            self._trip(Fault.OVER_PRESSURE)
        self._sample.take(now_us, sequence)
        return True

    def heartbeat(self, now_us: int, number: int) -> bool:
        """Count a heartbeat; a repeated number does not count."""
        if number == self._beat.number:
            return False
        self._beat.take(now_us, number)
        return True

    def arm(self, now_us: int) -> bool:
        """Drive on request where nothing is missing; returns whether it drives from now on."""
        self._forget(now_us)
        over = any(p > joint.over_pa for p, joint in zip(self._pressure_pa, self.joints, strict=True))
        complete = self._command.recent and self._sample.recent and self._beat.recent
        if self.state != State.VENTED or self.fault != Fault.NONE or not complete or over:
            return False
        self.state, self._ramp_us, self._tick_us = State.RAMPING, _N["ramp_us"], now_us
        self.output_pa = [
            min(max(p, 0), joint.max_pressure_pa) for p, joint in zip(self._pressure_pa, self.joints, strict=True)
        ]
        return True

    def vent(self) -> None:
        """Vent on request, without a fault."""
        self.state, self._command.recent = State.VENTED, False

    def reset(self) -> bool:
        """Clear a latched fault; returns whether none is left."""
        if self.fault != Fault.CONFIGURATION:
            self.fault = Fault.NONE
        return self.fault == Fault.NONE

    def tick(self, now_us: int) -> list[int]:
        """Check every age; the set-points for the valves [Pa]."""
        elapsed_us, self._tick_us = now_us - self._tick_us, now_us
        self._forget(now_us)
        if self.state != State.VENTED:
            self._check(elapsed_us)
        self.torque_limited = self.rate_limited = False
        if self.state not in tuple(State):
            self.vent()  # a state that damage to the memory left behind
        if self.state == State.VENTED:
            self.output_pa = [0] * len(self.joints)
            return self.output_pa
        self._drive(_step(elapsed_us))
        return self.output_pa

    def _check(self, elapsed_us: int) -> None:
        if not 0 <= elapsed_us < HALF_RANGE_US:
            self._trip(Fault.CLOCK)
        elif not self._command.recent:
            self._trip(Fault.COMMAND_LOST)
        elif not self._sample.recent:
            self._trip(Fault.SENSORS_LOST)
        elif not self._beat.recent:
            self._trip(Fault.HEARTBEAT_LOST)

    def _trip(self, fault: Fault) -> None:
        self.fault = self.fault or fault
        self.vent()

    def _forget(self, now_us: int) -> None:
        """Mark what is too old."""
        for what, longest_us in (
            (self._command, self._lifetime_us - 1),
            (self._sample, _N["vent_us"]),
            (self._beat, _N["heartbeat_us"]),
        ):
            what.recent = what.recent and 0 <= now_us - what.at_us <= longest_us
        self.late = not self._sample.recent or now_us - self._sample.at_us > _N["warn_us"]
        self.integrate = self.integrate and self._sample.recent

    def _drive(self, step_us: int) -> None:
        rate = _N["ramp_pa_per_s"] if self.state == State.RAMPING else _N["rate_pa_per_s"]
        rise_pa = rate * step_us // 1_000_000
        for i, joint in enumerate(self.joints):
            allowed_pa = min(self._command_pa[i], joint.torque_ceiling(self._angle_urad[i]))
            highest_pa = self.output_pa[i] + rise_pa
            self.torque_limited |= allowed_pa < self._command_pa[i]
            self.rate_limited |= highest_pa < allowed_pa
            self.output_pa[i] = min(allowed_pa, highest_pa)
        if self.state == State.RAMPING:
            self._ramp_us = max(self._ramp_us - step_us, 0)
            self.state = State.RAMPING if self._ramp_us else State.DRIVING


def _step(gap_us: int) -> int:
    """The part of an interval [us] that is used; one that goes back counts as the longest."""
    return gap_us if 0 <= gap_us <= _N["step_us"] else _N["step_us"]


def law_step(dt_s: float) -> float:
    """The time step [s] that a law may use, in single precision: 0 unless positive and finite, long ones are cut."""
    with np.errstate(over="ignore"):
        dt, least, longest = (np.float32(t) for t in (dt_s, NUMBERS["least_step_s"].value, NUMBERS["step_s"].value))
    return float(min(dt, longest)) if least <= dt < math.inf else 0.0


def integer(value: float, scale: float) -> int | None:
    """value [any unit] * scale [-] as an integer, in single precision; None for NaN and numbers that do not fit."""
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = np.float32(value) * np.float32(scale)
    return int(scaled) if -2.0e9 < scaled < 2.0e9 else None
