"""Contact from the model and from force sensors: fusion, hysteresis, age, and the events."""

from __future__ import annotations

import math
import secrets
from pathlib import Path

import numpy as np
import pytest

from hand_control.contact_monitor import ContactMonitor, Event
from hand_model.arrays import Array
from hand_model.description import load_hand

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
COUNT, SITES = len(HAND.joints), HAND.sensors.sites
MS = 1_000_000
INDEX = HAND.joints.index("index_proximal")
PAD = SITES.index("index_proximal_pad")


def forces(**pads: float) -> Array:
    values = np.zeros(len(SITES))
    for pad, value in pads.items():
        values[SITES.index(pad)] = value
    return values


def one(joint: int, value: float = 1.0) -> Array:
    values = np.zeros(COUNT)
    values[joint] = value
    return values


def updated(
    monitor: ContactMonitor, stamp_ms: int, model: Array | None = None, age_s: float = 0.0, nm: float = 0.0
) -> list[Event]:
    by_model = np.zeros(COUNT) if model is None else model
    monitor.update(stamp_ms * MS, by_model, np.full(COUNT, age_s), np.full(COUNT, nm))
    return monitor.take()


def test_a_contact_of_the_model_has_the_onset_of_its_age() -> None:
    """Fails when joint, onset, torque, source or delay of the event is wrong, or the event comes twice."""
    monitor = ContactMonitor(HAND)
    (event,) = updated(monitor, 1000, one(INDEX), 0.13, 0.07)
    assert (event.joint, event.touching, event.onset_ns) == (INDEX, True, 870 * MS)
    assert (event.torque_nm, event.source) == (0.07, "model") and event.delay_s == pytest.approx(0.13)
    assert math.isnan(event.force_n)
    assert monitor.contact[INDEX] and monitor.contact.sum() == 1
    assert updated(monitor, 1005, one(INDEX), 0.135, 0.07) == []
    (end,) = updated(monitor, 1010, None, 0.5, math.nan)
    assert (end.touching, end.onset_ns, end.delay_s, end.source, end.torque_nm) == (False, 1010 * MS, 0.0, "", 0.0)
    assert not monitor.contact.any()


def test_a_force_above_the_threshold_is_a_contact_from_its_stamp_on() -> None:
    """Fails when a force is ignored, belongs to another joint, or its onset is not the stamp of the first reading."""
    monitor = ContactMonitor(HAND)
    monitor.forces(1000 * MS, forces(index_proximal_pad=0.51), 0.5)
    monitor.forces(1004 * MS, forces(index_proximal_pad=0.8), 0.5)
    (event,) = updated(monitor, 1010)
    assert (event.joint, event.touching, event.onset_ns, event.force_n) == (INDEX, True, 1000 * MS, 0.8)
    assert event.source == "force" and event.delay_s == pytest.approx(0.010)


def test_a_reading_newer_than_the_frame_begins_with_the_frame() -> None:
    """Fails when a late frame gives a contact that begins after its detection, or its reading is lost."""
    monitor = ContactMonitor(HAND)
    monitor.forces(1020 * MS, forces(index_proximal_pad=0.8), 0.5)
    (event,) = updated(monitor, 1000)
    assert (event.onset_ns, event.delay_s, event.source) == (1000 * MS, 0.0, "force")


def test_a_force_at_the_threshold_is_none() -> None:
    """Fails when the threshold itself, or a smaller force, starts a contact."""
    monitor = ContactMonitor(HAND)
    monitor.forces(1000 * MS, forces(index_proximal_pad=0.5), 0.5)
    assert updated(monitor, 1001) == []


def test_both_sources_are_named_and_the_earlier_one_is_the_onset() -> None:
    """Fails when one source hides the other, or the later onset is reported."""
    for age_s, onset in ((0.05, 960), (0.02, 980)):
        monitor = ContactMonitor(HAND)
        monitor.forces(980 * MS, forces(index_proximal_pad=1.0), 0.5)
        (event,) = updated(monitor, 1010, one(INDEX), age_s)
        assert event.source == "model and force" and event.onset_ns == onset * MS


