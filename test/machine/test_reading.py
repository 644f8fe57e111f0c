"""Recordings of machines: faults are found before interpolation, named and left out, or refused in a line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.integrate import solve_ivp
from scipy.io import savemat
from typer.testing import CliRunner

from hand_machine.description import load_description
from hand_machine.machine import load_machine
from hand_machine.reading import Readings, find_repeats, read_machine
from hand_machine.spikes import find_off_the_motion, find_spikes
from hand_machine.suggestion import suggest_map
from hand_model.yaml_loader import DescriptionError
from hand_recording.recording_files import RecordingError
from hand_recording.settings import READING
from hand_tool.cli import app

COLUMNS = {"time": {"column": "t"}, "input": {"column": "u"}, "position": {"column": "x"}}
SLIDE = {
    "schema": 1,
    "name": "slide",
    "motion": "linear",
    "gain": 2.0,
    "stiffness": 40.0,
    "damping": 4.0,
    "inertia": 0.2,
    "columns": COLUMNS,
}
PERIOD_S = 0.01


@pytest.fixture(scope="module")
def motion() -> dict[str, np.ndarray]:
    """Time [s], input and position [m] of a driven mass on a spring, from an integrator of scipy."""
    time = np.arange(0.0, 12.0, PERIOD_S)

    def drive(t: float) -> float:
        return float(np.sin(2.0 * t) + 0.5 * np.sin(5.3 * t))

    def rates(t: float, state: np.ndarray) -> list[float]:
        return [state[1], (2.0 * drive(t) - 40.0 * state[0] - 4.0 * state[1]) / 0.2]

    found = solve_ivp(rates, (0.0, time[-1]), [0.0, 0.0], t_eval=time, rtol=1e-8, atol=1e-10)
    return {"t": time, "u": np.array([drive(t) for t in time]), "x": found.y[0]}


def save(path: Path, columns: dict[str, np.ndarray]) -> None:
    with path.open("wb") as stream:
        np.savez(stream, **columns)  # type: ignore[arg-type]


def read(folder: Path, columns: dict[str, np.ndarray], description: dict[str, object] | None = None) -> Readings:
    (folder / "machine.yaml").write_text(json.dumps(description or SLIDE), encoding="utf-8")
    save(folder / "run.npz", columns)
    return read_machine(load_description(folder / "machine.yaml"), folder / "run.npz")


def test_the_same_readings_from_every_kind_of_file(tmp_path: Path, motion: dict[str, np.ndarray]) -> None:
    """Fails when a format changes a value, or good data get a note or lose a sample."""
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    expected = read(tmp_path, motion)
    np.savetxt(tmp_path / "run.csv", np.column_stack(list(motion.values())), delimiter=",", header="t,u,x", comments="")
    pq.write_table(pa.table(motion), tmp_path / "run.parquet")
    savemat(tmp_path / "run.mat", {"log": motion, "rate_hz": 100.0, "x": motion["x"], "note": "a text"})
    described = load_description(tmp_path / "machine.yaml")
    assert expected.known.all()
    assert expected.notes == ()
    assert np.allclose(expected.signals["position"], motion["x"], rtol=0.0, atol=1e-12)
    for suffix in ("csv", "parquet"):
        found = read_machine(described, tmp_path / f"run.{suffix}")
        assert np.array_equal(found.signals["position"], expected.signals["position"]), suffix
        assert np.array_equal(found.signals["input"], expected.signals["input"]), suffix
    nested = {
        name: {"column": "x" if name == "position" else f"log.{part['column']}"} for name, part in COLUMNS.items()
    }
    (tmp_path / "mat.yaml").write_text(json.dumps(SLIDE | {"columns": nested}), encoding="utf-8")
    found = read_machine(load_description(tmp_path / "mat.yaml"), tmp_path / "run.mat")
    assert np.array_equal(found.signals["position"], expected.signals["position"])


def test_a_gap_missing_readings_and_a_spike_are_named_and_left_out(
    tmp_path: Path, motion: dict[str, np.ndarray]
) -> None:
    """Fails when a gap, NaN or a spike is interpolated into a known sample, or is not named."""
    columns = {name: values.copy() for name, values in motion.items()}
    columns["x"][300] = 7.0
    columns["x"][500:600] = np.nan
    kept = np.r_[0:700, 1000:1200]
    found = read(tmp_path, {name: values[kept] for name, values in columns.items()})
    at = np.arange(len(motion["t"]))
    bad = (at == 300) | ((at >= 500) & (at < 600)) | ((at >= 700) & (at < 1000))
    assert not found.known[bad & (at != 300)].any()
    assert np.abs(found.signals["position"]).max() < 1.01 * np.abs(motion["x"]).max()
    usual = ~bad & ~((at >= 1000) & (at < 1050))
    assert found.known[usual].all()
    assert np.abs(found.signals["position"] - motion["x"])[usual | (at == 300)].max() < 1e-4
    text = "\n".join(found.notes)
    assert "1 gap, the longest of 3.01 s at 6.99 s" in text
    assert "position: 100 readings are missing or not finite, first at 5 s" in text
    assert "position: 1 spike, first at 3 s, up to 6.9" in text


def test_the_input_after_its_gap_is_not_evaluated_until_the_state_is_known_again(
    tmp_path: Path, motion: dict[str, np.ndarray]
) -> None:
    """Fails when samples count whose state depends on an input that nobody recorded."""
    columns = motion | {"u": np.where((motion["t"] > 4.0) & (motion["t"] < 5.0), np.nan, motion["u"])}
    known = read(tmp_path, columns).known
    assert known[:400].all()
    assert not known[405:545].any()
    assert known[560:].all()


def test_unsorted_repeated_and_irregular_times(tmp_path: Path, motion: dict[str, np.ndarray]) -> None:
    """Fails when rows out of order change the result, or irregular stamps are taken for regular ones."""
    rng = np.random.default_rng(4)
    order = rng.permutation(len(motion["t"]))
    order = np.r_[order, order[:7]]
    found = read(tmp_path, {name: values[order] for name, values in motion.items()})
    assert np.allclose(found.signals["position"], motion["x"], rtol=0.0, atol=1e-12)
    assert any("times go back at" in note for note in found.notes)
    assert any("7 repeated times" in note for note in found.notes)
    time = np.sort(rng.uniform(0.0, 11.9, 3000))
    uneven = {"t": time} | {name: np.interp(time, motion["t"], motion[name]) for name in ("u", "x")}
    found = read(tmp_path, uneven)
    assert any("intervals differ from their median" in note for note in found.notes)
    expected = np.interp(found.time_s, motion["t"], motion["x"])
    assert np.abs(found.signals["position"] - expected)[found.known].max() < 2e-3


@pytest.mark.parametrize("seed", range(3))
def test_noise_steps_and_pulses_of_the_input_are_no_spikes(seed: int) -> None:
    """Fails when noise, a stop, stick-slip or a commanded pulse is left out of good data; random: see the seed."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    walk = np.cumsum(rng.standard_normal(4000)) * 0.01
    stairs = np.repeat(rng.uniform(-1.0, 1.0, 40), 100) + 0.001 * rng.standard_normal(4000)
    counts = np.round(walk * 50.0) / 50.0
    for values in (walk, stairs, counts, rng.standard_normal(4000)):
        assert not find_spikes(values).any()
    pulse = np.zeros(1000)
    pulse[100:102] = 1.0
    assert not find_spikes(pulse, pulses=True).any()
    walk[[50, 2000, 2001]] += [9.0, -9.0, -9.0]
    assert np.flatnonzero(find_spikes(walk)).tolist() == [50, 2000, 2001]


