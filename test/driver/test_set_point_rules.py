"""Rules of set-points: which commands are accepted, how long a board holds them, and which frames are missing."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from hand_driver.board import LinkCounters, SetPointsInForce, lifetime_ticks
from hand_driver.set_points import CommandReader, RefusedError
from hand_messages.cdr import Layout
from hand_messages.layouts import VALVE_COMMAND
from hand_model.description import load_hand

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
JOINTS, COUNT = list(HAND.joints), len(HAND.joints)
NOW_NS, MS = 1_700_000_000_000_000_000, 1_000_000
LIMIT_PA = float(HAND.limits.max_pressure_pa[0])


def message(pressure: list[float], names: list[str], lifetime_ms: int = 100, age_ms: int = 0) -> bytes:
    layout = Layout(VALVE_COMMAND, "", names, {"pressure": len(pressure)})
    return layout.encode(NOW_NS - age_ms * MS, lifetime_ns=lifetime_ms * MS, pressure=pressure)


def line(pressure: list[float], names: list[str], lifetime_ms: int = 100, age_ms: int = 0) -> str:
    """The reason of the refusal, or an empty text."""
    try:
        CommandReader(HAND).read(message(pressure, names, lifetime_ms, age_ms), NOW_NS)
    except RefusedError as error:
        return str(error).removeprefix("valve_command refused: ")
    return ""


@pytest.mark.parametrize(
    ("lifetime_ms", "age_ms", "expected"),
    [
        (1, 0, ""),
        (1000, 0, ""),
        (0, 0, "lifetime is 0 s; allowed is above 0 to 1 s"),
        (-5, 0, "lifetime is -0.005 s; allowed is above 0 to 1 s"),
        (1001, 0, "lifetime is 1.001 s; allowed is above 0 to 1 s"),
        (100, 99, ""),
        (100, 101, "stamp is 0.101 s old; at most its lifetime, 0.1 s, is allowed"),
        (100, -99, ""),
        (100, -101, "stamp is 0.101 s in the future; at most 0.1 s is allowed"),
        (1000, -101, "stamp is 0.101 s in the future; at most 0.1 s is allowed"),
    ],
)
def test_lifetime_and_stamp_have_these_limits(lifetime_ms: int, age_ms: int, expected: str) -> None:
    """Fails when a set-point that is too old, too long or of another clock reaches a valve, or a good one does not."""
    assert line([1e5] * COUNT, JOINTS, lifetime_ms, age_ms) == expected


@pytest.mark.parametrize("value", [math.nan, math.inf, -0.1, LIMIT_PA + 1.0])
def test_each_pressure_must_be_within_the_limit_of_its_joint(value: float) -> None:
    """Fails when a bad pressure passes, or the line names another joint, value or range."""
    for joint in (0, 4, COUNT - 1):
        pressure = [1e5] * COUNT
        pressure[joint] = value
        wanted = f"{JOINTS[joint]} pressure is {value:g} Pa; the allowed range is 0 to {LIMIT_PA:g} Pa"
        assert line(pressure, JOINTS) == wanted
    assert line([0.0] * COUNT, JOINTS) == line([LIMIT_PA] * COUNT, JOINTS) == ""


def test_names_must_be_each_joint_once() -> None:
    """Fails when a missing, repeated, unknown or surplus joint is accepted, or not named."""
    assert "unknown joint 'toe'; joints are thumb_" in line([0.0] * COUNT, ["toe", *JOINTS[1:]])
    assert line([0.0] * COUNT, [JOINTS[1], *JOINTS[1:]]) == f"joint {JOINTS[1]!r} appears twice"
    missing = f"joint {JOINTS[-1]!r} is missing; each valve needs a set-point"
    assert line([0.0] * (COUNT - 1), JOINTS[:-1]) == missing
    for pressures in (COUNT - 1, COUNT + 1):
        wanted = f"{COUNT} names but {pressures} pressures [Pa]; one each is needed"
        assert line([0.0] * pressures, JOINTS) == wanted


def test_pressures_are_put_into_the_order_of_the_valves() -> None:
    """Fails when a pressure reaches another valve than that of its name, also after the sender changes its order."""
    reader = CommandReader(HAND)
    for shift in (0, 3, 0):
        names = JOINTS[shift:] + JOINTS[:shift]
        pressure = [1e3 * (JOINTS.index(name) + 1) for name in names]
        got = reader.read(message(pressure, names), NOW_NS)
        assert got.pressure_pa.tolist() == [1e3 * (k + 1) for k in range(COUNT)]
        assert got.lifetime_s == pytest.approx(0.1) and got.stamp_ns == NOW_NS


def test_bytes_that_are_no_command_are_refused_in_one_line() -> None:
    """Fails when damaged bytes raise another error than the refusal."""
    for raw in (b"", b"\0\1\0\0", message([0.0] * COUNT, JOINTS)[:-9]):
        with pytest.raises(RefusedError, match=r"^valve_command refused: "):
            CommandReader(HAND).read(raw, NOW_NS)


@pytest.mark.parametrize(
    ("lifetime_s", "period_s", "ticks"),
    [(0.1, 0.005, 20), (0.1001, 0.005, 21), (0.1, 0.003, 34), (0.001, 0.005, 1), (0.0, 0.005, 1), (0.3, 0.1, 3)],
)
def test_a_lifetime_is_a_whole_number_of_ticks(lifetime_s: float, period_s: float, ticks: int) -> None:
    """Fails when whole periods gain a tick by rounding, a begun period does not count, or a lifetime has no tick."""
    assert lifetime_ticks(lifetime_s, period_s) == ticks
    assert lifetime_ticks(np.array([lifetime_s] * 2), period_s).tolist() == [ticks] * 2
    assert lifetime_ticks(lifetime_s, period_s * (1.0 - 1e-5)) == ticks  # a fitted period is off by rounding


def test_set_points_are_in_force_for_their_lifetime() -> None:
    """Fails when set-points begin or end at another tick, the newest does not replace, or the end does not vent."""
    held = SetPointsInForce(2, 0.005)
    assert held.pressure_pa.tolist() == [0.0, 0.0] and held.vented(0) and held.vented(1)
    source = np.array([1e5, 2e5])
    held.take_over(10, source, 0.015)
    source[:] = 9.0
    states = []
    for tick in range(11, 16):
        states.append((held.pressure_pa[0], held.vented(tick)))
        held.take_over(tick)
    assert states == [(1e5, False), (1e5, False), (1e5, False), (0.0, True), (0.0, True)]
    held.take_over(20, np.array([1e5, 2e5]), 0.015)
    held.take_over(21, np.array([3e5, 4e5]), 0.005)
    assert held.pressure_pa.tolist() == [3e5, 4e5] and not held.vented(22)
    held.take_over(22)
    assert held.pressure_pa.tolist() == [0.0, 0.0] and held.vented(23)


def test_the_counters_of_a_link_begin_at_zero() -> None:
    """Fails when a new connection starts with counted events."""
    assert LinkCounters() == LinkCounters(frames=0, dropped=0, corrupt=0, written=0, replayed=0, restarts=0)
