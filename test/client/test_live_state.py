"""The live state of a hand from its messages, at times that the test chooses."""

from __future__ import annotations

import json
import math

import pytest

from hand_client.live_state import ERROR, LiveState

JOINTS = ("index_proximal", "index_distal")
MS = 1_000_000


def test_rate_and_latency_are_those_of_the_stamps() -> None:
    """Fails when the rate is that of arrival, or does not begin again with a restarted clock."""
    state = LiveState()
    for index in range(1001):
        state.frame(JOINTS, (0.1, 0.2), index * 4 * MS, index * 4 * MS + 3 * MS)
    assert state.rate_hz == pytest.approx(250.0)
    assert state.latency_s == pytest.approx(0.003)
    for index in range(1001):  # stamps go back: a hand that was started again, at another rate
        state.frame(JOINTS, (0.1, 0.2), index * 2 * MS, index * 2 * MS)
    assert state.rate_hz == pytest.approx(500.0)


def test_what_is_unknown_is_null_for_machines() -> None:
    """Fails when NaN reaches JSON, or a value of another joint or field does."""
    state = LiveState()
    state.frame(JOINTS, (0.1, math.nan), 0, 0)
    state.take("pressure", reversed(JOINTS), (2e5, 1e5))  # type: ignore[arg-type]
    known = json.loads(json.dumps(state.as_json(), allow_nan=False))
    assert known["rate_hz"] is None
    first, second = (known["joints"][joint] for joint in JOINTS)
    assert (first["angle_rad"], first["pressure_pa"], first["torque_nm"]) == (0.1, 1e5, None)
    assert (second["angle_rad"], second["pressure_pa"], second["contact"]) == (None, 2e5, False)


def test_safety_and_problems_are_those_of_the_newest_statuses() -> None:
    """Fails when a hand that is vented counts as driven, one with late data does not, or a warning is a problem."""
    state = LiveState()
    assert (state.safety, state.controlling, state.vented) == ("", False, False)
    state.statuses["controller: safety"] = (0, "controlling")
    assert state.controlling and state.driven and not state.vented and state.problems == []
    state.statuses["controller: safety"] = (1, "sensor data is late")
    assert state.driven and not state.controlling and not state.vented and state.problems == []
    state.statuses["driver: frames"] = (1, "frames are missing")
    state.statuses["controller: safety"] = (ERROR, "vented: emergency stop")
    assert state.vented and not state.controlling and not state.driven
    assert state.problems == ["controller: safety: vented: emergency stop"]
