"""Dynamics and material by simulation error, on recordings the fit has not been tuned on."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from hand_identification.dynamics import DYNAMIC_KEYS, MATERIAL_KEYS, identify_joint
from hand_identification.model_file import write_model
from hand_model.description import Hand, load_hand
from hand_model.kernel.rows import ROW
from hand_recording.hand_signals import hand_signals
from hand_recording.loader import load_recording
from hand_recording.replay import record_offline
from hand_recording.signals import Signals, white_noise
from hand_sim.plant import PHI, HandPlant, P
from hand_tool.cli import app

CONFIG = Path(__file__).resolve().parents[2] / "config" / "hand.yaml"
PERIOD_S = 0.005
KEYS = (*DYNAMIC_KEYS, *MATERIAL_KEYS)
LARGEST_ERROR = 0.05


def excitation(rng: np.random.Generator, seconds: float, joints: int) -> np.ndarray:
    """A staircase, random steps and a multisine, a third each."""
    count = round(seconds / PERIOD_S) // 3
    time = np.arange(count) * PERIOD_S
    commands = np.empty((3 * count, joints))
    for j in range(joints):
        levels = np.r_[np.linspace(0, 4e5, 7), np.linspace(4e5, 0, 7)]
        commands[:count, j] = np.repeat(levels, count // 14 + 1)[:count]
        commands[count : 2 * count, j] = np.repeat(rng.uniform(0, 4e5, count // 150 + 1), 150)[:count]
        waves = [4e4 * np.sin(2 * np.pi * f * time + rng.uniform(0, 6)) for f in np.geomspace(0.05, 4, 12)]
        commands[2 * count :, j] = np.clip(2e5 + np.sum(waves, axis=0), 0, 4.5e5)
    return commands


def record(truth: Hand, seconds: float, rng: np.random.Generator) -> Signals:
    joints = len(truth.joints)
    commands = excitation(rng, seconds, joints)
    plant = HandPlant(truth, PERIOD_S)
    states = np.concatenate([plant.state[None], plant.advance(commands[:-1])])
    shape, yes = commands.shape, np.ones(joints, dtype=bool)
    return Signals(
        name="simulated",
        joints=truth.joints,
        period_s=PERIOD_S,
        set_point_pa=commands,
        pressure_pa=states[:, P] + 150.0 * rng.standard_normal(shape),
        angle_rad=states[:, PHI] + np.radians(0.03) * rng.standard_normal(shape),
        force_n=np.full(shape, np.nan),
        known=np.ones(shape, dtype=bool),
        has_set_point=yes,
        has_pressure=yes,
    )


def perturbed(hand: Hand, rng: np.random.Generator) -> Hand:
    parameters = hand.parameters.copy()
    for key in KEYS:
        low = 1.0 if key in ("material.b0_per_pa", "material.p_min_pa") else 0.75  # Eq. 12 must stay well-posed
        parameters[ROW[key]] *= rng.uniform(low, 1.3, len(hand.joints))
    return replace(hand, parameters=parameters)


def test_every_parameter_is_recovered_within_5_percent() -> None:
    """Fails when a parameter of J, d, valve or creep is biased by more than 5 %, alone or in a coupled pair."""
    seed = int(os.environ.get("HAND_TEST_SEED", np.random.SeedSequence().entropy % 2**31))  # type: ignore[operator]
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    hand = load_hand(CONFIG)
    truth = perturbed(hand, rng)
    signals = record(truth, 210.0, rng)
    for joint in ("thumb_opposition", "index_distal"):
        found = identify_joint([signals], hand, joint, KEYS, rng)
        index = hand.joints.index(joint)
        for estimate in found.estimates:
            error = estimate.value / truth.parameters[ROW[estimate.key], index] - 1.0
            assert abs(error) < LARGEST_ERROR, f"{joint} {estimate.key} {error:+.3f}"
            assert estimate.verdict == "determined", estimate
        assert np.degrees(found.validation_after["angle"]) < 0.06


def test_the_document_states_the_error_that_is_tested() -> None:
    """Fails when docs/identification.md promises another error than the test above allows."""
    page = (CONFIG.parents[1] / "docs" / "identification.md").read_text(encoding="utf-8")
    assert re.findall(r"every parameter is found within (\d+) %", page) == [f"{100 * LARGEST_ERROR:.0f}"]


def test_a_hold_determines_no_inertia() -> None:
    """Fails when a parameter that the recording does not excite is called determined."""
    rng = np.random.default_rng(5)
    hand = load_hand(CONFIG)
    signals = record(hand, 60.0, rng)
    still = replace(signals, set_point_pa=np.full_like(signals.set_point_pa, 1e5))
    plant = HandPlant(hand, PERIOD_S)
    plant.hold_history(np.full(11, 1e5))
    for _ in range(3):
        states = plant.advance(still.set_point_pa)
    noise = rng.standard_normal(states[:, P].shape)
    still = replace(still, pressure_pa=states[:, P] + 150 * noise, angle_rad=states[:, PHI] + 5e-4 * noise[::-1])
    found = identify_joint([still], hand, "index_distal", DYNAMIC_KEYS, rng)
    verdicts = {estimate.key: estimate.verdict for estimate in found.estimates}
    assert verdicts["dynamics.inertia_kg_m2"] == "not determined"
    assert verdicts["valve.time_constant_s"] == "not determined"


def test_noise_is_read_from_the_data() -> None:
    """Fails when the noise of a moving or quantised signal is off by more than a third."""
    rng = np.random.default_rng(1)
    time = np.arange(4000) * PERIOD_S
    moving = np.sin(2 * np.pi * 0.7 * time)
    assert white_noise(moving + 1e-3 * rng.standard_normal(4000)) == pytest.approx(1e-3, rel=0.1)
    step = 2e-3
    quantised = step * np.round((moving + 5e-4 * rng.standard_normal(4000)) / step)
    assert white_noise(quantised) == pytest.approx(np.hypot(5e-4, step / np.sqrt(12)), rel=0.5)


def test_a_patched_model_loads_and_keeps_eq_12(tmp_path: Path) -> None:
    """Fails when a written model does not load, or the creep it describes is another one than was identified."""
    hand = load_hand(CONFIG)
    changes = {"index_distal": {"material.p_min_pa": 2e4, "material.phi_max_deg": 1.0, "dynamics.inertia_kg_m2": 4e-5}}
    patched = write_model(hand, changes, tmp_path / "model.yaml", "a test")
    j = hand.joints.index("index_distal")
    assert patched.parameters[ROW["dynamics.inertia_kg_m2"], j] == pytest.approx(4e-5)
    product = patched.row("material.phi_max_deg") * patched.row("material.b1_per_pa")
    assert product[j] == pytest.approx(1.0 * hand.row("material.b1_per_pa")[j])
    others = np.delete(np.arange(11), j)
    assert np.array_equal(patched.parameters[:, others], hand.parameters[:, others])


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("nowhere.mcap",), "nowhere.mcap"),
        (("{recording}", "--joints", "toe"), "'toe' was not recorded"),
        (("{recording}", "--model", "nowhere.yaml"), "nowhere.yaml"),
    ],
)
def test_bad_input_is_one_line(arguments: tuple[str, ...], line: str, tmp_path: Path, short_recording: Path) -> None:
    """Fails when bad input of `hand identify dynamics` gives a traceback or another exit code than 2."""
    filled = [argument.format(recording=short_recording) for argument in arguments]
    result = CliRunner().invoke(app, ["identify", "dynamics", *filled, "--out", str(tmp_path / "out")])
    said = [text for text in result.output.splitlines() if text.strip()]
    assert result.exit_code == 2, result.output
    assert len(said) == 1, said
    assert line in said[0]


def test_the_command_identifies_a_recording(tmp_path: Path, short_recording: Path) -> None:
    """Fails when the command does not read a bag, or its model.yaml is not the hand it describes."""
    out = tmp_path / "out"
    command = ["identify", "dynamics", str(short_recording), "--out", str(out), "--joints", "index_distal", "--json"]
    result = CliRunner().invoke(app, [*command, "--model", str(CONFIG)])
    assert result.exit_code == 0, result.output
    assert load_hand(out / "model.yaml").joints == load_hand(CONFIG).joints
    assert (out / "index_distal.png").stat().st_size > 5000


def test_joints_that_rest_are_named_and_left_out(tmp_path: Path) -> None:
    """Fails when numbers of a joint that did not move are printed, or it is left out in silence.

    The seed of the noise is fixed.
    """
    hand = load_hand(CONFIG)
    steps = np.zeros((1600, len(hand.joints)))
    steps[:, hand.joints.index("index_distal")] = 1e5 * (1 + np.arange(1600) // 200 % 2)
    for _ in record_offline(hand, steps, tmp_path / "one.mcap", seed=1):
        pass
    command = [
        "identify",
        "dynamics",
        str(tmp_path / "one.mcap"),
        "--out",
        str(tmp_path / "out"),
        "--model",
        str(CONFIG),
    ]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0, result.output
    assert "not identified, moved less than 2 degrees: thumb_opposition, " in result.output
    assert "middle_distal: error" not in result.output and "dynamics.inertia_kg_m2" in result.output
    for _ in record_offline(hand, 0.0 * steps[:800], tmp_path / "rest.mcap", seed=1):
        pass
    refused = CliRunner().invoke(
        app, ["identify", "dynamics", str(tmp_path / "rest.mcap"), "--out", str(tmp_path / "no")]
    )
    assert refused.exit_code == 2 and "no joint moves by more than 2 degrees" in refused.output


def test_signals_of_a_bag_are_those_that_made_it(short_recording: Path) -> None:
    """Fails when set-points, pressures or angles of a recording are shifted or mixed between joints."""
    hand = load_hand(CONFIG)
    signals = hand_signals(load_recording(short_recording), hand)
    assert signals.period_s == pytest.approx(PERIOD_S, rel=1e-3)
    plant = HandPlant(hand, PERIOD_S)
    states = plant.advance(signals.set_point_pa)
    late = slice(400, None)
    assert np.abs(states[:-1, P] - signals.pressure_pa[1:])[late].max() < 2500.0
    assert np.degrees(np.abs(states[:-1, PHI] - signals.angle_rad[1:])[late].max()) < 1.2  # the line's own error
