"""The latch of the driver: what it lets through, and what it remembers."""

from __future__ import annotations

import numpy as np

from hand_driver.guard import Guard
from hand_driver.set_points import SetPoints

MS = 1_000_000
DRIVE = SetPoints(np.array([0.0, 2e5]), 0.1, 0)
VENT = SetPoints(np.zeros(2), 0.1, 0)


def test_a_latched_fault_lets_only_venting_through_until_the_reset() -> None:
    """Fails when pressure passes a latched fault, 0 Pa does not, or a later fault hides the first one."""
    guard = Guard()
    assert guard.refusal(DRIVE) == ""
    guard.trip("emergency stop")
    guard.trip("no heartbeat")
    assert guard.refusal(DRIVE) == "valve_command refused: a fault is latched (emergency stop); call reset_driver"
    assert guard.refusal(VENT) == ""
    assert guard.reset() == "emergency stop"
    assert guard.reset() == ""
    assert guard.refusal(DRIVE) == ""


def test_a_fault_from_before_a_restart_is_latched_from_the_start() -> None:
    """Fails when a restarted driver forgets its latch."""
    assert "over-pressure" in Guard("over-pressure").refusal(DRIVE)


def test_an_objection_is_not_latched() -> None:
    """Fails when set-points pass an objection, or when it outlives its cause."""
    guard = Guard()
    assert guard.refusal(DRIVE, "no heartbeat") == "valve_command refused: no heartbeat"
    assert guard.refusal(VENT, "no heartbeat") == ""
    assert guard.refusal(DRIVE) == ""


def test_driving_means_pressure_within_its_lifetime() -> None:
    """Fails when a vented hand, an expired set-point or a tripped guard counts as driving."""
    guard = Guard()
    assert not guard.driving(0)
    guard.written(DRIVE, 0)
    assert guard.driving(99 * MS) and not guard.driving(100 * MS)
    guard.written(VENT, 0)
    assert not guard.driving(1 * MS)
    guard.written(DRIVE, 0)
    guard.trip("x")
    assert not guard.driving(1 * MS)


def test_pressure_is_not_remembered_while_a_fault_is_latched() -> None:
    """Fails when pressure that comes late counts as driving after a latch, or would be held or continued."""
    guard = Guard()
    guard.trip("x")
    guard.written(DRIVE, 0)
    assert not guard.driving(1 * MS) and guard.held(1 * MS) is None and guard.in_force(1 * MS) is None
    guard.written(VENT, 0)
    assert guard.in_force(1 * MS) is not None


def test_what_was_in_force_can_be_forgotten_without_the_latch() -> None:
    """Fails when a driver that is activated again believes that pressure is in force, or loses its latch."""
    guard = Guard()
    guard.written(DRIVE, 0)
    guard.forget()
    assert not guard.driving(1 * MS) and guard.in_force(1 * MS) is None
    guard.trip("x")
    guard.forget()
    assert guard.fault == "x"


def test_a_hold_takes_the_least_of_the_last_tenth_of_a_second() -> None:
    """Fails when a hold keeps what a second commander had sent before it was noticed, or forgets what came before."""
    guard = Guard()
    guard.written(SetPoints(np.array([1e5, 2e5]), 0.1, 0), 0)
    guard.written(SetPoints(np.array([5.9e5, 5.9e5]), 1.0, 0), 40 * MS)
    held = guard.held(60 * MS)
    assert held is not None and held.pressure_pa.tolist() == [1e5, 2e5]
    guard.written(SetPoints(np.array([3e5, 0.0]), 0.1, 0), 150 * MS)
    held = guard.held(160 * MS)
    assert held is not None and held.pressure_pa.tolist() == [3e5, 0.0]


def test_set_points_in_force_have_the_rest_of_their_lifetime() -> None:
    """Fails when set-points are continued beyond their lifetime, or with less than a board accepts."""
    guard = Guard()
    assert guard.in_force(0) is None
    guard.written(DRIVE, 0)
    rest = guard.in_force(60 * MS)
    assert rest is not None and abs(rest.lifetime_s - 0.04) < 1e-9
    assert guard.in_force(99 * MS + MS // 2) is None
    guard.trip("x")
    assert guard.in_force(0) is None
