"""Faults that end or distort the flow of frames, commands and pressures, in motion and at rest, in virtual time.

The detection time runs from the fault to the latch of the controller. The pressure that counts is the one that is sent
to the valves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hand_control.frame_checks import NOT_FOLLOWING_S, OVER_S
from hand_control.supervisor import VENT_S
from hand_driver.measurement import Measurement
from hand_messages.health import Level
from validation.faults.closed_loop import WATCH_S, VirtualHand, description
from validation.faults.result import FaultResult, Size, Tally

FAMILY = "timing"
MOTIONS_DEG = (0.0, 30.0, 60.0, 80.0)
"""Targets [deg] of the motion in which the fault begins; 0 is the rest."""
SLACK_S = 0.01
"""Two frames of 200 Hz."""


def run(size: Size, seed: int) -> list[FaultResult]:
    """Every fault for each joint or motion; quick: a few of them."""
    joints = list(range(len(description().joints)))[:: size.of(5, 1)]
    return [
        frames_stop(size.of(4, 60), seed), frame_gaps(size.of(2, 40), seed), commands_stop(size.of(2, 20), seed),
        stamps(size.of(1, 8), seed), not_finite(joints, seed), jumps(joints, seed),
        over_pressure(joints, seed), stuck_open(joints, seed), closed(joints, seed),
    ]  # fmt: skip


def moving(rng: np.random.Generator, case: int, **values: float) -> VirtualHand:
    """A hand in a random motion."""
    hand = VirtualHand(int(rng.integers(1 << 31)), **values)
    hand.move(MOTIONS_DEG[case % len(MOTIONS_DEG)])
    hand.run(float(rng.uniform(0.05, 0.6)))
    return hand


def grade(tally: Tally, name: str, hand: VirtualHand, allowed_s: float, patience_s: float = 2.0) -> None:
    """Run until the latch; a case is handled if it comes in time, names a fault, and no set-point leaves its limits."""
    took_s = hand.run(patience_s, lambda: hand.vented)
    within = hand.vented and took_s <= allowed_s + 1e-9 and hand.worst_excess_pa <= 0.0
    tally.case(name, within, took_s if hand.vented else None, float(hand.pressure_pa.max()))


def frames_stop(cases: int, seed: int) -> FaultResult:
    """No frame arrives any more."""
    rng = np.random.default_rng([seed, 10])
    tally = Tally(FAMILY, "frames stop", seed, "Pa")
    for case in range(cases):
        hand = moving(rng, case)
        hand.delivered = lambda: False
        grade(tally, f"motion {case}", hand, VENT_S + WATCH_S + SLACK_S)
        hand.delivered = lambda: True
        hand.run(0.3)
        if not hand.vented:
            tally.case(f"motion {case}: driven again without a request", False)
    return tally.result()


def frame_gaps(cases: int, seed: int) -> FaultResult:
    """Gaps of up to 90 ms at random must not trip; the next frame is used."""
    rng = np.random.default_rng([seed, 11])
    tally = Tally(FAMILY, "gaps of up to 90 ms (no trip wanted)", seed)
    for case in range(cases):
        hand = VirtualHand(int(rng.integers(1 << 31)))
        for number in range(6):
            hand.move((95.0, 0.0)[number % 2])
            hand.run(float(rng.uniform(0.02, 0.25)))
            hand.delivered = lambda: False
            hand.run(0.005 * float(rng.choice([3, 10, 16, 17])))
            hand.delivered = lambda: True
            hand.run(0.6)
            if hand.vented:
                break
        tally.case(f"motion {case}: {hand.controller.safety.fault}", not hand.vented)
    return tally.result()


def commands_stop(cases: int, seed: int) -> FaultResult:
    """With a command time-out, no command arrives any more."""
    rng = np.random.default_rng([seed, 12])
    tally = Tally(FAMILY, "commands stop", seed, "Pa")
    for _ in range(cases):
        timeout_s = float(rng.uniform(0.2, 0.4))
        hand = VirtualHand(int(rng.integers(1 << 31)), command_timeout_s=timeout_s)
        hand.move(50.0)
        grade(tally, f"time-out {timeout_s:.2f} s", hand, 2.0 * timeout_s + SLACK_S)
    return tally.result()


def stamps(cases: int, seed: int) -> FaultResult:
    """Stamps that stand still, go back, jump ahead, or belong to another clock."""
    rng = np.random.default_rng([seed, 13])
    tally = Tally(FAMILY, "stamps of another time", seed, "Pa")
    for case in range(cases):
        for name, change in _stamp_faults(rng):
            hand = moving(rng, case)
            begun = hand.now_ns
            hand.stamp_ns = lambda now_ns, change=change, begun=begun: change(now_ns, begun)  # type: ignore[misc]
            grade(tally, f"{name}, motion {case}", hand, VENT_S + WATCH_S + SLACK_S)
    return tally.result()


def _stamp_faults(rng: np.random.Generator) -> list[tuple[str, Callable[[int, int], int]]]:
    offset_ns = int(rng.integers(200_000_000, 1 << 40))
    return [
        ("stands still", lambda _, begun: begun),
        ("goes back", lambda now_ns, begun: 2 * begun - now_ns),
        ("is old", lambda now_ns, _: now_ns - offset_ns),
        ("is ahead", lambda now_ns, _: now_ns + offset_ns),
        ("is zero", lambda *_: 0),
    ]


def _one_joint(joint: int, field: str, change: Callable[[float], float]) -> Callable[[Measurement], Measurement]:
    def changed(measured: Measurement) -> Measurement:
        values = np.array(getattr(measured, field))
        values[joint] = change(values[joint])
        return replace(measured, **{field: values})  # type: ignore[arg-type]

    return changed


def not_finite(joints: list[int], seed: int) -> FaultResult:
    """A value of one joint becomes NaN or infinite."""
    rng = np.random.default_rng([seed, 14])
    tally = Tally(FAMILY, "measurement is not finite", seed, "Pa")
    for joint in joints:
        for field in ("position", "velocity", "pressure"):
            for value in (np.nan, np.inf, -np.inf):
                hand = moving(rng, joint)
                hand.measured = _one_joint(joint, field, lambda _, value=value: value)  # type: ignore[misc]
                grade(tally, f"{hand.hand.joints[joint]} {field} {value}", hand, VENT_S + WATCH_S + SLACK_S, 0.3)
    return tally.result()


def jumps(joints: list[int], seed: int) -> FaultResult:
    """The angle of one joint changes by 45 degrees between two frames."""
    rng = np.random.default_rng([seed, 15])
    tally = Tally(FAMILY, "angle jumps", seed, "Pa")
    for joint in joints:
        for jump in (-0.8, 0.8):
            hand = moving(rng, joint)
            hand.measured = _one_joint(joint, "position", lambda angle, jump=jump: angle + jump)  # type: ignore[misc]
            grade(tally, f"{hand.hand.joints[joint]} {jump:+.1f} rad", hand, SLACK_S, 1.0)
    return tally.result()


def over_pressure(joints: list[int], seed: int) -> FaultResult:
    """The pressure of one joint is measured 20 % above its limit."""
    rng = np.random.default_rng([seed, 16])
    tally = Tally(FAMILY, "pressure above its limit", seed, "Pa")
    limit = description().limits.max_pressure_pa
    for joint in joints:
        hand = moving(rng, joint)
        high = 1.2 * float(limit[joint])
        hand.measured = _one_joint(joint, "pressure", lambda _, high=high: high)  # type: ignore[misc]
        grade(tally, hand.hand.joints[joint], hand, OVER_S + SLACK_S)
    return tally.result()


def stuck_open(joints: list[int], seed: int) -> FaultResult:
    """One valve keeps its pressure when it should vent."""
    rng = np.random.default_rng([seed, 17])
    tally = Tally(FAMILY, "valve stuck open", seed, "Pa")
    for joint in joints:
        hand = VirtualHand(int(rng.integers(1 << 31)))
        hand.move(60.0)
        hand.run(1.5)
        held = float(hand.pressure_pa[joint])

        def stuck(pressure: np.ndarray, joint: int = joint, held: float = held) -> np.ndarray:  # type: ignore[type-arg]
            pressure[joint] = held
            return pressure

        hand.valve = stuck
        hand.move(0.0)
        # The set-point falls with the reference; then the valve model must fall below the pressure.
        grade(tally, hand.hand.joints[joint], hand, NOT_FOLLOWING_S + 0.5)
    return tally.result()


def closed(joints: list[int], seed: int) -> FaultResult:
    """One valve gives no pressure: named on diagnostics, or latched; nothing is commanded above the limit."""
    rng = np.random.default_rng([seed, 18])
    tally = Tally(FAMILY, "valve closed", seed, "Pa")
    for joint in joints:
        hand = VirtualHand(int(rng.integers(1 << 31)))

        def shut(pressure: np.ndarray, joint: int = joint) -> np.ndarray:  # type: ignore[type-arg]
            pressure[joint] = 0.0
            return pressure

        hand.valve = shut
        hand.move(60.0)
        named = hand.hand.joints[joint]

        def seen(hand: VirtualHand = hand, named: str = named) -> bool:
            found = hand.controller.health(hand.now_ns)
            return any(status.level != Level.OK and named in status.message for status in found)

        took_s = hand.run(3.0, seen)
        tally.case(named, seen() and hand.worst_excess_pa <= 0.0, took_s if seen() else None)
    return tally.result()