@pytest.mark.parametrize("seed", range(3))
def test_small_spikes_of_a_position_are_found_and_turns_are_not(seed: int, motion: dict[str, np.ndarray]) -> None:
    """Fails when a reading off the motion stays, or turns, steps or a fast motion lose readings; see the seed."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    time, noise = motion["t"], 2e-5 * rng.standard_normal(len(motion["t"]))
    where = np.sort(rng.choice(np.arange(10, len(time) - 10, 12), 20, replace=False))
    spoilt = motion["x"] + noise
    spoilt[where] += 1.5e-3 * rng.choice([-1.0, 1.0], len(where))
    assert np.flatnonzero(find_off_the_motion(time, spoilt)).tolist() == where.tolist()
    triangle = np.abs(time % 2.0 - 1.0) + noise
    fast = np.sin(2.0 * np.pi * 37.0 * time) + noise
    for values in (motion["x"] + noise, triangle, np.round(motion["x"] / 5e-4) * 5e-4, fast, np.zeros(200)):
        at_s = np.asarray(np.arange(len(values)) * PERIOD_S, dtype=np.float64)
        assert not find_off_the_motion(at_s, np.asarray(values, dtype=np.float64)).any()


def test_repeated_readings_of_a_slow_sensor_count_once(tmp_path: Path, motion: dict[str, np.ndarray]) -> None:
    """Fails when a held reading counts as a standstill, or the steps of an encoder or an axis at rest count as held."""
    rng = np.random.default_rng(0)
    updates = np.unique(np.r_[0, np.cumsum(rng.integers(3, 7, 400))])
    updates = updates[updates < len(motion["t"])]
    latest = updates[np.searchsorted(updates, np.arange(len(motion["t"])), side="right") - 1]
    found = read(tmp_path, motion | {"x": motion["x"][latest]})
    assert any("position: held for" in note for note in found.notes)
    assert (
        np.abs(found.signals["position"] - motion["x"])[found.known].max()
        < 0.15 * np.abs(np.diff(motion["x"][::5])).max()
    )
    assert found.known.mean() > 0.95
    encoder = np.round(motion["x"] / 2e-3) * 2e-3
    assert not find_repeats(encoder)[0].any()
    stopped = np.r_[motion["x"][latest][:600], np.full(600, motion["x"][latest][599])]
    assert not find_repeats(stopped)[0][650:].any()


def test_offset_delay_and_limits_of_columns(tmp_path: Path, motion: dict[str, np.ndarray]) -> None:
    """Fails when a stated offset, dead time or limit is not applied, or nonsense is not refused in a line."""
    stated = {
        "time": COLUMNS["time"],
        "input": {"column": "u", "offset": 0.25, "delay": 0.1, "limits": [-0.8, 0.9]},
        "position": {"column": "x", "offset": -0.01},
    }
    found = read(tmp_path, motion, SLIDE | {"columns": stated})
    late = 10
    expected = np.clip(motion["u"] + 0.25, -0.8, 0.9)
    assert np.allclose(found.signals["input"][late:], expected[:-late], atol=1e-12)
    assert np.allclose(found.signals["position"], motion["x"] - 0.01, atol=1e-12)
    wrong = {"limits": [1.0, 1.0]}, {"delay": -0.1}, {"delay": 1e3}
    for part in wrong:
        columns = COLUMNS | {"input": {"column": "u"} | part}
        with pytest.raises(DescriptionError, match=f"columns.input.{next(iter(part))}"):
            read(tmp_path, motion, SLIDE | {"columns": columns})
    with pytest.raises(DescriptionError, match=r"columns\.position\.delay is not a known key"):
        read(tmp_path, motion, SLIDE | {"columns": COLUMNS | {"position": {"column": "x", "delay": 0.1}}})


def changed(motion: dict[str, np.ndarray], case: str) -> tuple[dict[str, np.ndarray], dict[str, object]]:
    """A recording and a machine file with one mistake."""
    time, u, x = motion["t"], motion["u"], motion["x"]
    renamed = {name: dict(part) for name, part in COLUMNS.items()}
    data = {
        "no column": {"t": time, "u": u, "position": x},
        "constant position": motion | {"x": np.full(len(x), 0.3)},
        "constant time": motion | {"t": np.full(len(x), 5.0)},
        "milliseconds": motion | {"t": np.round(1e3 * time)},
        "named milliseconds": {"t_ms": 1e3 * time + 0.1, "u": u, "x": x},
        "microseconds as milliseconds": motion | {"t": 1e6 * time + 0.1},
        "wrong sign": motion | {"x": -x},
        "millimetres": motion | {"x": 1e3 * x},
        "ten samples": {name: values[:10] for name, values in motion.items()},
        "no numbers": motion | {"x": np.full(len(x), np.nan)},
        "mostly missing": motion | {"x": np.where(time > 3.0, np.nan, x)},
    }
    if case == "named milliseconds":
        renamed["time"]["column"] = "t_ms"
    if case == "microseconds as milliseconds":
        renamed["time"]["scale"] = 1e-3  # type: ignore[assignment]
    return data[case], SLIDE | {"columns": renamed}


@pytest.mark.parametrize(
    ("case", "line"),
    [
        ("no column", "has no column 'x'; it has: t, u, position"),
        ("constant position", "position is constant at 0.3; it must change"),
        ("constant time", "column 't' is constant at 5; it must hold rising times"),
        ("milliseconds", "are whole numbers; state their unit.*1.0e-3 for ms"),
        ("named milliseconds", "is named in ms, but its scale is 1; .*columns.time.scale: 1.0e-3"),
        ("microseconds as milliseconds", "times are 10 s apart.*check the unit of the time column"),
        ("wrong sign", "opposite sign.*change the sign of columns.input.scale or columns.position.scale"),
        ("millimetres", "times what the model expects.*check the units.*the factor of milli- or kilo-units, as mm"),
        ("ten samples", "has 10 samples; at least 100 are needed"),
        ("no numbers", "position holds no finite number"),
        ("mostly missing", "of position is missing; at most 50%"),
    ],
)
def test_a_wrong_recording_is_refused_in_one_line(
    tmp_path: Path, motion: dict[str, np.ndarray], case: str, line: str
) -> None:
    """Fails when a mistake in the data or the machine file is diagnosed as physics, or the line does not name it."""
    columns, description = changed(motion, case)
    (tmp_path / "machine.yaml").write_text(json.dumps(description), encoding="utf-8")
    save(tmp_path / "run.npz", columns)
    with pytest.raises(RecordingError, match=line) as refused:
        load_machine(tmp_path / "machine.yaml", [tmp_path / "run.npz"])
    assert "\n" not in str(refused.value)
    arguments = ["diagnose", str(tmp_path / "run.npz"), "--machine", str(tmp_path / "machine.yaml")]
    result = CliRunner().invoke(app, [*arguments, "--out", str(tmp_path / "out")])
    assert result.exit_code == 2
    assert len(result.stderr.strip().splitlines()) == 1


def test_too_many_rows_are_refused_before_they_are_parsed(tmp_path: Path) -> None:
    """Fails when a huge text is read into memory before anybody says that it is too long."""
    (tmp_path / "long.csv").write_bytes(b"t,u,x\n" + b"0,0,0\n" * (READING.max_samples + 1))
    (tmp_path / "machine.yaml").write_text(json.dumps(SLIDE), encoding="utf-8")
    with pytest.raises(
        RecordingError, match="has 1000001 rows; the allowed range is up to 1000000; keep every 2th row"
    ):
        read_machine(load_description(tmp_path / "machine.yaml"), tmp_path / "long.csv")


def test_a_proposed_map_is_accepted_and_gives_si(tmp_path: Path, motion: dict[str, np.ndarray]) -> None:
    """Fails when proposed columns or units are wrong, or the proposal is no valid part of a machine file."""
    table = {
        "Time (ms)": 1e3 * motion["t"],
        "goalCurrent": motion["u"],
        "pos_mm": 1e3 * motion["x"],
        "temperature": np.full(len(motion["t"]), 20.0),
    }
    save(tmp_path / "run.npz", table)
    text = suggest_map(tmp_path / "run.npz")
    columns = yaml.safe_load(text)["columns"]
    assert "its name ends in ms" in text
    assert "Constant, of no use as a signal: temperature" in text
    (tmp_path / "machine.yaml").write_text(json.dumps(SLIDE | {"columns": columns}), encoding="utf-8")
    found = read_machine(load_description(tmp_path / "machine.yaml"), tmp_path / "run.npz")
    assert found.period_s == pytest.approx(PERIOD_S)
    assert np.allclose(found.signals["position"], motion["x"], atol=1e-9)
    assert np.allclose(found.signals["input"], motion["u"])
    result = CliRunner().invoke(app, ["diagnose", str(tmp_path / "run.npz"), "--suggest-map"])
    assert (result.exit_code, result.output) == (0, text)


@pytest.mark.parametrize("option", ["--ask", "--joints=axis", "--map=machine.yaml"])
def test_options_without_a_part_in_a_machine_are_refused(
    tmp_path: Path, motion: dict[str, np.ndarray], option: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fails when an option is ignored in silence."""
    monkeypatch.chdir(tmp_path)
    read(tmp_path, motion)
    result = CliRunner().invoke(app, ["diagnose", "run.npz", "--machine", "machine.yaml", "--out", "out", option])
    assert result.exit_code == 2
    assert f"{option.partition('=')[0]} cannot be used with --machine" in result.stderr
