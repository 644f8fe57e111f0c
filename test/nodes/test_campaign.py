"""The campaign of faults and the soak on real processes, in their shortest forms."""

from __future__ import annotations

import json
from pathlib import Path

from validation.faults import processes
from validation.faults.result import Size
from validation.faults.soak import main


def test_a_killed_controller_vents_and_drives_only_on_request() -> None:
    """Fails when the board keeps the pressure of a killed controller, or a restart drives the hand."""
    (result,) = processes.run(Size.QUICK, 1)
    assert result.passed, result.unhandled
    assert result.max_s is not None and result.worst is not None


def test_the_shortest_soak_samples_every_process(tmp_path: Path) -> None:
    """Fails when the soak finds a latch or growth in seconds, or leaves a process, the frames or the file out."""
    out = tmp_path / "soak.json"
    code = main(["--hours", "0.002", "--out", str(out)])
    soak = json.loads(out.read_text(encoding="utf-8"))["soak"]
    print(soak["faults"])
    assert code == (1 if soak["faults"] else 0)
    assert not soak["latches"]
    assert set(soak["growth_mb"]) == set(soak["cpu"]) == {"simulation", "controller", "recorder"}
    assert min(soak["rss_mb"].values()) > 10.0 and soak["file_mb_per_hour"] > 0.0
    assert soak["frames"] > 500 and soak["motions"] > 1
