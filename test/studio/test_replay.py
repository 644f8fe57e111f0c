"""A recording next to models of the hand, segment by segment."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_model.kernel.rows import ROW
from hand_recording.hand_signals import hand_signals
from hand_recording.loader import load_recording
from hand_recording.replay import record_offline
from hand_studio.replay import SEGMENT_S, Replay, window_of
from hand_studio.tint import NOISE
from hand_studio.window import Window
from hand_tool.cli import app

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
RUBBING = HAND.joints.index("index_proximal")
SEED = 3


def rubbing() -> Hand:
    parameters = HAND.parameters.copy()
    parameters[ROW["coulomb_friction.torque_nm"], RUBBING] = 0.012
    return replace(HAND, parameters=parameters)


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of a hand with friction in a joint, through sensors and calibration."""
    print(f"seed {SEED}")
    out = tmp_path_factory.mktemp("replay") / "rubbing.mcap"
    time_s = np.arange(1000)[:, None] / HAND.rate_hz
    waves = 1.2e5 + 1.0e5 * np.sin((2.0 + 0.3 * np.arange(len(HAND.joints))) * time_s)
    for _ in record_offline(rubbing(), np.clip(time_s - 0.5, 0.0, 1.0) * waves, out, seed=SEED):
        pass
    return out


@pytest.fixture(scope="module")
def shown(bag: Path) -> Replay:
    return Replay(HAND, window_of(hand_signals(load_recording(bag), HAND), HAND))


def off_deg(shown: Replay, angle_rad: Array) -> Array:
    return np.asarray(np.degrees(np.sqrt(np.mean((angle_rad - shown.window.angle_rad) ** 2, axis=0))))


def test_the_model_after_is_in_the_hand_and_the_one_before_is_not(shown: Replay) -> None:
    """Fails when a model does not get the recorded set-points, begins elsewhere, or has another model's numbers."""
    before, after = shown.run(HAND.parameters), shown.run(rubbing().parameters)
    assert off_deg(shown, after.angle_rad).max() < 0.2
    assert off_deg(shown, before.angle_rad)[RUBBING] > 2.0
    assert np.delete(off_deg(shown, before.angle_rad), [RUBBING, HAND.partner[RUBBING]]).max() < 0.2


def test_pressure_and_force_are_shown_and_what_if_changes_both(shown: Replay) -> None:
    """Fails when a plot shows another signal, or a clock or the gain of a force sensor does not reach its curve."""
    run = shown.segment_of(shown.run(rubbing().parameters), 0)
    angle, pressure, force = shown.curves(0, RUBBING, (run,))
    assert np.sqrt(np.mean((pressure[0] - pressure[1]) ** 2)) < 2e3 < np.ptp(pressure[0]) / 10.0
    assert angle[0] == pytest.approx(angle[1], abs=np.radians(1.0)) and np.isfinite(force[1]).all()
    parameters = rubbing().parameters
    parameters[ROW["clock_offset.offset_s"]] = 0.05
    late = shown.curves(0, RUBBING, (shown.what_if(run, parameters, 0),))
    assert np.sqrt(np.mean((late[1][0] - late[1][1]) ** 2)) > 5e3
    assert late[0][1] == pytest.approx(angle[1], abs=1e-9)
    parameters = rubbing().parameters
    parameters[ROW["fsr_gain.error"]] = 0.5
    assert shown.curves(0, RUBBING, (shown.what_if(run, parameters, 0),))[2][1] == pytest.approx(1.5 * force[1])
    assert len(shown.curves(0, HAND.joints.index("thumb_opposition"), (run,))) == 2


def test_what_if_goes_on_from_the_segment_before(shown: Replay, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when segments are cut or joined wrongly, or what-if with the same numbers differs from the run."""
    whole = shown.run(HAND.parameters)
    monkeypatch.setattr("hand_studio.replay.SEGMENT_S", 1.5)
    short = Replay(HAND, shown.window)
    run = short.run(HAND.parameters)
    assert run.angle_rad == pytest.approx(whole.angle_rad, abs=1e-9)
    last = short.segment(len(shown.window.angle_rad) - 1)
    assert len(run.states) == last + 1 == 4
    for segment in range(last + 1):
        again = short.what_if(run, HAND.parameters, segment)
        assert again.angle_rad == pytest.approx(run.angle_rad[short.cut(segment)], abs=np.radians(0.2))


def test_what_if_of_a_segment_follows_a_slider(shown: Replay) -> None:
    """Fails when a model and its curves for a whole segment of all joints take over 0.1 s of CPU."""
    window = shown.window
    signals = (window.angle_rad, window.pressure_pa, window.set_point_pa, window.force_n)
    times = round(SEGMENT_S / shown.duration_s)
    long = Replay(HAND, Window(window.period_s, *(np.tile(np.asarray(signal), (times, 1)) for signal in signals)))
    run, taken = long.run(HAND.parameters), []
    for _ in range(3):
        begun = time.process_time()
        made = long.what_if(run, rubbing().parameters, 0)
        long.curves(0, RUBBING, (run, made))
        taken.append(time.process_time() - begun)
    assert len(made.angle_rad) == SEGMENT_S * HAND.rate_hz
    assert min(taken) < 0.1


def test_the_mismatch_names_the_joint(shown: Replay) -> None:
    """Fails when a joint without an effect is tinted, or the one with friction is not."""
    largest = np.abs(shown.mismatch(HAND.parameters)).max(axis=0)
    assert largest.argmax() == RUBBING and largest[RUBBING] > 20.0 * NOISE
    assert np.delete(largest, [RUBBING, HAND.partner[RUBBING]]).max() < NOISE


def test_what_cannot_be_replayed_is_one_line(bag: Path, tmp_path: Path) -> None:
    """Fails when a missing file, a folder without a model, or options that exclude each other are not refused."""
    (tmp_path / "empty").mkdir()
    for words, line in (
        ((str(tmp_path / "none.mcap"),), "none.mcap does not exist"),
        ((str(bag), "--after", str(tmp_path / "empty")), "model.yaml does not exist"),
        ((str(bag), "--sim"), "exclude each other"),
        (("--after", str(bag)), "--after needs a recording"),
    ):
        answer = CliRunner().invoke(app, ["studio", "--no-browser", "--quiet", *words])
        assert answer.exit_code == 2 and line in answer.output, answer.output
        assert len(answer.output.splitlines()) == 1
