"""Real machines: reading their recordings, the rivals, the judgement, and a quick examination of a simulated axis."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io

from hand_machine.description import load_description
from hand_machine.reading import read_machine
from validation.machines import tables
from validation.machines.cases import Case, described_cases
from validation.machines.collect import collect, read_columns
from validation.machines.examine import examine, judged, published
from validation.machines.parts import friction_positions
from validation.machines.rivals import error, friction_model, rig_of

MACHINE = """schema: 1
name: axis
motion: linear
imposed: true
gain: {value: 1.0, exact: true}
stiffness: {value: 0.0, exact: true}
damping: {value: 0.0, exact: true}
inertia: {value: 2.0, tolerance: 0.1}
columns:
  time: {column: t, scale: 1.0}
  position: {column: x}
  force: {column: f}
"""
ALLOWED = {"Apache-2.0", "MIT", "BSD-3-Clause", "CC0-1.0", "CC-BY-SA-4.0", "ODbL-1.0", "GPL-3.0", "AGPL-3.0"}


def recorded(seed: int, frequency_hz: float) -> dict[str, np.ndarray]:
    """An axis of 2 kg with Coulomb friction of 8 N, moved by a rig: no viscous part, noise of 0.1 N."""
    t = np.arange(0.0, 16.0, 0.02)
    w = 2.0 * np.pi * frequency_hz
    x = 0.05 * np.sin(w * t) + 0.01 * np.sin(2.3 * w * t)
    v = 0.05 * w * np.cos(w * t) + 0.023 * w * np.cos(2.3 * w * t)
    a = -0.05 * w**2 * np.sin(w * t) - 0.0529 * w**2 * np.sin(2.3 * w * t)
    noise = 0.1 * np.random.default_rng(seed).standard_normal(len(t))
    return {"t": t, "x": x, "f": -2.0 * a - 8.0 * np.tanh(v / 1e-3) + noise}


def axis(folder: Path) -> tuple[Case, Path]:
    """The described axis with two training recordings and one of test data."""
    (folder / "axis").mkdir()
    names = ("slow.npz", "fast.npz", "other.npz")
    for k, (name, frequency_hz) in enumerate(zip(names, (0.3, 0.6, 0.45), strict=True)):
        columns = recorded(k, frequency_hz)
        np.savez(folder / "axis" / name, t=columns["t"], x=columns["x"], f=columns["f"])
    machine = folder / "machine.yaml"
    machine.write_text(MACHINE, encoding="utf-8")
    known = (frozenset({"coulomb_friction"}),)
    numbers = {"coulomb_friction.force_n": {"value": 8.0, "source": "as simulated"}}
    entries = {name: {"path": name} for name in names}
    return Case(
        name="axis",
        title="Axis",
        machine=machine,
        recordings=entries,
        test=names[2:],
        known=known,
        decoys=("stiffening",),
        published=numbers,
        tolerance=0.1,
        source={},
    ), folder


def test_columns_of_every_format() -> None:
    """Fails when a format, a range of rows, the means of blocks, an offset or a made time is read wrongly."""
    rows = np.column_stack([np.arange(8.0), 10.0 * np.arange(8.0)])
    text = "\n".join(" ".join(map(str, row)) for row in rows)
    mat = io.BytesIO()
    scipy.io.savemat(mat, {"a": rows[:, :1], "b": rows[:, 1:]})
    common = {"path": "file", "columns": ["b"], "names": ["a", "b"], "rows": [2, 7], "block": 2, "offsets": {"b": 5.0}}
    contents = {
        "csv": ('"a","b",\n' + text.replace(" ", ",")).encode(),
        "table": text.encode(),
        "json": json.dumps({"part": rows.tolist()}).encode(),
        "mat": mat.getvalue(),
    }
    for name, content in contents.items():
        found = read_columns(content, common | {"format": name, "key": "part"})
        assert found["b"].tolist() == [20.0, 40.0], name
    timed = read_columns(contents["table"], common | {"format": "table", "sample_period_s": 0.5})
    assert timed["t"].tolist() == [1.25, 2.25]
    with pytest.raises(ValueError, match="file has no column c; it has: a, b"):
        read_columns(contents["table"], common | {"format": "table", "columns": ["c"]})


def test_columns_of_unusual_files() -> None:
    """Fails when given names, an empty place, a delimiter, comments, nested values or constants are read wrongly."""
    given = {"path": "file", "format": "csv", "names": ["x", "y"], "columns": ["y", "u"], "constants": {"u": 2.0}}
    found = read_columns(b"Trial 1_x,Trial 1_y\n0,5\n1,\n", given)
    assert found["y"][0] == 5.0 and np.isnan(found["y"][1])
    assert found["u"].tolist() == [2.0, 2.0]
    spaced = read_columns(b"Time/s,Angle of it\n0,5\n1,6\n", {"path": "f", "format": "csv", "columns": ["Angle of it"]})
    assert spaced["Angle of it"].tolist() == [5.0, 6.0]
    table = {
        "path": "file",
        "format": "table",
        "delimiter": ",",
        "comments": "%",
        "names": ["a", "b"],
        "columns": ["b"],
    }
    assert read_columns(b"%head\n1,2\n3,4\n", table)["b"].tolist() == [2.0, 4.0]
    mat, cells = io.BytesIO(), np.empty(2, dtype=object)
    cells[:] = [np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([[5.0, 6.0], [7.0, 8.0]])]
    scipy.io.savemat(mat, {"runs": cells, "log": {"signals": {"values": np.arange(2.0)}}})
    places = {"x": ["runs", 1, 0], "t": ["log", "signals", "values"]}
    nested = read_columns(mat.getvalue(), {"path": "f", "format": "mat", "places": places, "columns": ["x", "t"]})
    assert [nested["x"].tolist(), nested["t"].tolist()] == [[5.0, 6.0], [0.0, 1.0]]


def test_recordings_come_from_the_commit_of_a_clone(tmp_path: Path) -> None:
    """Fails when a recording is read from the work tree, or a missing clone is passed over in silence."""
    clone = tmp_path / "clones" / "maker+rig"
    clone.mkdir(parents=True)

    def git(*arguments: str) -> str:
        own = ("-c", "user.name=x", "-c", "user.email=x@y.z")
        done = subprocess.run(["git", "-C", str(clone), *own, *arguments], capture_output=True, text=True, check=True)
        return done.stdout.strip()

    git("init", "-q")
    (clone / "run.txt").write_text("0 1\n1 2\n", encoding="utf-8")
    git("add", "-A")
    git("commit", "-qm", "Add a run")
    (clone / "run.txt").write_text("5 5\n5 5\n", encoding="utf-8")
    recording = {"path": "run.txt", "format": "table", "names": ["t", "x"], "columns": ["x"]}
    source = {"repository": "maker/rig", "commit": git("rev-parse", "HEAD")}
    case = Case(
        name="rig",
        title="Rig",
        machine=tmp_path / "m.yaml",
        recordings={"run.npz": recording},
        test=(),
        known=(),
        decoys=(),
        published={},
        tolerance=0.1,
        source=source,
    )
    other = Case(
        name="gone",
        title="Gone",
        machine=tmp_path / "m.yaml",
        recordings={},
        test=(),
        known=(),
        decoys=(),
        published={},
        tolerance=0.1,
        source={"repository": "maker/gone"},
    )
    lines = collect([case, other], tmp_path / "clones", tmp_path / "data", lambda _: None)
    assert lines == [f"gone: no clone of maker/gone in {tmp_path / 'clones'}"]
    with np.load(tmp_path / "data" / "rig" / "run.npz") as found:
        assert found["x"].tolist() == [1.0, 2.0]


def test_every_described_machine_can_be_read() -> None:
    """Fails for a machine file with an error, columns that are not collected, or a licence that forbids passing on."""
    cases = described_cases()
    assert len(cases) >= 8
    for case in cases:
        described = load_description(case.machine)
        assert described.name == case.name
        assert case.source["licence"] in ALLOWED
        assert case.train
        assert case.test
        wanted = {column.name for column in described.columns.values()}
        for recording in case.recordings.values():
            made = {"t"} if "sample_period_s" in recording else set()
            assert wanted <= {*recording["columns"], *made}, case.name
            assert set(recording.get("constants", {})) <= set(recording["columns"]), case.name


def test_a_simulated_oscillator_is_the_closed_form() -> None:
    """Fails for an integrator of an order below three, or a wrong sign of stiffness, damping or gain."""
    h, count = 0.01, 400
    numbers = np.array([2.0, 9.0, 0.6, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    t = h * np.arange(count)
    rate, decay = np.sqrt(9.0 - 0.09), 0.3
    rest = 2.0 * 1.5 / 9.0
    exact = rest + np.exp(-decay * t) * (-rest * np.cos(rate * t) - decay * rest / rate * np.sin(rate * t))
    found = friction_positions(0.0, 0.0, np.full(count, 1.5), h, 1, numbers)
    assert np.abs(found - exact).max() < 1e-6


def test_rivals_of_a_driven_axis(tmp_path: Path) -> None:
    """Fails when a simulated rival is not given its best: the right friction must come down to the noise."""
    still, h = 0.01, 0.01
    numbers = np.array([1.0, 40.0, 1.0, 0.5, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, still])
    described = MACHINE.replace("imposed: true", "imposed: false").replace(
        "  force: {column: f}", "  input: {column: u}"
    )
    described = described.replace("stiffness: {value: 0.0, exact: true}", "stiffness: 40.0").replace("2.0", "0.5")
    machine = tmp_path / "machine.yaml"
    machine.write_text(described.replace("damping: {value: 0.0, exact: true}", "damping: 1.0"), encoding="utf-8")
    t = np.arange(0.0, 10.0, h)
    paths = [tmp_path / f"{k}.npz" for k in range(2)]
    for k, path in enumerate(paths):
        u = 8.0 * np.sin((1.1 + 0.3 * k) * t) + 4.0 * np.sin((3.1 + k) * t)
        x = friction_positions(0.0, 0.0, u, h, 4, numbers)
        np.savez(path, t=t, u=u, x=x + 1e-4 * np.random.default_rng(k).standard_normal(len(t)))
    loaded = load_description(machine)
    first, second = (read_machine(loaded, path) for path in paths)
    rig, fitted, tested = rig_of(loaded, [first], [second])
    right = error(friction_model(rig, fitted, ("coulomb",)), tested)
    assert right < 1e-3
    assert error(friction_model(rig, fitted, None), tested) > 5.0 * right


def test_a_judgement_counts_classes_parts_and_decoys(tmp_path: Path) -> None:
    """Fails when a part of an unknown counts as named, a decoy below 0.5 as accepted, or a class as two effects."""
    known = (frozenset({"coulomb_friction"}), frozenset({"contact", "stiffening"}))
    case = Case(
        name="m",
        title="M",
        machine=tmp_path / "m.yaml",
        recordings={},
        test=(),
        known=known,
        decoys=("creep", "backlash"),
        published={},
        tolerance=0.1,
        source={},
    )
    finding = {"effect": "stiffening", "probability": 0.7, "parameters": {}}
    decoy = {"effect": "creep", "probability": 0.4, "parameters": {}}
    stamps = {"effect": "dropped_frames", "probability": 1.0, "parameters": {}}
    named = judged(case, {"findings": [stamps, finding, decoy], "remainder": []})
    assert named["found"] == ["contact | stiffening"]
    assert named["right"]
    assert not named["partly"]
    assert named["decoys_taken"] == []
    part = {"candidates": [{"effect": "coulomb_friction", "probability": 0.3}, {"effect": "creep", "probability": 0.6}]}
    unknown = judged(case, {"findings": [], "remainder": [part]})
    assert (unknown["found"], unknown["in_part"], unknown["partly"]) == ([], ["coulomb_friction"], True)
    assert unknown["decoys_taken"] == ["creep"]


def test_published_numbers_within_two_standard_errors(tmp_path: Path) -> None:
    """Fails when a number three errors away agrees, or one that was not found counts as wrong or right."""
    numbers = {key: {"value": 1.0, "source": "s"} for key in ("near", "far", "absent")}
    case = Case(
        name="m",
        title="M",
        machine=tmp_path / "m.yaml",
        recordings={},
        test=(),
        known=(),
        decoys=(),
        published=numbers,
        tolerance=0.1,
        source={},
    )
    ours = {"near": {"value": 1.15, "std": 0.1, "unit": "N"}, "far": {"value": 1.3, "std": 0.1, "unit": "N"}}
    rows = published(case, {"findings": [{"parameters": ours}]}, {})
    assert [row["agrees"] for row in rows] == [True, False, None]


STAND_IN = """
import json, sys
from pathlib import Path

