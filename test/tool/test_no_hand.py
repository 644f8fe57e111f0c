"""Commands for a running hand, where none runs: these tests keep no deadlines and run next to others."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

TOOL = (sys.executable, "-m", "hand_tool")


def test_an_experiment_without_a_hand_is_one_line(tmp_path: Path) -> None:
    """Fails when an experiment without a hand hangs, or ends without saying so."""
    command = [*TOOL, "excite", "steps", "--joints", "index_distal", "--live", "--out", str(tmp_path / "x.mcap")]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=90, check=False)
    assert ran.returncode == 2
    assert "no joint_states" in ran.stderr.strip().splitlines()[-1]
