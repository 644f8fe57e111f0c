"""`hand patch` as a user runs it: refused input, and a change that gives no valid model."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from hand_tool.cli import app

CONFIG = Path(__file__).resolve().parents[2] / "config" / "hand.yaml"


def write(path: Path, changes: str) -> Path:
    """A patch with these changes."""
    path.write_text(f"schema: 1\nmodel: hand.yaml\nsha256: 0\nchanges: {changes}\n", encoding="utf-8")
    return path


def test_a_change_is_written_to_another_file(tmp_path: Path) -> None:
    """Fails when --out changes the model itself, or a patch for another version passes without a note.

    Also when the command does not name the model that it changes, with its hash.
    """
    patch = write(tmp_path / "p.yaml", "{joints: {index_distal: {coulomb_friction: {torque_nm: 0.01}}}}")
    out = tmp_path / "new.yaml"
    before = CONFIG.read_bytes()
    result = CliRunner().invoke(app, ["patch", str(CONFIG), str(patch), "--out", str(out), "--json"])
    assert result.exit_code == 0, result.output
    content = json.loads(result.stdout)
    assert "+    coulomb_friction: {torque_nm: 0.01}" in content["diff"]
    assert content["written"] == str(out) and "torque_nm: 0.01" in out.read_text(encoding="utf-8")
    assert CONFIG.read_bytes() == before
    assert "another version of hand.yaml" in result.stderr
    digest = hashlib.sha256(before).hexdigest()
    assert content["model_file"] == {"path": str(CONFIG), "sha256": digest}
    shown = CliRunner().invoke(app, ["patch", str(CONFIG), str(patch)])
    assert f"model: {CONFIG} (sha256 {digest[:8]})" in shown.stderr.splitlines()


BAD = {
    "value": ("{joints: {index_distal: {coulomb_friction: {torque_nm: -1.0}}}}", (), "torque_nm"),
    "key": ("{joints: {index_distal: {coulomb_friction: {torqe_nm: 0.1}}}}", (), "torqe_nm"),
    "joint": ("{joints: {toe: {limits: {low_deg: 0.0}}}}", (), "joints has no 'toe'"),
    "both": ("{}", ("--write", "--out", "x.yaml"), "cannot be used together"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_change_that_gives_no_model_is_refused(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a model that does not load is written, a file is left behind, or the reason is no single line."""
    monkeypatch.chdir(tmp_path)
    changes, options, line = BAD[case]
    model = tmp_path / "hand.yaml"
    model.write_bytes(CONFIG.read_bytes())
    write(tmp_path / "p.yaml", changes)
    arguments = options or ("--write",)
    result = CliRunner().invoke(app, ["patch", "hand.yaml", "p.yaml", *arguments])
    said = [text for text in result.output.splitlines() if text.strip()]
    assert result.exit_code == 2, result.output
    assert len(said) == 1 and line in said[0], said
    assert model.read_bytes() == CONFIG.read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["hand.yaml", "p.yaml"]
