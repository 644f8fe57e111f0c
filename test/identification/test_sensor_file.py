"""Calibrations of sensors in a description: printed, written with comments kept, and read by the driver's own code."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from hand_model.description import load_hand
from hand_model.sensors import ForcePolynomial, ForceSensors
from hand_tool.cli import app

CONFIG = Path(__file__).parents[2] / "config" / "hand.yaml"
JOINT, SITE = "index_distal", "index_distal_pad"
SUPPLY_V = 4.8


def hand(*arguments: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["identify", *arguments])
    return result.exit_code, result.output


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "hand.yaml"
    path.write_text(CONFIG.read_text(encoding="utf-8"), encoding="utf-8")
    return path


@pytest.fixture
def angle_rig(tmp_path: Path) -> Path:
    """A sensor that is turned by 6 degrees and 7 % weaker than described, on a supply of SUPPLY_V."""
    angle = np.linspace(-5.0, 95.0, 120)
    ratio = 0.5 + 0.93 * 0.4 * np.sin(np.radians(angle - 51.0))
    rows = np.column_stack([angle, SUPPLY_V * ratio])
    path = tmp_path / "angle.csv"
    np.savetxt(path, rows, delimiter=",", header="angle_deg,voltage_v", comments="")
    return path


@pytest.fixture
def force_rig(tmp_path: Path) -> Path:
    """A film twice as resistive as described, in a divider of 10 kohm on a supply of SUPPLY_V."""
    force = np.geomspace(0.3, 30.0, 60)
    one = np.ones(1)
    film = ForceSensors(5.3 * one, 0.6 * one, 1e4 * one, 0.1 * one, 0.0 * one)
    rows = np.column_stack([force, SUPPLY_V * np.array([float(film.ratio(np.array([f]))[0]) for f in force])])
    path = tmp_path / "force.csv"
    np.savetxt(path, rows, delimiter=",", header="force_n,voltage_v", comments="")
    return path


def comments(text: str) -> list[str]:
    return [line.partition("#")[2] for line in text.splitlines() if "#" in line]


def test_the_line_of_a_joint_is_written(angle_rig: Path, model: Path) -> None:
    """Fails when ratios are of another supply or in another order, another joint changes, or a comment is lost."""
    before = model.read_text(encoding="utf-8")
    options = ["--supply-v", str(SUPPLY_V), "--joint", JOINT, "--write", str(model)]
    code, output = hand("angle", str(angle_rig), *options)
    assert code == 0, output
    assert f"model: {model} (sha256 {hashlib.sha256(before.encode()).hexdigest()[:8]})" in output.splitlines()
    assert f"written: {model}" in output and "+    angle_sensor" in output
    old, new = load_hand(CONFIG), load_hand(model)
    index = old.joints.index(JOINT)
    table = np.loadtxt(angle_rig, delimiter=",", skiprows=1)
    ends = [np.argmin(np.abs(table[:, 0] - end)) for end in (0.0, 90.0)]
    read = new.sensors.angle_line.angle_rad(np.repeat(table[ends, 1:] / SUPPLY_V, len(new.joints), axis=1))
    assert np.degrees(read[:, index]) == pytest.approx(table[ends, 0], abs=0.6)
    other = [k for k in range(len(old.joints)) if k != index]
    ratio = np.full((1, len(old.joints)), 0.45)
    lines = [each.sensors.angle_line.angle_rad(ratio)[0, other] for each in (old, new)]
    assert np.array_equal(lines[0], lines[1])
    assert comments(model.read_text(encoding="utf-8"))[1:] == comments(before)


def test_the_printed_lines_are_those_that_are_written(angle_rig: Path, force_rig: Path, model: Path) -> None:
    """Fails when a user who copies the printed lines by hand gets another description than --write gives."""
    supply = ["--supply-v", str(SUPPLY_V)]
    _, angle = hand("angle", str(angle_rig), *supply)
    _, force = hand("force", str(force_rig), *supply, "--divider-ohm", "10000")
    assert hand("angle", str(angle_rig), *supply, "--joint", JOINT, "--write", str(model))[0] == 0
    more = ["--divider-ohm", "10000", "--site", SITE, "--write", str(model)]
    assert hand("force", str(force_rig), *supply, *more)[0] == 0
    written = yaml.safe_load(model.read_text(encoding="utf-8"))
    joint = next(entry for entry in written["joints"] if entry["name"] == JOINT)
    site = next(entry for entry in written["force_sites"] if entry["name"] == SITE)
    printed = yaml.safe_load(angle.partition("in hand.yaml:\n")[2])
    assert joint["angle_sensor"]["calibration"] == printed["angle_sensor"]["calibration"]
    printed = yaml.safe_load(force.partition("site in hand.yaml:\n")[2])
    assert printed == {key: site[key] for key in ("divider_ohm", "calibration_log_polynomial")}


def test_the_polynomial_of_a_site_gives_the_measured_forces(force_rig: Path, model: Path) -> None:
    """Fails when coefficients are in another order, rounded too much, or the divider of the rig is not kept."""
    more = ["--supply-v", str(SUPPLY_V), "--divider-ohm", "10000", "--site", SITE, "--write", str(model), "--json"]
    code, output = hand("force", str(force_rig), *more)
    assert code == 0, output
    assert SITE in json.loads(output)["diff"]
    before = hashlib.sha256(CONFIG.read_bytes()).hexdigest()
    assert json.loads(output)["model_file"] == {"path": str(model), "sha256": before}
    sensors = load_hand(model).sensors
    found: ForcePolynomial = sensors.force_polynomial
    table = np.loadtxt(force_rig, delimiter=",", skiprows=1)
    read = found.force_n(np.repeat(table[:, 1:] / SUPPLY_V, len(sensors.sites), axis=1))
    assert read[:, sensors.sites.index(SITE)] == pytest.approx(table[:, 0], rel=0.01)


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (("angle", "--write", "{model}"), "--write needs --joint"),
        (("angle", "--write", "{model}", "--joint", "elbow"), "--joint is 'elbow'; the description has: thumb_opp"),
        (("angle", "--supply-v", "2.5", "--write", "{model}", "--joint", JOINT), "the allowed range is 0 to 2.5 V"),
        (("angle", "--supply-v", "nan"), "--supply-v is nan; the allowed range is 1 to 10 V"),
        (("force", "--write", "{model}"), "--write needs --site"),
        (("force", "--write", "{model}", "--site", "nail"), "--site is 'nail'; the description has: thumb_prox"),
    ],
)
def test_what_cannot_be_written_is_one_line(
    options: tuple[str, ...], line: str, angle_rig: Path, force_rig: Path, model: Path
) -> None:
    """Fails when a wrong name or supply changes the file, or ends in several lines or another exit code than 2."""
    before = model.read_text(encoding="utf-8")
    rig = {"angle": angle_rig, "force": force_rig}[options[0]]
    code, output = hand(options[0], str(rig), *(part.format(model=model) for part in options[1:]))
    assert code == 2 and line in output and len(output.strip().splitlines()) == 1, output
    assert model.read_text(encoding="utf-8") == before
