"""The description of the hand in recordings that are made offline, read by rosbags."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability
from typer.testing import CliRunner

from hand_tool.cli import app
from test.nodes.viewer_paths import DIAGNOSTICS, check_foxglove, newest_of

TOPIC = "/hand/robot_description"


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_excite_and_simulate_record_what_the_3d_hand_needs(storage: str, tmp_path: Path) -> None:
    """Fails when an offline recording gives Foxglove no shape of the hand, or a player does not keep it for viewers."""
    made, replayed = tmp_path / "made", tmp_path / "replayed"
    for words in (
        ["excite", "steps", "--duration", "2", "--out", str(made), "--storage", storage],
        ["simulate", str(made), "--out", str(replayed), "--storage", storage],
    ):
        assert CliRunner().invoke(app, words).exit_code == 0
    for recording in (made, replayed):
        check_foxglove(newest_of(recording), without=("/hand/controller_state", DIAGNOSTICS))
        with AnyReader([recording]) as bag:
            (connection,) = (each for each in bag.connections if each.topic == TOPIC)
            ((_, stamp_ns, _),) = bag.messages([connection])
            assert stamp_ns == bag.start_time
            details: Any = connection.ext
            assert details.offered_qos_profiles[0].durability == QosDurability.TRANSIENT_LOCAL
