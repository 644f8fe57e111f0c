"""Valve commands as bytes: an invalid command is refused as a whole, in one line."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hand_driver.set_points import FUTURE_S, MAX_LIFETIME_S, CommandReader, RefusedError, SetPoints
from hand_messages.cdr import Layout
from hand_messages.layouts import VALVE_COMMAND
from hand_model.description import load_hand

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
JOINTS = HAND.joints
COUNT = len(JOINTS)
NOW_NS = 1_700_000_000_000_000_000
LIMIT_PA = float(HAND.limits.max_pressure_pa[0])


def message(
    pressure: Sequence[float], names: Sequence[str] = JOINTS, lifetime_s: float = 0.1, age_s: float = 0.0
) -> bytes:
    layout = Layout(VALVE_COMMAND, "", names, {"pressure": len(pressure)})
    stamp_ns = NOW_NS - round(age_s * 1e9)
    values = {"pressure": pressure} if len(pressure) else {}
    return layout.encode(stamp_ns, lifetime_ns=round(lifetime_s * 1e9), **values)


def read(raw: bytes, reader: CommandReader | None = None) -> SetPoints:
    return (reader or CommandReader(HAND)).read(raw, NOW_NS)


def swapped(index: int, value: float) -> list[float]:
    pressure = [1e5] * COUNT
    pressure[index] = value
    return pressure


def test_pressures_go_to_the_joints_that_are_named() -> None:
    """Fails when the order of the message, not its names, decides which valve gets which pressure."""
    pressure = [1e4 * (k + 1) for k in range(COUNT)]
    order = list(reversed(range(COUNT)))
    got = read(message([pressure[k] for k in order], [JOINTS[k] for k in order], lifetime_s=0.25))
    assert got.pressure_pa.tolist() == pressure
    assert got.lifetime_s == pytest.approx(0.25)
    assert got.stamp_ns == NOW_NS


def test_set_points_stay_when_the_next_message_comes() -> None:
    """Fails when set-points in use share memory with the message after them."""
    reader = CommandReader(HAND)
    first = read(message([1e5] * COUNT), reader)
    read(message([2e5] * COUNT), reader)
    assert first.pressure_pa.tolist() == [1e5] * COUNT


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, -1.0, LIMIT_PA + 1.0])
@pytest.mark.parametrize("index", [0, COUNT - 1])
def test_a_pressure_that_no_valve_may_get_refuses_the_whole(value: float, index: int) -> None:
    """Fails when one bad pressure among good ones passes, or its joint or range is not named."""
    with pytest.raises(RefusedError, match=rf"{JOINTS[index]} pressure .*range is 0 to {LIMIT_PA:g} Pa"):
        read(message(swapped(index, value)))


@pytest.mark.parametrize("value", [0.0, LIMIT_PA])
def test_the_ends_of_the_range_are_allowed(value: float) -> None:
    """Fails when venting or full pressure is refused."""
    assert read(message([value] * COUNT)).pressure_pa.tolist() == [value] * COUNT


@pytest.mark.parametrize(
    ("names", "line"),
    [
        (("index_middle", *JOINTS[1:]), "unknown joint 'index_middle'"),
        ((JOINTS[1], *JOINTS[1:]), f"joint '{JOINTS[1]}' appears twice"),
        (JOINTS[1:], f"joint '{JOINTS[0]}' is missing"),
    ],
)
def test_names_that_are_not_the_joints_are_refused(names: tuple[str, ...], line: str) -> None:
    """Fails when an unknown, doubled or missing joint leaves a valve with a guess."""
    with pytest.raises(RefusedError, match=line):
        read(message([1e5] * len(names), names))


@pytest.mark.parametrize("pressures", [0, 1, COUNT - 1, COUNT + 1])
def test_lengths_that_differ_are_refused(pressures: int) -> None:
    """Fails when a list that is too short or too long is cut or padded to the joints."""
    with pytest.raises(RefusedError, match=f"{COUNT} names but {pressures} pressures"):
        read(message([1e5] * pressures))


@pytest.mark.parametrize("lifetime_s", [0.0, -0.1, MAX_LIFETIME_S + 1e-6])
def test_a_lifetime_that_is_not_valid_is_refused(lifetime_s: float) -> None:
    """Fails when a set-point may stay for ever, or has ended before it begins."""
    with pytest.raises(RefusedError, match="allowed is above 0 to 1 s"):
        read(message([1e5] * COUNT, lifetime_s=lifetime_s))


@pytest.mark.parametrize(
    ("age_s", "line"), [(0.101, "0.101 s old"), (2.0, "2.000 s old"), (-FUTURE_S - 0.01, "0.110 s in the future")]
)
def test_a_stamp_of_another_time_is_refused(age_s: float, line: str) -> None:
    """Fails when a stale command, or one of another clock, reaches a valve."""
    with pytest.raises(RefusedError, match=line):
        read(message([1e5] * COUNT, lifetime_s=0.1, age_s=age_s))


@pytest.mark.parametrize("age_s", [0.099, -FUTURE_S + 0.001])
def test_a_stamp_within_its_limits_is_taken(age_s: float) -> None:
    """Fails when a command that is still good is refused for its stamp."""
    assert read(message([1e5] * COUNT, lifetime_s=0.1, age_s=age_s)).pressure_pa.tolist() == [1e5] * COUNT


def test_a_refusal_does_not_harm_the_next_command() -> None:
    """Fails when what was learned from a refused message decides over a good one, or the other way round."""
    reader = CommandReader(HAND)
    bad = [
        message([1e5] * COUNT, (JOINTS[1], *JOINTS[1:])),
        message([1e5] * 3, JOINTS[:3]),
        message(swapped(4, math.nan)),
    ]
    good = message([1e5 + 10.0 * k for k in range(COUNT)])
    for raw in bad:
        for _ in range(2):  # the second time it is a message already known
            with pytest.raises(RefusedError):
                read(raw, reader)
        assert read(good, reader).pressure_pa.tolist() == [1e5 + 10.0 * k for k in range(COUNT)]


@settings(deadline=None)
@given(st.data())
def test_damaged_messages_are_refused_or_within_limits(data: st.DataObject) -> None:
    """Fails when damaged bytes raise anything but a refusal, or get a pressure out of range through."""
    raw = bytearray(message([1e5] * COUNT))
    for _ in range(data.draw(st.integers(1, 4))):
        raw[data.draw(st.integers(0, len(raw) - 1))] ^= data.draw(st.integers(1, 255))
    cut = data.draw(st.integers(0, len(raw)))
    for damaged in (bytes(raw), bytes(raw[:cut])):
        try:
            got = read(damaged)
        except RefusedError as error:
            assert "\n" not in str(error)
            continue
        assert got.pressure_pa.shape == (COUNT,)
        assert np.all((got.pressure_pa >= 0.0) & (got.pressure_pa <= HAND.limits.max_pressure_pa))
        assert 0.0 < got.lifetime_s <= MAX_LIFETIME_S
