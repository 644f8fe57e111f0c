"""Many recordings on a real cluster of worker processes; an interrupted run resumes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from hand_diagnosis.fleet import report_folder
from hand_model.description import load_hand
from hand_recording.replay import record_offline
from hand_tool.cli import app
from test.diagnosis.clusters import cluster
from test.diagnosis.recordings import CONFIG, changed, excitation


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two hands with friction at one joint, one without, and a file that is not a recording."""
    folder = tmp_path_factory.mktemp("fleet")
    hand = load_hand(CONFIG)
    rubbing = changed(hand, "index_distal", coulomb_friction__torque_nm=0.01)
    paths = []
    for number, recorded in enumerate((rubbing, hand, rubbing)):
        paths.append(folder / f"hand_{number}.mcap")
        for _ in record_offline(recorded, excitation(np.random.default_rng(number), 16.0, 11), paths[-1], seed=number):
            pass
    bad = folder / "hand_3.mcap"
    bad.write_text("nothing\n", encoding="utf-8")
    return [*paths, bad]


def fleet(recordings: list[Path], out: Path, *options: str) -> dict[str, object]:
    names = [str(path) for path in recordings]
    command = ["diagnose", *names, "--model", str(CONFIG), "--out", str(out), "--joints", "index_distal", "--json"]
    result = CliRunner().invoke(app, [*command, *options])
    assert result.exit_code == 0, result.output
    content: dict[str, object] = json.loads(result.output.splitlines()[-1])
    return content


def test_a_cluster_of_processes_gives_the_table_and_resumes(recordings: list[Path], tmp_path: Path) -> None:
    """Fails when a worker's result is lost, a bad recording stops the rest, or finished work is done again.

    Also where recordings in another order are diagnosed again, or one that agrees has no detection limits.
    """
    out = tmp_path / "out"
    fleet(recordings[:1], out, "--each")
    folders = [report_folder(path, out) for path in recordings]
    done = (folders[0] / "report.json").stat().st_mtime_ns
    with cluster(tmp_path, workers=2) as address:
        summary = fleet(recordings[::-1], out, "--scheduler", address)  # another order, and more of them
    reports = [json.loads((folder / "report.json").read_text("utf-8")) for folder in folders[:3]]
    assert [bool(report["detection_limits"]) for report in reports] == [False, True, False]
    assert 'id="limits"' in (folders[1] / "report.html").read_text("utf-8")
    assert [report["recorded"] for report in reports] == [["2023-11-14T22:13:20+00:00"]] * 3  # of replay.START_NS
    made = [report["made"] for report in reports]
    assert all(entry["version"] and entry["model_sha256"] and entry["seed"] == 0 for entry in made)
    assert all(entry["duration_s"] > 0.0 and entry["date"].startswith("20") for entry in made)
    assert len({entry["date"] for entry in made}) >= 2  # the first one was resumed
    assert summary["recordings"] == 4
    assert summary["verdicts"] == {"explained": 2, "agrees": 1, "unusable": 1}
    assert summary["by_joint"] == {"index_distal: coulomb_friction": 2}
    table = pq.read_table(out / "findings.parquet").to_pylist()
    assert [row["verdict"] for row in table] == ["explained", "agrees", "explained", "unusable"]
    assert "hand_3.mcap" in table[3]["error"]
    assert "2 of 4 recordings differ from the model; 1 could not be used" in (out / "index.html").read_text("utf-8")
    assert (folders[0] / "report.json").stat().st_mtime_ns == done
