"""What version 0.1.0 wrote is still read: a recording, and the description of the hand that it was made with."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hand_model.description import load_hand
from hand_recording.hand_signals import hand_signals
from hand_recording.loader import load_recording
from hand_recording.replay import replay_recording
from hand_sim.plant import P

DATA = Path(__file__).with_name("data")


def test_a_recording_of_version_0_1_0_is_read() -> None:
    """Fails when a changed message type, topic or schema text makes a recording of version 0.1.0 unreadable."""
    hand = load_hand(DATA / "hand_0_1_0.yaml")
    recording = load_recording(DATA / "version_0_1_0.mcap")
    assert {name: len(topic) for name, topic in recording.topics.items()} == dict.fromkeys(
        ("joint_states", "pressures", "contact_forces", "adc", "valve_command"), 12
    )
    assert recording["joint_states"].names == hand.joints
    command = recording["valve_command"]
    assert np.allclose(command["pressure"], np.linspace(0.0, 3e5, 11))
    assert (command["lifetime_ns"] == 100_000_000).all()
    replayed = replay_recording(recording, hand)
    assert np.abs(replayed.states[-1, P] - recording["pressures"]["pressure"][-1]).max() < 5e4
    assert np.isfinite(recording["joint_states"]["position"]).all()


def test_a_short_recording_is_refused_by_its_length_and_not_by_its_version() -> None:
    """Fails when the data check refuses a recording of version 0.1.0 for anything but its 12 frames."""
    with pytest.raises(ValueError, match=r"12 samples over 0\.055 s; 2 s are needed"):
        hand_signals(load_recording(DATA / "version_0_1_0.mcap"), load_hand(DATA / "hand_0_1_0.yaml"))


def test_a_description_of_version_0_1_0_is_read() -> None:
    """Fails when a key of a hand.yaml of version 0.1.0 is unknown, missing or read in another unit."""
    hand = load_hand(DATA / "hand_0_1_0.yaml")
    assert len(hand.joints) == 11
    j = hand.joints.index("thumb_proximal")
    expected = {
        "dynamics.inertia_kg_m2": 1.2e-4,
        "statics.a2_nm_per_pa": 1.12e-6,
        "material.phi_max_deg": np.radians(60.0),
        "material.extension_time_s": 25.0,
        "valve.time_constant_s": 0.05,
        "end_stop.high_deg": np.radians(100.0),
        "supply.pressure_pa": 6e5,
    }
    assert {key: hand.row(key)[j] for key in expected} == pytest.approx(expected)
