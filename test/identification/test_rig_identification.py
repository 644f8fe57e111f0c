"""Calibrations and the static map from rigs: they recover the true parameters and name undetermined ones."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from hand_identification.angle_calibration import calibrate_angle
from hand_identification.force_calibration import calibrate_force, resistance_ohm
from hand_identification.static_map import correlation_time, identify_statics, identify_volume, residual_map
from hand_model.compliance import Actuator
from hand_model.description import load_hand
from hand_tool.cli import app

TRUTH = Actuator(-0.012, -0.05, 1.0e-6, -4.0e-7)
VALUES = np.array([TRUTH.a0, TRUTH.a1, TRUTH.a2, TRUTH.a3])


def rig(seed: int, noise_nm: float = 2e-3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    pressure, phi = (x.ravel() for x in np.meshgrid(np.linspace(0, 5e5, 9), np.radians(np.linspace(0, 90, 31))))
    return pressure, phi, TRUTH.torque_nm(pressure, phi) + noise_nm * rng.standard_normal(phi.size)


def test_statics_are_recovered_within_their_errors() -> None:
    """Fails when the regression is biased or its standard errors are not those of repeated rigs."""
    print("seeds 0 to 59")
    found = [identify_statics(*rig(seed)) for seed in range(60)]
    values = np.array([static_map.values for static_map in found])
    assert np.abs(values.mean(axis=0) / VALUES - 1.0).max() < 0.02
    stated = np.mean([static_map.errors for static_map in found], axis=0)
    assert np.all(np.abs(stated / values.std(axis=0) - 1.0) < 0.35)
    assert found[0].r2 > 0.99
    assert found[0].warnings == ()


def test_correlated_noise_widens_the_errors() -> None:
    """Fails when a slow disturbance is taken for many independent samples."""
    rng = np.random.default_rng(8)
    pressure, phi, torque = rig(8, 0.0)
    slow = np.repeat(2e-3 * rng.standard_normal(len(phi) // 9 + 1), 9)[: len(phi)]
    white = 2e-3 * rng.standard_normal(len(phi))
    ratio = (
        identify_statics(pressure, phi, torque + slow).errors / identify_statics(pressure, phi, torque + white).errors
    )
    assert ratio.min() > 1.8
    assert correlation_time(white) < 1.6


def test_unexcited_terms_are_named() -> None:
    """Fails when angle and pressure that move together are taken for independent ones."""
    rng = np.random.default_rng(4)
    pressure = np.linspace(0.0, 5e5, 200)
    phi = 3e-6 * pressure + 1e-4 * rng.standard_normal(200)
    found = identify_statics(pressure, phi, TRUTH.torque_nm(pressure, phi) + 1e-3 * rng.standard_normal(200))
    assert any(line.startswith("a2_nm_per_pa: hardly excited") for line in found.warnings)


def test_volume_keeps_virtual_work() -> None:
    """Fails when the volume map's slope is not compared with a2 and a3."""
    pressure, phi, torque = rig(2)
    volume = TRUTH.volume_m3(pressure, phi)
    work = identify_volume(pressure, phi, volume, identify_statics(pressure, phi, torque))
    assert work.displacement_over_a2 == pytest.approx(1.0, abs=0.02)
    assert work.curvature_over_half_a3 == pytest.approx(1.0, abs=0.05)
    assert np.allclose(work.values[:2], [TRUTH.v0, TRUTH.c_v], rtol=1e-3)


def test_residual_map_shows_where() -> None:
    """Fails when a disturbance in one corner does not show in that corner's cell."""
    pressure, phi, torque = rig(3, 0.0)
    corner = (pressure > 4.3e5) & (phi > np.radians(80))
    clean = identify_statics(pressure, phi, torque)
    means = residual_map(clean, pressure, phi, torque + 0.02 * corner)[2]
    assert np.nanargmax(means) == means.size - 1


def test_torque_uncertainty_is_that_of_repeated_measurements() -> None:
    """Fails when sensor noise or the map's covariance is propagated wrongly."""
    rng = np.random.default_rng(6)
    found = identify_statics(*rig(6))
    p, phi, p_std, phi_std = 2e5, 0.7, 2e3, 0.01
    values = rng.multivariate_normal(found.values, found.covariance, 20000)
    pressures, angles = p + p_std * rng.standard_normal(20000), phi + phi_std * rng.standard_normal(20000)
    torques = values[:, 0] + values[:, 1] * angles + values[:, 2] * pressures + values[:, 3] * pressures * angles
    torque = found.torque_nm(np.array([p]), np.array([phi]))
    std = found.torque_std_nm(np.array([p]), np.array([phi]), pressure_std_pa=p_std, angle_std_rad=phi_std)
    assert torque[0] == pytest.approx(torques.mean(), abs=4 * std[0] / 140)
    assert std[0] == pytest.approx(torques.std(), rel=0.03)


