"""The pressures of a vented hand: what stays is named, what leaves is not, and what is not measured hides nothing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hand_control.vent_watch import VentWatch
from hand_model.arrays import Array
from hand_model.description import load_hand

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
COUNT = len(HAND.joints)
STILL = np.zeros(COUNT)
DT_S = 0.005


def watched(pressure_pa: Array, angle_rad: Array = STILL, seconds: float = 2.0) -> VentWatch:
    """A watch that has seen constant pressures (n,) [Pa]."""
    watch = VentWatch(HAND)
    for _ in range(round(seconds / DT_S)):
        watch.frame(angle_rad, pressure_pa, DT_S)
    return watch


def test_the_joint_whose_pressure_stays_is_named_although_others_are_not_measured() -> None:
    """Fails when a broken wire, for which a hand is vented, hides a valve that stays open at another joint."""
    pressure, angle = np.zeros(COUNT), np.zeros(COUNT)
    pressure[4], pressure[2], angle[7] = 1e5, np.nan, np.nan
    assert HAND.joints[4] in watched(pressure, angle).line
    assert "1.00 bar" in watched(pressure, angle).line
    assert watched(np.where(np.isfinite(pressure), 0.0, np.nan), angle).line == ""


@pytest.mark.parametrize("slower", [1.0, 2.0])
def test_a_pressure_that_leaves_is_not_reported(slower: float) -> None:
    """Fails when the vent of a valve as described, or twice as slow, is taken for a valve that stays open."""
    watch, pressure = VentWatch(HAND), np.full(COUNT, 5e5)
    lag_s = slower * (HAND.row("valve.time_constant_s") + HAND.row("valve.dead_time_s"))
    for _ in range(round(5.0 / DT_S)):
        watch.frame(STILL, pressure, DT_S)
        pressure = pressure * np.exp(-DT_S / lag_s)
        assert watch.line == ""


def test_the_time_begins_again_when_the_hand_is_driven() -> None:
    """Fails when a line of an earlier vent stays, or its time counts for the next one."""
    pressure = np.full(COUNT, 1e5)
    watch = watched(pressure)
    assert watch.line
    watch.forget()
    assert watch.line == ""
    for _ in range(round(0.4 / DT_S)):
        watch.frame(STILL, pressure, DT_S)
        assert watch.line == ""


def test_an_offset_within_the_band_is_no_pressure() -> None:
    """Fails when a sensor that is not calibrated is taken for a valve that stays open."""
    assert watched(np.full(COUNT, 1.5e4)).line == ""
