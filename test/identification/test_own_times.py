"""Readings taken at uneven times are compared with a model at their own times, not on lines between them."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hand_diagnosis.problem.noise import noise_laws
from hand_identification.driving import shape_driving
from hand_identification.joint_data import joint_problem
from hand_identification.own_times import on_samples
from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_model.kernel.rows import ROW
from hand_recording.hand_signals import hand_signals, without_sensor_curve
from hand_recording.loader import load_recording
from hand_recording.own_readings import OwnReadings
from hand_recording.replay import record_offline
from hand_recording.signal_files import read_signals
from hand_recording.signals import Signals

CONFIG = Path(__file__).parents[2] / "config" / "hand.yaml"
JOINT, NOISE_PA, NOISE_RAD = "thumb_opposition", 200.0, 5e-4
SECONDS = 24.0
MAP = f"""
time: {{column: t, unit: s}}
joints:
  {JOINT}:
    set_point: {{column: u, unit: pa}}
    pressure: {{column: p, unit: pa}}
    angle: {{column: phi, unit: rad}}
"""


def valve(hand: Hand, at_s: Array, step_s: Array, level_pa: Array) -> Array:
    """Pressures (N,) [Pa] at any times of a valve of first order, in closed form: its answer to every step in turn."""
    column = hand.parameters[:, hand.joints.index(JOINT)]
    tau, late = column[ROW["valve.time_constant_s"]], column[ROW["valve.dead_time_s"]]
    edges, before, pressure = step_s + late, 0.0, np.zeros(len(at_s))
    for n, (edge, level) in enumerate(zip(edges, level_pa, strict=True)):
        end = edges[n + 1] if n + 1 < len(edges) else np.inf
        inside = (at_s >= edge) & (at_s < end)
        pressure[inside] = level + (before - level) * np.exp(-(at_s[inside] - edge) / tau)
        before = level + (before - level) * np.exp(-(end - edge) / tau)
    return pressure


def recorded(
    folder: Path, scatter: float, period_s: float, seed: int, *, steady: bool = False, sooner: bool = False
) -> Signals:
    """A table whose rows are read up to `scatter` periods off an even clock, as their stamps say; steps at rows.

    steady: they are read on the clock, and the stamps are right.  sooner: steps come at any time since the row before.
    """
    print(f"seed {seed}")
    rng, hand = np.random.default_rng(seed), load_hand(CONFIG)
    count = round(SECONDS / period_s)
    off = np.zeros(count) if steady else rng.uniform(-scatter, scatter, count)
    time_s: Array = (1.0 + np.arange(count) + off) * period_s
    rows = np.cumsum(rng.integers(round(0.35 / period_s), round(0.9 / period_s), 60))
    rows = rows[rows < count - 5]
    level = rng.uniform(0.0, 1.2e5, len(rows)) + 1.2e5 * (np.arange(len(rows)) % 2)
    sent = np.concatenate([[0.0], level])[np.searchsorted(rows, np.arange(count), side="right")]
    step_s = time_s[rows] - (rng.uniform(0.0, 1.0, len(rows)) * (time_s[rows] - time_s[rows - 1]) if sooner else 0.0)
    pressure = valve(hand, time_s, step_s, level) + NOISE_PA * rng.standard_normal(count)
    angle = 0.5 + 0.3 * np.sin(9.0 * time_s) + NOISE_RAD * rng.standard_normal(count)
    with (folder / "r.csv").open("w", newline="") as file:
        out = csv.writer(file)
        out.writerow(["t", "u", "p", "phi"])
        out.writerows(np.column_stack([time_s, sent, pressure, angle]).tolist())
    (folder / "map.yaml").write_text(MAP, encoding="utf-8")
    (signals,) = read_signals([folder / "r.csv"], hand, folder / "map.yaml")
    return signals


def left_pa(signals: Signals) -> float:
    """RMS [Pa] of what the plain model leaves of the pressures once it has put them on the samples."""
    hand = load_hand(CONFIG)
    problem = joint_problem([signals], hand, JOINT)
    shape_driving(problem, (), np.zeros(0))
    columns, starts = problem.columns((), np.zeros((1, 0)))
    return float(np.std(problem.residuals(columns, starts)[0][0, 0][problem.segments[0].use[0]]))


@pytest.mark.parametrize(("scatter", "period_s"), [(0.45, 0.01), (0.3, 0.02), (0.2, 0.04)])
def test_pressures_after_steps_agree_with_the_right_model(tmp_path: Path, scatter: float, period_s: float) -> None:
    """Fails when bends after steps are cut by lines between the readings, which looks like an error of the valve."""
    signals = recorded(tmp_path, scatter, period_s, 51)
    assert signals.own is not None
    assert left_pa(signals) < 1.1 * NOISE_PA
    assert left_pa(replace(signals, own=None)) > 1.8 * NOISE_PA


@pytest.mark.parametrize(("scatter", "period_s"), [(0.45, 0.005), (0.3, 0.01), (0.2, 0.04)])
def test_noise_on_lines_between_readings_has_its_size(tmp_path: Path, scatter: float, period_s: float) -> None:
    """Fails when the noise floor is that of white noise, which noise on lines between readings is smoother than."""
    problem = joint_problem([recorded(tmp_path, scatter, period_s, 56)], load_hand(CONFIG), JOINT)
    shape_driving(problem, (), np.zeros(0))
    segment, start = problem.segments[0], problem.columns((), np.zeros((1, 0)))
    (still, _), *_ = noise_laws(segment, problem.predict(*start)[0][0])
    left = problem.residuals(*start)[0][0, 0][segment.use[0]]
    assert np.sqrt(still) == pytest.approx(np.std(left), rel=0.08)
    assert np.std(left) < NOISE_PA


@pytest.mark.parametrize(("scatter", "period_s"), [(0.0, 0.01), (0.1, 0.01), (0.4, 0.005), (0.4, 0.02)])
def test_steps_between_uneven_rows_are_placed(tmp_path: Path, scatter: float, period_s: float) -> None:
    """Fails when a step is sought in another sample than that of its row, or not up to the time of the row itself."""
    assert left_pa(recorded(tmp_path, scatter, period_s, 55, steady=scatter == 0.0, sooner=True)) < 1.2 * NOISE_PA


def test_readings_on_an_even_clock_have_no_times_of_their_own(tmp_path: Path) -> None:
    """Fails when every recording pays for a correction that changes nothing."""
    signals = recorded(tmp_path, 0.0, 0.01, 52, steady=True)
    assert signals.own is None
    assert left_pa(signals) < 1.2 * NOISE_PA


def test_a_model_gives_what_lies_between_readings(tmp_path: Path) -> None:
    """Fails when pressures or angles are put on the samples without the bend that the model has between them."""
    segment = joint_problem([recorded(tmp_path, 0.4, 0.01, 53)], load_hand(CONFIG), JOINT).segments[0]
    assert segment.own is not None
    samples, finer = np.arange(float(len(segment.angle_rad))), 8

    def true(at: Array) -> Array:
        return np.array([1e5 * np.sin(1.5 * at), 0.3 * np.cos(1.2 * at), 0.0 * at])

    slow = 0.01 * samples  # what a model leaves
    at = samples + segment.own.late_s / segment.period_s
    own = OwnReadings(segment.own.late_s, true(at)[0] + 0.01 * at, true(at)[1])
    lines = [np.interp(samples, at[np.isfinite(at)], values[np.isfinite(at)]) for values in true(at)]
    cut = replace(
        segment, own=own, pressure_pa=lines[0], angle_rad=lines[1], use=np.ones((3, len(samples)), dtype=bool)
    )
    put = on_samples(cut, true(np.arange(finer * (len(samples) - 1.0) + 1.0) / finer), finer)
    inside = slice(1, -1)
    assert np.abs(put.pressure_pa - true(samples)[0] - slow)[inside].max() < 500.0
    assert np.abs(cut.pressure_pa - true(samples)[0])[inside].max() > 1e4
    assert np.abs(put.angle_rad - true(samples)[1])[inside].max() < 1.5e-3
    assert np.abs(cut.angle_rad - true(samples)[1])[inside].max() > 3e-2
    rough = on_samples(cut, -true(np.arange(finer * (len(samples) - 1.0) + 1.0) / finer), finer)
    np.testing.assert_array_equal(rough.pressure_pa, cut.pressure_pa)  # a wrong model leaves nothing smoother


def test_a_bag_keeps_readings_at_uneven_stamps(tmp_path: Path) -> None:
    """Fails when readings of a bag lose their stamps or values, or another topic's stamps count as those of angles."""
    print("seed 56")
    hand, rng = load_hand(CONFIG), np.random.default_rng(56)
    commands = np.repeat(rng.uniform(0.0, 3e5, (6, 11)), 100, axis=0)
    for _ in record_offline(hand, commands, tmp_path / "run.mcap", seed=4):
        pass
    recording = load_recording(tmp_path / "run.mcap")
    assert hand_signals(recording, hand).own is None
    states, pressures = recording["joint_states"], recording["pressures"]
    late_ns = rng.integers(-2_000_000, 2_000_000, len(states))
    late_ns[[0, -1]] = 0
    at_s = 1e-9 * (states.stamp_ns + late_ns - states.stamp_ns[0])
    angle = 0.5 + 0.4 * np.sin(7.0 * at_s)[:, None] + np.zeros((1, states["position"].shape[1]))
    recording.topics["joint_states"] = replace(
        states, stamp_ns=states.stamp_ns + late_ns, fields={**states.fields, "position": angle}
    )
    recording.topics["pressures"] = replace(pressures, stamp_ns=pressures.stamp_ns + late_ns)
    own = hand_signals(recording, hand).own
    assert own is not None
    np.testing.assert_allclose(own.late_s, 1e-9 * late_ns, atol=3e-4)  # the clock is estimated
    np.testing.assert_allclose(own.angle_rad, angle, atol=1e-12)
    columns = [pressures.names.index(joint) for joint in hand.joints]
    np.testing.assert_allclose(own.pressure_pa, pressures["pressure"][:, columns], atol=1e-6)
    recording.topics["pressures"] = replace(pressures, stamp_ns=pressures.stamp_ns + late_ns + 1_000_000)
    apart = hand_signals(recording, hand).own
    assert apart is not None and not np.isfinite(apart.pressure_pa).any()


def test_spikes_and_the_curve_of_the_sensor_reach_the_readings(tmp_path: Path) -> None:
    """Fails when a spike that was left out comes back, or angles without the sensor's curve get readings with it."""
    hand, signals = load_hand(CONFIG), recorded(tmp_path, 0.3, 0.01, 54)
    assert signals.own is not None
    own = signals.own.angle_rad.copy()
    own[70] = 30.0
    kept = replace(signals.own, angle_rad=own).within(6.0, 2e6)
    assert np.isnan(kept.angle_rad[70, 0])
    assert np.isnan(kept.pressure_pa[70, 0])
    assert np.isfinite(np.delete(kept.angle_rad, 70)).sum() == np.isfinite(np.delete(own, 70)).sum()
    true = without_sensor_curve(signals, hand)
    assert true.own is not None
    known = np.isfinite(signals.own.angle_rad[:, 0])
    moved = np.interp(signals.own.angle_rad[known, 0], *_sorted(signals.angle_rad[:, 0], true.angle_rad[:, 0]))
    np.testing.assert_allclose(true.own.angle_rad[known, 0], moved, atol=1e-3)


def _sorted(x: Array, y: Array) -> tuple[Array, Array]:
    order = np.argsort(x)
    return x[order], y[order]