def fsr(seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    force = np.geomspace(0.2, 60.0, 80)
    x = np.log10(force)
    resistance = 10.0 ** (5.1 - 0.7 * x + 0.03 * x**2) * (1 + 0.01 * rng.standard_normal(80))
    return force, 5.0 * 2.7e4 / (resistance + 2.7e4)


def test_force_calibration_inverts_the_sensor_and_refuses_the_rest() -> None:
    """Fails when the cubic is fitted in another space or a force is given outside the calibrated range."""
    force, voltage = fsr(1)
    found = calibrate_force(force, voltage, 5.0, 2.7e4)
    assert found.relative_rms < 0.025
    assert np.nanmax(np.abs(found.force_n(voltage) / force - 1.0)) < 0.08
    outside = found.force_n(np.array([voltage.min() * 0.9, voltage.max() * 1.02, 0.0]))
    assert np.isnan(outside).all()
    assert np.all(found.sensitivity_v_per_n(np.array([1.0, 10.0, 50.0])) > 0.0)
    assert resistance_ohm(np.array([2.5]), 5.0, 1e4)[0] == pytest.approx(1e4)


@pytest.mark.parametrize(("shape", "expected"), [("sine", "sine"), ("straight", "line"), ("tilted", "harmonic")])
def test_the_data_choose_the_angle_model(shape: str, expected: str) -> None:
    """Fails when a model is chosen that the data do not ask for, or leaves a tenth of a degree of its own kind."""
    rng = np.random.default_rng(7)
    angle = np.linspace(-8.0, 98.0, 240)
    phi = np.radians(angle - 45.0)
    volts = {"sine": np.sin(phi), "straight": phi, "tilted": np.sin(phi) + 0.04 * np.sin(2 * phi + 0.5)}[shape]
    found = calibrate_angle(angle, 2.5 + 1.4 * volts + 5e-4 * rng.standard_normal(240))
    assert found.model == expected
    assert found.rms_deg < 0.1
    assert np.isnan(found.angle_deg(np.array([4.9])))[0]


def hand(*arguments: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["identify", *arguments])
    return result.exit_code, result.output


GOOD = "pressure_pa,angle_deg,torque_nm\n" + "".join(
    f"{p},{a},{float(TRUTH.torque_nm(np.array(p), np.radians(a))) + 1e-3 * ((p + a) % 7 - 3)}\n"
    for p in range(0, 500001, 50000)
    for a in range(0, 91, 10)
)


def test_statics_command_reads_units_from_the_names(tmp_path: Path) -> None:
    """Fails when bar and radians are not converted, or the documents differ."""
    (tmp_path / "si.csv").write_text(GOOD, encoding="utf-8")
    rows = [line.split(",") for line in GOOD.splitlines()[1:]]
    other = "pressure_bar,angle_rad,torque_nm\n" + "".join(
        f"{float(p) * 1e-5},{np.radians(float(a))},{t}\n" for p, a, t in rows
    )
    (tmp_path / "other.csv").write_text(other, encoding="utf-8")
    code, first = hand("statics", str(tmp_path / "si.csv"), "--json", "--out", str(tmp_path / "out"))
    assert code == 0, first
    code, second = hand("statics", str(tmp_path / "other.csv"), "--json")
    assert code == 0, second
    values = [json.loads(text)["parameters"]["a2_nm_per_pa"]["value"] for text in (first, second)]
    assert values[0] == pytest.approx(values[1], rel=1e-9)
    assert (tmp_path / "out" / "residual_map.png").stat().st_size > 5000


BAD = {
    "missing column": ("statics", GOOD.replace("torque_nm", "moment"), "no column torque_nm"),
    "one pressure": (
        "statics",
        "pressure_pa,angle_deg,torque_nm\n" + "".join(f"1e5,{a},{a}\n" for a in range(40)),
        "spans 0 Pa",
    ),
    "nan": ("statics", GOOD.replace("\n0,10,", "\nnan,10,"), "line 3, column pressure_pa is 'nan'"),
    "radians": (
        "statics",
        "pressure_pa,angle_deg,torque_nm\n" + "".join(f"{p}e4,{p % 5 * 0.3},0.1\n" for p in range(40)),
        "radians",
    ),
    "empty": ("statics", "", "is empty"),
    "no numbers": ("statics", "pressure_pa,angle_deg,torque_nm\n", "no numbers"),
    "constant voltage": ("angle", "angle_deg,voltage_v\n" + "".join(f"{a},2.5\n" for a in range(90)), "constant"),
    "negative force": (
        "force",
        "force_n,voltage_v\n" + "".join(f"{k - 2},{0.1 * k + 0.1}\n" for k in range(20)),
        "above 0 N",
    ),
    "voltage beyond supply": ("force", "force_n,voltage_v\n" + "".join(f"{k + 1},{k}\n" for k in range(20)), "0 to 5"),
    "few forces": ("force", "force_n,voltage_v\n1,1\n2,1.5\n", "8 or more"),
}


@pytest.mark.parametrize("case", BAD)
def test_wrong_rig_files_get_one_line(case: str, tmp_path: Path) -> None:
    """Fails when a wrong file gives a traceback, a number, several lines, or another exit code than 2."""
    command, text, line = BAD[case]
    path = tmp_path / "rig.csv"
    path.write_text(text, encoding="utf-8")
    code, output = hand(command, str(path))
    said = [line for line in output.splitlines() if line.strip()]
    assert code == 2, output
    assert len(said) == 1, said
    assert line in said[0]
    assert "rig.csv" in said[0]


def rig_file(path: Path, pressure: np.ndarray, phi: np.ndarray, torque: np.ndarray, volume: np.ndarray) -> Path:
    table = np.array([pressure, np.degrees(phi), torque, volume]).T
    np.savetxt(path, table, delimiter=",", header="pressure_pa,angle_deg,torque_nm,volume_m3", comments="", fmt="%.9g")
    return path


def measured(seed: int) -> list[np.ndarray]:
    """Pressure, angle, torque and a volume that agrees with the torque by virtual work."""
    pressure, phi, torque = rig(seed)
    noise = 2e-9 * np.random.default_rng(seed).standard_normal(phi.size)
    return [pressure, phi, torque, TRUTH.volume_m3(pressure, phi) + noise]


FAULTS = {
    "": (0.0, 1.0, 1.0, 1.0),
    "absolute pressure": (101325.0, 1.0, 1.0, 1.0),
    "torque falls with the pressure": (0.0, 1.0, -1.0, 1.0),
    "torque rises with the angle": (0.0, -1.0, 1.0, 1.0),
    "torque reaches": (0.0, 1.0, 1e3, 1e3),
    "cm^3 to m^3": (0.0, 1.0, 1.0, 1e6),
    "virtual work fails": (0.0, 1.0, 1.0, 1.2),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_faulty_rig_gets_one_verdict(fault: str, tmp_path: Path) -> None:
    """Fails when a fault of the rig is not named, or a sound rig gets a verdict. Seed 5."""
    pressure, phi, torque, volume = measured(5)
    shift, turn, unit, litres = FAULTS[fault]
    path = rig_file(tmp_path / "rig.csv", pressure + shift, turn * phi, unit * torque, litres * turn * volume)
    if turn < 0.0:  # the volume's own sign does not change with the angle's
        path = rig_file(path, pressure, -phi, torque, -(TRUTH.volume_m3(pressure, phi)))
    result = CliRunner().invoke(app, ["identify", "statics", str(path)])
    assert result.exit_code == 0, result.output
    lines = [line for line in result.output.splitlines() if line.startswith("verdict: ")]
    assert (fault or "plausible") in lines[0], lines
    document = json.loads(CliRunner().invoke(app, ["identify", "statics", str(path), "--json"]).output)
    assert bool(document["verdict"]) == bool(fault)


@pytest.mark.parametrize(
    ("scale", "turn", "question"), [(1e-5, 1.0, "in bar"), (1e-3, 1.0, "kPa"), (1.0, 0.0175, "radians")]
)
def test_a_span_in_another_unit_is_asked_for(scale: float, turn: float, question: str) -> None:
    """Fails when a pressure in bar or kPa or an angle in radians is refused without naming the likely unit."""
    pressure, phi, torque = rig(6)
    with pytest.raises(ValueError, match=question):
        identify_statics(scale * pressure, turn * phi, torque)


def test_statics_are_written_with_comments_kept(tmp_path: Path) -> None:
    """Fails when --write loses a comment, changes another joint, hides the difference, or writes a faulty rig."""
    model = tmp_path / "hand.yaml"
    text = (Path(__file__).parents[2] / "config" / "hand.yaml").read_text(encoding="utf-8")
    model.write_text(text, encoding="utf-8")
    pressure, phi, torque, volume = measured(7)
    bad = rig_file(tmp_path / "bad.csv", pressure + 101325.0, phi, torque, volume)
    good = rig_file(tmp_path / "rig.csv", pressure, phi, torque, volume)
    options = ["--write", str(model), "--joint", "index_distal"]
    refused = CliRunner().invoke(app, ["identify", "statics", str(bad), *options])
    assert refused.exit_code == 2
    assert "nothing is written" in refused.output and "absolute pressure" in refused.output
    assert model.read_text(encoding="utf-8") == text
    assert CliRunner().invoke(app, ["identify", "statics", str(good), *options[:2]]).exit_code == 2
    assert CliRunner().invoke(app, ["identify", "statics", str(good), *options[:3], "toe"]).exit_code == 2
    done = CliRunner().invoke(app, ["identify", "statics", str(good), *options])
    assert done.exit_code == 0, done.output
    assert f"model: {model} (sha256 {hashlib.sha256(text.encode()).hexdigest()[:8]})" in done.stderr.splitlines()
    written = model.read_text(encoding="utf-8")
    assert [x for x in text.splitlines() if "#" in x and x not in written.splitlines()] == []
    assert any(line.startswith("+") and "a1_nm_per_rad" in line for line in done.output.splitlines())
    before, after = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml"), load_hand(model)
    found = after.row("statics.a1_nm_per_rad")
    changed = np.flatnonzero(found != before.row("statics.a1_nm_per_rad"))
    assert [after.joints[k] for k in changed] == ["index_distal"]
    assert found[changed[0]] == pytest.approx(TRUTH.a1, rel=0.05)
