"""Faults of the data are reported and are never taken for physics."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hand_diagnosis.diagnosis import diagnose
from hand_diagnosis.problem import check, not_judged
from hand_model.description import Hand
from hand_model.effects import EFFECTS
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW
from hand_recording.hand_signals import hand_signals
from hand_recording.loader import load_recording
from hand_recording.replay import record_offline
from hand_recording.signals import Signals
from test.diagnosis.recordings import changed, hand_tool, record

JOINT = 4


@pytest.fixture(scope="module")
def signals(hand: Hand) -> Signals:
    return record(hand, np.random.default_rng(70), 12.0)


def with_column(values: np.ndarray, column: np.ndarray) -> np.ndarray:
    changed = values.copy()
    changed[:, JOINT] = column
    return changed


def test_a_sound_recording_is_sound(signals: Signals, hand: Hand) -> None:
    """Fails when ordinary data are reported as faulty."""
    found = check(signals, hand)
    assert found.lines == ()
    assert found.unusable == frozenset()


@pytest.mark.parametrize(
    ("field", "factor", "says"),
    [("angle_rad", 180.0 / np.pi, "degrees?"), ("pressure_pa", 1e-5, "another unit"), ("pressure_pa", 14.5, "unit")],
)
def test_another_unit_is_not_compared(field: str, factor: float, says: str, signals: Signals, hand: Hand) -> None:
    """Fails when degrees, bar or psi are diagnosed as if they were rad or Pa."""
    values = with_column(getattr(signals, field), factor * getattr(signals, field)[:, JOINT])
    wrong = replace(signals, angle_rad=values) if field == "angle_rad" else replace(signals, pressure_pa=values)
    result = diagnose([wrong], hand, tolerance=0.05, seed=0, joints=[hand.joints[JOINT]], sensor_curve=False)
    assert result.verdict == "unusable"
    assert not result.joints
    assert any(hand.joints[JOINT] in line and says in line for line in result.check), result.check


def test_swapped_channels_are_named(signals: Signals, hand: Hand) -> None:
    """Fails when two joints whose pressure channels are exchanged are diagnosed."""
    order = list(range(11))
    order[JOINT], order[9] = 9, JOINT
    found = check(replace(signals, pressure_pa=signals.pressure_pa[:, order]), hand)
    assert {hand.joints[JOINT], hand.joints[9]} <= found.unusable
    assert any("swapped" in line and hand.joints[9] in line for line in found.lines)


def test_a_joint_that_the_reader_refused_is_left_out_for_its_reason(signals: Signals, hand: Hand) -> None:
    """Fails when a joint whose set-points came between the rows is diagnosed, or the reason given is another one."""
    joint, why = signals.joints[4], "its set-points stepped between the rows"
    checked = check(replace(signals, refused=((joint, why),)), hand)
    assert checked.unusable == {joint}
    assert not_judged([checked], [], [joint]) == {joint: f"{why}; excluded"}


def test_spikes_rails_and_gaps_are_left_out(signals: Signals, hand: Hand) -> None:
    """Fails when an impossible sample, saturation or a gap stays in the fitted data, or is not reported."""
    angle = signals.angle_rad[:, JOINT].copy()
    angle[300] = 40.0
    rail = float(np.quantile(angle, 0.9))
    known = signals.known.copy()
    known[600:700] = False
    broken = replace(signals, angle_rad=with_column(signals.angle_rad, np.minimum(angle, rail)), known=known)
    broken.angle_rad[300, JOINT] = 40.0
    found = check(broken, hand)
    text = "\n".join(found.lines)
    assert "1 impossible readings" in text
    assert "saturated at" in text
    assert "1 gaps, the longest of 0.5 s at 3 s" in text
    judged = found.signals
    assert not judged.known[300, JOINT]
    assert abs(judged.angle_rad[300, JOINT]) < 2.0
    at_rail = judged.known[:, JOINT] & (judged.angle_rad[:, JOINT] == rail)
    assert at_rail.sum() < 0.2 * (angle >= rail).sum()


def test_a_channel_of_nan_is_named_and_excluded(hand: Hand, tmp_path: Path) -> None:
    """Fails when a bag whose angle channel holds no number gives a finding or a traceback, or is not reported."""
    noisy = record(hand, np.random.default_rng(71), 10.0)
    lost = replace(noisy, known=noisy.known.copy())
    lost.known[:, JOINT] = False
    result = diagnose([lost], hand, tolerance=0.05, seed=0, joints=[hand.joints[JOINT]], sensor_curve=False)
    assert not result.findings
    assert any("missing or not finite" in line for line in result.check)


def test_ten_million_samples_are_one_line(tmp_path: Path) -> None:
    """Fails when a recording that is far too long is fitted, or is refused without advice."""
    count = 10_000_000
    time_s = np.arange(count) * 0.005
    path = tmp_path / "long.npz"
    np.savez(path, t=time_s, p=np.zeros(count, np.float32), phi=np.zeros(count, np.float32))
    mapping = tmp_path / "map.yaml"
    mapping.write_text(
        "time: {column: t}\njoints: {index_distal: {angle: {column: phi}, pressure: {column: p}}}\n", encoding="utf-8"
    )
    result = hand_tool("diagnose", str(path), "--map", str(mapping), "--out", str(tmp_path / "out"))
    assert result.exit_code == 2, result.output
    assert "10000000 rows" in result.output
    assert "cut it into several recordings" in result.output


def test_repeated_and_unsorted_stamps_change_nothing(hand: Hand, tmp_path: Path) -> None:
    """Fails when stamps that come twice or out of order give a finding or a traceback."""
    out = tmp_path / "run.mcap"
    rng = np.random.default_rng(72)
    commands = np.repeat(rng.uniform(0.0, 3e5, (12, 11)), 100, axis=0)
    for _ in record_offline(hand, commands, out, seed=4):
        pass
    shuffled = tmp_path / "shuffled"
    rewrite(out, shuffled, rng)
    result = hand_tool("diagnose", str(shuffled), "--joints", "index_distal", "--out", str(tmp_path / "out"), "--json")
    assert result.exit_code == 0, result.output
    assert '"verdict": "agrees"' in result.output


@pytest.mark.parametrize(("late_ms", "says"), [(15.0, "15 ms behind"), (-8.0, "8 ms ahead"), (0.0, "")])
def test_a_clock_of_its_own_is_said(late_ms: float, says: str, hand: Hand, tmp_path: Path) -> None:
    """Fails when another clock of the pressures is not reported, or is reported for an ordinary bag."""
    out = tmp_path / "run.mcap"
    for _ in record_offline(hand, np.full((600, 11), 1e5), out, seed=4):
        pass
    recording = load_recording(out)
    pressures = recording["pressures"]
    recording.topics["pressures"] = replace(pressures, stamp_ns=pressures.stamp_ns - round(late_ms * 1e6))
    notes = [note for note in hand_signals(recording, hand).notes if "clocks differ" in note]
    assert len(notes) == (1 if says else 0), notes
    assert all(says in note for note in notes), notes


@pytest.mark.parametrize("described_hz", [200.0, 50.0])
def test_a_recording_at_another_rate_than_described_is_said(described_hz: float, hand: Hand, tmp_path: Path) -> None:
    """Fails when a recording that does not fit the rate of the description gives no hint, or any other gives one."""
    out = tmp_path / "run.mcap"
    for _ in record_offline(hand, np.full((600, 11), 1e5), out, seed=4):
        pass
    described = replace(hand, rate_hz=described_hz)
    notes = [note for note in hand_signals(load_recording(out), described).notes if "another description" in note]
    assert len(notes) == (described_hz != 200.0)
    assert all("joint_states comes at 200 Hz" in note and "is 50;" in note for note in notes)


def test_pressures_between_the_ticks_keep_their_times(hand: Hand, tmp_path: Path) -> None:
    """Fails when readings stamped between the angles' are interpolated, which cuts corners and hides noise."""
    out = tmp_path / "run.mcap"
    commands = np.repeat(np.random.default_rng(74).uniform(0.0, 3e5, (20, 11)), 100, axis=0)
    for _ in record_offline(hand, commands, out, seed=4):
        pass
    recording = load_recording(out)
    sound, pressures = hand_signals(recording, hand), recording["pressures"]
    recording.topics["pressures"] = replace(pressures, stamp_ns=pressures.stamp_ns + 2_000_000)
    late = hand_signals(recording, hand)
    assert late.pressure_late_s == pytest.approx(0.002)
    assert sound.pressure_late_s == 0.0
    inside = slice(2, -2)
    np.testing.assert_array_equal(late.pressure_pa[inside], sound.pressure_pa[inside])
    result = diagnose([late], hand, tolerance=0.05, seed=0, joints=[hand.joints[JOINT]], sensor_curve=True)
    assert [finding.effect for finding in result.findings] == ["clock_offset"], result.findings
    offset = next(number for number in result.findings[0].numbers if number.key == "clock_offset.offset_s")
    assert abs(offset.value) == pytest.approx(0.002, abs=4e-4)
    pressure = next(stage for stage in result.joints[0].results if stage.name == "pressure")
    assert pressure.after < 1.1 * pressure.noise