def test_a_contact_ends_below_half_the_threshold() -> None:
    """Fails when noise at the threshold switches the contact, or it does not end."""
    monitor = ContactMonitor(HAND)
    monitor.forces(1000 * MS, forces(index_proximal_pad=0.6), 0.5)
    assert len(updated(monitor, 1000)) == 1
    monitor.forces(1010 * MS, forces(index_proximal_pad=0.26), 0.5)
    assert updated(monitor, 1010) == []
    monitor.forces(1020 * MS, forces(index_proximal_pad=0.6), 0.5)
    assert updated(monitor, 1020) == []
    monitor.forces(1030 * MS, forces(index_proximal_pad=0.24), 0.5)
    (end,) = updated(monitor, 1030)
    assert not end.touching and end.force_n == 0.24
    monitor.forces(1040 * MS, forces(index_proximal_pad=0.6), 0.5)
    (again,) = updated(monitor, 1045)
    assert again.onset_ns == 1040 * MS


def test_readings_are_used_for_100_ms() -> None:
    """Fails when a silent sensor holds a contact for longer, or loses it earlier."""
    monitor = ContactMonitor(HAND)
    monitor.forces(1000 * MS, forces(index_proximal_pad=0.9), 0.5)
    assert len(updated(monitor, 1000)) == 1
    assert updated(monitor, 1100) == []
    (end,) = updated(monitor, 1101)
    assert not end.touching and math.isnan(end.force_n)


def test_a_reading_of_a_clock_that_is_ahead_is_not_used() -> None:
    """Fails when a stamp in the future holds a contact that nothing can end any more."""
    monitor = ContactMonitor(HAND)
    monitor.forces(1101 * MS, forces(index_proximal_pad=0.9), 0.5)
    assert updated(monitor, 1000) == []


def test_a_failed_sensor_is_no_force() -> None:
    """Fails when NaN counts as contact."""
    monitor = ContactMonitor(HAND)
    monitor.forces(1000 * MS, np.full(len(SITES), math.nan), 0.5)
    assert updated(monitor, 1000) == []


def test_a_release_ends_every_contact_without_an_event() -> None:
    """Fails when a vented hand keeps a contact, or reports the end of one that it caused itself."""
    monitor = ContactMonitor(HAND)
    monitor.forces(1000 * MS, forces(index_proximal_pad=0.9), 0.5)
    updated(monitor, 1000, one(2))
    assert monitor.contact.sum() == 2
    monitor.release()
    assert not monitor.contact.any()
    assert updated(monitor, 1005) == []


def test_every_site_of_a_joint_counts_with_its_largest_force() -> None:
    """Fails when the last site overwrites the largest force, or a site without a joint is used."""
    monitor = ContactMonitor(HAND)
    values = np.linspace(0.6, 2.0, len(SITES))
    monitor.forces(1000 * MS, values, 0.5)
    events = {event.joint: event.force_n for event in updated(monitor, 1000)}
    wanted: dict[int, float] = {}
    for site, joint in enumerate(HAND.sensors.site_joint):
        if joint >= 0:
            wanted[int(joint)] = max(wanted.get(int(joint), 0.0), float(values[site]))
    assert events == wanted


def test_the_readings_of_many_frames_are_those_of_the_plain_equations() -> None:
    """Fails when the compiled loop over sites and joints gives another contact or onset than arrays as a whole."""
    seed = secrets.randbits(32)
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    monitor, pressed = ContactMonitor(HAND), np.zeros(COUNT, dtype=np.bool_)
    onset = np.zeros(COUNT, dtype=np.int64)
    for number in range(1, 400):
        values = np.where(rng.random(len(SITES)) < 0.1, math.nan, rng.uniform(0.0, 1.0, len(SITES)))
        force = np.full(COUNT, math.nan)
        for site, joint in enumerate(HAND.sensors.site_joint):
            force[joint] = np.fmax(force[joint], values[site]) if joint >= 0 else force[joint]
        above = force > 0.5
        onset[above & ~pressed] = number * MS
        pressed = above | (pressed & (force > 0.25))
        monitor.forces(number * MS, values, 0.5)
        before = monitor.contact.copy()
        events = updated(monitor, number)
        np.testing.assert_array_equal(monitor.contact, pressed)
        assert [event.joint for event in events] == np.flatnonzero(before != pressed).tolist()
        assert all(event.onset_ns == onset[event.joint] for event in events if event.touching)
