"""Health of the driver: each fault in its own status with its level, and no message after it has ended."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hand_driver.board import Frame, LinkCounters, Status
from hand_driver.driver_health import RATE_WINDOW_S, REFUSAL_S, SILENCE_S, DriverHealth, LinkState
from hand_messages.health import Health, Level
from hand_model.description import load_hand

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
PARTS = ["link", "frames", "supply", "channels", "board", "commands"]
FINE = Status(0)


def frame(supply_v: float = 5.0, status: Status = FINE) -> Frame:
    return Frame(7, 0, supply_v, status, np.zeros(HAND.channel_count, np.uint16), 0)


def link(frames: int = 0, dropped: int = 0, corrupt: int = 0) -> LinkState:
    return LinkState(up=True, counters=LinkCounters(frames, dropped, corrupt))


def by_name(statuses: list[Health]) -> dict[str, Health]:
    return {status.name: status for status in statuses}


def after(seconds: float, rate_hz: float = 200.0, losses: dict[str, int] | None = None) -> Health:
    """Status of the frames after some time at a rate; losses all come in the first second."""
    health = DriverHealth(HAND, 0.0)
    status = Health("none", Level.STALE, "")
    for k in range(round(seconds * 10) + 1):
        now_s = k / 10
        lost = losses if losses and now_s >= 1.0 else {}
        health.frame(frame(), [], now_s)
        status = by_name(health.statuses(link(round(rate_hz * now_s), **lost), now_s))["frames"]
    return status


def test_a_good_link_is_ok_everywhere() -> None:
    """Fails when a healthy driver complains, or a part is missing."""
    health = DriverHealth(HAND, 0.0)
    for k in range(400):
        health.frame(frame(), [], k / 200)
    statuses = health.statuses(link(400), 2.0)
    assert [status.name for status in statuses] == PARTS
    assert {status.level for status in statuses} == {Level.OK}


def test_before_the_first_frame_nothing_is_claimed() -> None:
    """Fails when what was never measured is called good or bad."""
    said = by_name(DriverHealth(HAND, 0.0).statuses(LinkState(), 0.0))
    assert [said[part].level for part in ("supply", "channels", "board")] == [Level.STALE] * 3
    assert (said["link"].level, said["link"].message) == (Level.WARN, "connecting")


def test_a_lost_link_says_why() -> None:
    """Fails when the line of the error does not reach the user."""
    state = LinkState(up=False, reconnects=3, error="serial port /dev/x is gone")
    said = by_name(DriverHealth(HAND, 0.0).statuses(state, 0.0))["link"]
    assert (said.level, said.message, said.values["reconnects"]) == (Level.ERROR, state.error, "3")


@pytest.mark.parametrize(("silence_s", "level"), [(SILENCE_S - 0.001, Level.OK), (SILENCE_S + 0.001, Level.ERROR)])
def test_silence_on_an_open_link_is_an_error(silence_s: float, level: Level) -> None:
    """Fails when a board without power looks connected, or a frame that is a little late alarms."""
    health = DriverHealth(HAND, 0.0)
    health.frame(frame(), [], 5.0)
    assert by_name(health.statuses(link(), 5.0 + silence_s))["link"].level == level


@pytest.mark.parametrize(("rate_hz", "level"), [(200.0, Level.OK), (185.0, Level.OK), (150.0, Level.WARN)])
def test_the_rate_is_compared_with_the_description(rate_hz: float, level: Level) -> None:
    """Fails when a slow board is called healthy, or the rate shown is not the one of the last seconds."""
    said = after(3.0, rate_hz)
    assert said.level == level
    assert float(said.values["rate_hz"]) == pytest.approx(rate_hz, rel=0.02)


@pytest.mark.parametrize(("kind", "words"), [("dropped", "missing"), ("corrupt", "cable")])
def test_losses_warn_while_they_are_recent_and_stay_counted(kind: str, words: str) -> None:
    """Fails when a loss is not reported, is blamed on something else, or warns for ever."""
    now = after(1.5, losses={kind: 3})
    assert now.level == Level.WARN
    assert words in now.message
    later = after(1.0 + RATE_WINDOW_S + 0.5, losses={kind: 3})
    assert (later.level, later.values[kind]) == (Level.OK, "3")


@pytest.mark.parametrize(
    ("supply_v", "level"),
    [(5.0, Level.OK), (4.6, Level.OK), (4.4, Level.WARN), (5.6, Level.WARN), (3.9, Level.ERROR), (6.1, Level.ERROR)],
)
def test_the_sensor_supply_is_checked_both_ways(supply_v: float, level: Level) -> None:
    """Fails when a sagging or an excessive supply passes."""
    health = DriverHealth(HAND, 0.0)
    health.frame(frame(supply_v), [], 0.0)
    assert by_name(health.statuses(link(), 0.0))["supply"].level == level


def test_channels_at_the_rail_are_named_until_they_recover() -> None:
    """Fails when a broken wire is not named, or stays named after its repair."""
    health = DriverHealth(HAND, 0.0)
    health.frame(frame(), ["index_proximal angle", "palm_pad force"], 0.0)
    said = by_name(health.statuses(link(), 0.0))["channels"]
    assert said.level == Level.ERROR
    assert "index_proximal angle, palm_pad force" in said.message
    health.frame(frame(), [], 0.1)
    assert by_name(health.statuses(link(), 0.1))["channels"].level == Level.OK


@pytest.mark.parametrize(
    ("status", "level", "words"),
    [
        (Status(0), Level.OK, ("driving",)),
        (Status.VENTED, Level.OK, ("vented",)),
        (Status.SUPPLY_LOW, Level.ERROR, ("pressure supply",)),
        (Status.OVER_PRESSURE, Level.ERROR, ("over its pressure limit",)),
        (Status.ADC_FAULT, Level.ERROR, ("converter",)),
        (Status.VENTED | Status.SUPPLY_LOW | Status.ADC_FAULT, Level.ERROR, ("pressure supply", "converter")),
    ],
)
def test_every_fault_bit_of_the_board_has_its_words(status: Status, level: Level, words: tuple[str, ...]) -> None:
    """Fails when a fault of the board is not reported, or hides another one."""
    health = DriverHealth(HAND, 0.0)
    health.frame(frame(status=status), [], 0.0)
    said = by_name(health.statuses(link(), 0.0))["board"]
    assert said.level == level
    assert all(word in said.message for word in words)


@pytest.mark.parametrize(("asking", "level"), [(True, Level.WARN), (False, Level.OK)])
def test_a_board_that_vents_against_its_set_points_is_a_warning(asking: bool, level: Level) -> None:
    """Fails when the watchdog of the board vents a hand that is driven and the status stays good."""
    health = DriverHealth(HAND, 0.0)
    health.asked(asking, 1.0)
    health.frame(frame(status=Status.VENTED), [], 1.0 + SILENCE_S + 0.01)
    said = by_name(health.statuses(link(), 1.0 + SILENCE_S + 0.01))["board"]
    assert said.level == level
    assert ("vented by its watchdog" in said.message) == asking


def test_a_refused_command_shows_for_a_while_and_stays_counted() -> None:
    """Fails when a refusal is not reported, or looks current long after."""
    health = DriverHealth(HAND, 0.0)
    health.refused("valve_command refused: lifetime is 0 s", 10.0)
    said = by_name(health.statuses(link(), 10.0 + REFUSAL_S - 0.1))["commands"]
    assert (said.level, said.message) == (Level.ERROR, "valve_command refused: lifetime is 0 s")
    later = by_name(health.statuses(link(), 10.0 + REFUSAL_S + 0.1))["commands"]
    assert (later.level, later.values["refused"]) == (Level.OK, "1")