def test_a_rerun_is_checked_like_any_recording(signals: Signals, hand: Hand) -> None:
    """Fails when a fault of a re-run's channel is taken for poor repeatability, or is not reported."""
    wrong = replace(
        signals,
        name="again",
        angle_rad=with_column(signals.angle_rad, 180.0 / np.pi * signals.angle_rad[:, JOINT]),
    )
    joints = [hand.joints[JOINT]]
    result = diagnose([signals], hand, tolerance=0.05, seed=0, joints=joints, sensor_curve=False, reruns=[wrong])
    assert any(line.startswith("again") and "degrees?" in line for line in result.check), result.check
    assert result.joints[0].search.problem.floor[1] < np.radians(0.06)


@pytest.mark.long
def test_a_number_far_off_asks_for_a_larger_tolerance(hand: Hand) -> None:
    """Fails when a nominal number that reaches its bound is not reported."""
    strong = changed(hand, hand.joints[JOINT], statics__a2_nm_per_pa=1.15 * nominal(hand, "statics.a2_nm_per_pa"))
    far = record(strong, np.random.default_rng(73), 12.0)
    others = sorted(EFFECTS.keys() - {"coulomb_friction", "leak"})  # rivals cost time and change nothing here
    lines = [
        diagnose(
            [far], hand, tolerance=share, seed=0, joints=[hand.joints[JOINT]], without=others, sensor_curve=False
        ).check
        for share in (0.01, 0.1)
    ]
    assert any("statics.a2_nm_per_pa" in line and "--tolerance" in line for line in lines[0]), lines[0]
    assert not any("--tolerance" in line for line in lines[1]), lines[1]


def nominal(hand: Hand, key: str) -> float:
    return float(hand.parameters[ROW[key], JOINT] / JOINT_PARAMETERS[ROW[key]].scale)


def rewrite(source: Path, target: Path, rng: np.random.Generator) -> None:
    """The bag with every tenth message twice and neighbours exchanged, by a library that did not write it."""
    from rosbags.highlevel import AnyReader  # noqa: PLC0415 - only here
    from rosbags.rosbag2 import Writer  # noqa: PLC0415 - only here

    with AnyReader([source]) as reader, Writer(target, version=9) as writer:
        topics = {
            c.topic: writer.add_connection(c.topic, c.msgtype, typestore=reader.typestore) for c in reader.connections
        }
        messages = list(reader.messages())
        for k in range(0, len(messages) - 1, 7):
            messages[k], messages[k + 1] = messages[k + 1], messages[k]
        for connection, stamp, data in messages:
            for _ in range(2 if rng.random() < 0.1 else 1):
                writer.write(topics[connection.topic], stamp, data)