step, rest = sys.argv[1], sys.argv[2:]
recordings = [Path(name).name for name in rest if name.endswith(".npz")]
if step == "diagnose":
    assert recordings == ["slow.npz", "fast.npz"], recordings
    out = Path(rest[rest.index("--out") + 1])
    out.mkdir(parents=True)
    (out / "model.yaml").write_text("effects: {}")
    number = {"value": 8.2, "std": 0.2, "unit": "N"}
    finding = {"effect": "coulomb_friction", "probability": 0.9, "statement": "said"}
    finding["parameters"] = {"coulomb_friction.force_n": number}
    report = {"verdict": "explained", "remainder": [], "findings": [finding]}
    print(json.dumps(report))
else:
    assert recordings == ["other.npz"], recordings
    found = "out" in Path(rest[rest.index("--model") + 1]).parts
    rows = [{"rmse": error, "noise_floor": 0.1, "unit": "N"} for error in (0.3 if found else 6.0, 0.0)]
    rows[0]["samples"], rows[1]["samples"] = 300, 100
    print(json.dumps({"scores": rows}))
"""


def examined(folder: Path, command: list[str]) -> dict[str, Any]:
    """The entry of the axis, with its tables rendered."""
    case, data = axis(folder)
    found = examine(case, data, folder / "out", command)
    assert found["right"]
    assert found["decoys_taken"] == []
    entry = {"results": {"machines": [found], "failed": [{"title": "Rig", "error": "no data"}]}}
    text = tables.machines_table({**entry, "command": "make machines", "date": "d", "commit": "c"})
    assert "| Axis | " in text
    assert "- Rig: no data" in text
    first = {"results": [{**found, "first_run": {"date": "2026-01-01", "commit": "abc"}}]}
    assert "| Axis | 2026-01-01 | abc |" in tables.first_runs_table(first)
    first["results"][0]["ours"] = None  # no model that predicts
    assert tables.first_runs_table(first).endswith("| none |  |")
    return found


def test_an_examination_with_a_stand_in_for_the_tool(tmp_path: Path) -> None:
    """Fails when test recordings reach the diagnosis, errors are pooled wrongly, or a rival is not given its best.

    Recordings have fixed seeds.
    """
    script = tmp_path / "stand_in.py"
    script.write_text(STAND_IN, encoding="utf-8")
    found = examined(tmp_path, [sys.executable, str(script)])
    assert found["ours"] == pytest.approx(0.3 * np.sqrt(0.75))
    assert found["nominal"] == pytest.approx(6.0 * np.sqrt(0.75))
    assert found["published"][0]["agrees"]
    assert set(found["rivals"]) == set(tables.RIVALS)
    assert found["rivals"]["best of six"] < 0.15 * found["rivals"]["re-identified"]


@pytest.mark.long
def test_an_examination(tmp_path: Path) -> None:
    """Fails when the diagnosis does not name friction of an axis that has nothing else, or its model does not predict.

    Recordings have fixed seeds.
    """
    found = examined(tmp_path, [sys.executable, "-m", "hand_tool"])
    assert found["ours"] < 0.25 * found["nominal"]
