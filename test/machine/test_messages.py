"""Recordings of topics for machines: numbers by their paths, commands that hold, two clocks, one-line errors."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rosbags.typesys import Stores, get_typestore
from scipy.integrate import solve_ivp
from typer.testing import CliRunner

from hand_machine.description import load_description
from hand_machine.machine import load_machine
from hand_machine.reading import read_machine
from hand_machine.suggestion import suggest_map
from hand_model.yaml_loader import DescriptionError
from hand_recording.bag_writer import Topic, open_bag
from hand_recording.message_numbers import read_series
from hand_recording.recording_files import RecordingError
from hand_tool.cli import app

STORE = get_typestore(Stores.ROS2_JAZZY)
STATE, ARRAY, WRENCH = "sensor_msgs/msg/JointState", "std_msgs/msg/Float64MultiArray", "geometry_msgs/msg/WrenchStamped"
CLOCK = "rosgraph_msgs/msg/Clock"
START_NS = 1_790_000_000_000_000_000
COMMAND, POSITION = "/effort_controller/commands.data[1]", "/joint_states.position[elbow]"
ELBOW: dict[str, Any] = {
    "schema": 1,
    "name": "elbow",
    "motion": "rotary",
    "gain": 1.0,
    "stiffness": 4.0,
    "damping": 0.3,
    "inertia": 0.02,
    "columns": {"input": {"column": COMMAND}, "position": {"column": POSITION}},
}
OTHERS = "angle_lag,angle_offset,backlash,clock_offset,contact,hysteresis,stiffening"
Message = tuple[str, int, bytes]
"""Topic, time of sending [ns], bytes."""


def header(at_ns: int) -> Any:
    time = STORE.types["builtin_interfaces/msg/Time"](*divmod(at_ns, 1_000_000_000))
    return STORE.types["std_msgs/msg/Header"](time, "")


def state(at_ns: int, names: Sequence[str], positions: Sequence[float], sent_ns: int | None = None) -> Message:
    none = np.array([], np.float64)
    message = STORE.types[STATE](header(at_ns), list(names), np.array(positions, np.float64), none, none)
    return "/joint_states", sent_ns or at_ns, bytes(STORE.serialize_cdr(message, STATE))


def command(at_ns: int, values: Sequence[float]) -> Message:
    layout = STORE.types["std_msgs/msg/MultiArrayLayout"]([], 0)
    message = STORE.types[ARRAY](layout, np.array(values, np.float64))
    return "/effort_controller/commands", at_ns, bytes(STORE.serialize_cdr(message, ARRAY))


def tick(shown_ns: int, sent_ns: int) -> Message:
    message = STORE.types[CLOCK](STORE.types["builtin_interfaces/msg/Time"](*divmod(shown_ns, 1_000_000_000)))
    return "/clock", sent_ns, bytes(STORE.serialize_cdr(message, CLOCK))


def write(path: Path, messages: Sequence[Message], storage: str = "mcap") -> Path:
    types = {"/joint_states": STATE, "/effort_controller/commands": ARRAY, "/clock": CLOCK, "/wrench": WRENCH}
    bag = open_bag(path, storage)
    for topic in dict.fromkeys(topic for topic, _, _ in messages):
        bag.add_topic(Topic.of(topic, types[topic]))
    for topic, at_ns, raw in sorted(messages, key=lambda message: message[1]):
        bag.write(topic, raw, at_ns, at_ns)
    bag.close()
    return path


def describe(folder: Path, **changed: Any) -> Path:
    path = folder / "elbow.yaml"
    path.write_text(json.dumps(ELBOW | changed), encoding="utf-8")
    return path


def seconds(at_s: float) -> int:
    return START_NS + round(1e9 * at_s)


@pytest.fixture(scope="module")
def motion() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Times and values of commands at 23 Hz [s, N m]; times and angles of an arm with dry friction [s, rad]."""
    given = np.arange(0.0, 14.0, 1.0 / 23.0)
    rng = np.random.default_rng(1)
    print("seed 1")
    levels = np.repeat(rng.uniform(-1.5, 1.5, 20), 23)[: len(given)]
    values = 0.6 * levels + 0.4 * np.sin(2.1 * given)

    def rates(t: float, y: np.ndarray) -> list[float]:
        torque = values[np.searchsorted(given, t, side="right") - 1]
        return [y[1], (torque - 4.0 * y[0] - 0.3 * y[1] - 0.15 * np.tanh(y[1] / 0.005)) / 0.02]

    time = np.arange(0.0, 14.0, 0.01)
    found = solve_ivp(rates, (0.0, 14.0), [0.0, 0.0], "LSODA", time, max_step=0.005, rtol=1e-7, atol=1e-9)
    return given, values, time, found.y[0]


def messages(motion: tuple[np.ndarray, ...], *, first_s: float = 0.0) -> list[Message]:
    """As ros2_control publishes: joint states of two joints in an order that changes, commands without headers."""
    given, values, time, angle = motion
    both = [("elbow", "wrist"), ("wrist", "elbow")]
    states = [
        state(seconds(t), names, [x if name == "elbow" else 0.3 for name in names])
        for k, (t, x) in enumerate(zip(time, angle, strict=True))
        for names in [both[k % 2]]
    ]
    return states + [command(seconds(t), [0.0, u]) for t, u in zip(given, values, strict=True) if t >= first_s]


@pytest.mark.parametrize(("name", "storage"), [("bag", "mcap"), ("bag.mcap", "mcap"), ("bag", "sqlite3")])
def test_joint_states_and_commands_of_every_storage(
    tmp_path: Path, motion: tuple[np.ndarray, ...], name: str, storage: str
) -> None:
    """Fails when an element is taken by its place and not its name, or a command is interpolated and not held."""
    given, values, time, angle = motion
    path = write(tmp_path / name, messages(motion), storage)
    found = read_machine(load_description(describe(tmp_path)), path)
    assert found.known.all()
    assert found.period_s == pytest.approx(0.01)
    assert np.allclose(found.signals["position"], angle, atol=1e-9)
    held = values[np.searchsorted(given, time + 1e-6, side="right") - 1]
    assert np.mean(np.abs(found.signals["input"] - held) > 1e-12) < 0.01  # a command between two nanoseconds
    assert found.notes == ()


def test_what_is_before_the_first_command_is_left_out(tmp_path: Path, motion: tuple[np.ndarray, ...]) -> None:
    """Fails when an input is invented before the first command, or a number of another clock is taken for a start."""
    path = write(tmp_path / "bag", messages(motion, first_s=2.5))
    found = read_machine(load_description(describe(tmp_path)), path)
    assert len(found.time_s) == pytest.approx(1400 - 252, abs=2)
    assert any("input begins 2.52 s after the position" in line for line in found.notes)


@pytest.mark.parametrize("ticking", [True, False])
def test_a_simulated_clock(tmp_path: Path, motion: tuple[np.ndarray, ...], ticking: bool) -> None:
    """Fails when times of sending are mixed with headers of a slower clock, with /clock or without it."""
    given, values, time, angle = motion
    rate, origin = 2.5, 5_000_000_000  # the simulation runs at 0.4 of the real time
    sent = [seconds(rate * t) for t in time]
    states = [state(origin + round(1e9 * t), ["elbow"], [x], at) for t, x, at in zip(time, angle, sent, strict=True)]
    commands = [command(seconds(rate * t), [0.0, u]) for t, u in zip(given, values, strict=True)]
    ticks = [tick(origin + round(1e9 * t), at) for t, at in zip(time, sent, strict=True)] if ticking else []
    path = write(tmp_path / "bag", [*states, *commands, *ticks])
    found = read_machine(load_description(describe(tmp_path)), path)
    assert found.period_s == pytest.approx(0.01 if ticking else 0.025, rel=1e-3)
    assert any("no /clock" in line for line in found.notes) is not ticking
    held = values[np.searchsorted(given, time + 1e-5, side="right") - 1]
    assert np.mean(np.abs(found.signals["input"][: len(held)] - held[: len(found.time_s)]) > 1e-9) < 0.02


def test_times_of_sending_where_the_file_asks_for_them(tmp_path: Path, motion: tuple[np.ndarray, ...]) -> None:
    """Fails when headers of a clock that is 0.4 s off are used although the machine file says sent."""
    _, _, time, angle = motion
    late = [state(seconds(t - 0.4), ["elbow"], [x], seconds(t)) for t, x in zip(time, angle, strict=True)]
    path = write(tmp_path / "bag", [*late, *(m for m in messages(motion) if m[0] != "/joint_states")])
    columns = ELBOW["columns"] | {"time": {"column": "sent"}}
    found = read_machine(load_description(describe(tmp_path, columns=columns)), path)
    assert np.allclose(found.signals["position"], angle, atol=1e-9)
    other = read_machine(load_description(describe(tmp_path)), path)
    assert len(other.time_s) == len(found.time_s) - 40


def test_diagnosis_prediction_and_comparison_of_recordings_of_topics(
    tmp_path: Path, motion: tuple[np.ndarray, ...]
) -> None:
    """Fails when a command of the tool does not take a recording of topics, or the hidden friction is not found."""
    path = write(tmp_path / "run", messages(motion))
    other = write(tmp_path / "again.mcap", messages(motion))
    machine, out = describe(tmp_path), tmp_path / "out"
    arguments = ["diagnose", str(path), "--machine", str(machine), "--out", str(out), "--without", OTHERS]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    content = json.loads((out / "report.json").read_text(encoding="utf-8"))
    first = content["findings"][0]
    assert first["effect"] == "coulomb_friction"
    assert first["parameters"]["coulomb_friction.torque_nm"]["value"] == pytest.approx(0.15, abs=0.02)
    result = CliRunner().invoke(app, ["predict", str(other), "--model", str(out / "model.yaml")])
    assert result.exit_code == 0, result.output
    arguments = ["compare", str(path), str(other), "--machine", str(machine), "--out", str(tmp_path / "both")]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert "equal" in result.output


def test_a_proposed_map_names_topics(tmp_path: Path, motion: tuple[np.ndarray, ...]) -> None:
    """Fails when the joint that moves or the topic of commands is not proposed, or the proposal is not valid."""
    path = write(tmp_path / "bag", messages(motion))
    text = suggest_map(path)
    columns = yaml.safe_load(text)["columns"]
    assert {name: part["column"] for name, part in columns.items()} == {"input": COMMAND, "position": POSITION}
    read_machine(load_description(describe(tmp_path, columns=columns)), path)
    result = CliRunner().invoke(app, ["diagnose", str(path), "--suggest-map"])
    assert (result.exit_code, result.output) == (0, text)


def test_a_measured_force_of_a_wrench(tmp_path: Path, motion: tuple[np.ndarray, ...]) -> None:
    """Fails when numbers below several fields cannot be named, or a force with other times is not interpolated."""
    _, _, time, angle = motion
    vector, kind = STORE.types["geometry_msgs/msg/Vector3"], STORE.types["geometry_msgs/msg/Wrench"]
    wrenches: list[Message] = []
    for t, x in zip(time, angle, strict=True):
        wrench = STORE.types[WRENCH](header(seconds(t + 0.003)), kind(vector(0.0, 0.0, 4.0 * x), vector(0.0, 0.0, 0.0)))
        wrenches.append(("/wrench", seconds(t + 0.004), bytes(STORE.serialize_cdr(wrench, WRENCH))))
    path = write(tmp_path / "bag", [*messages(motion), *wrenches])
    force = {"column": "/wrench.wrench.force.z"}
    columns = {"position": {"column": POSITION}, "force": force}
    assert yaml.safe_load(suggest_map(path))["columns"]["force"]["column"] == force["column"]
    rig = {key: value for key, value in ELBOW.items() if key != "gain"} | {"imposed": True, "columns": columns}
    (tmp_path / "rig.yaml").write_text(json.dumps(rig), encoding="utf-8")
    found = read_machine(load_description(tmp_path / "rig.yaml"), path)
    expected = np.interp(found.time_s, time + 0.003 - time[0], 4.0 * angle)
    assert np.abs(found.signals["force"] - expected)[5:-5].max() < 0.15


def test_messages_that_do_not_decode_are_named(tmp_path: Path, motion: tuple[np.ndarray, ...]) -> None:
    """Fails when a damaged message ends the reading, or nobody says that it was left out."""
    spoilt = [(topic, at, raw[:20] if k % 100 == 50 else raw) for k, (topic, at, raw) in enumerate(messages(motion))]
    found = read_machine(load_description(describe(tmp_path)), write(tmp_path / "bag", spoilt))
    assert any(re.search(r"14 messages do not decode as sensor_msgs/msg/JointState; left out", n) for n in found.notes)


@pytest.mark.parametrize(
    ("part", "line"),
    [
        ({"position": "/joint_stats.position[elbow]"}, "has no topic /joint_stats; it has: /joint_states, /effort_"),
        ({"position": "/joint_states.position[knee]"}, "there is no element knee; its names are "),
        ({"position": "/joint_states.angle[elbow]"}, "with the fields header, name, position, velocity, effort and no"),
        ({"position": "/joint_states.velocity[elbow]"}, "its list has 0 elements, numbered from 0, and no .elbow."),
        ({"position": "/joint_states.position"}, "the path ends at a list of 2"),
        ({"position": "/joint_states"}, "is not a number of a message; write /topic.field"),
        ({"input": "/effort_controller/commands.data[2]"}, "its list has 2 elements, numbered from 0, and no .2."),
        ({"input": "/effort_controller/commands.data[x]"}, "the message names no elements, only numbers count"),
        ({"input": "/effort_controller/commands.layout.data_offset[0]"}, "follows a int, which is no list"),
        ({"input": "u", "position": "x"}, "is a recording of topics; columns of elbow.yaml must name numbers"),
        ({"input": "u"}, "input is 'u' and position is '/joint_states.position.elbow.'; either all of them"),
        ({"time": "t"}, "time is 't'; for messages it must be header or sent, or be left out"),
    ],
)
def test_a_wrong_path_is_refused_in_one_line(
    tmp_path: Path, motion: tuple[np.ndarray, ...], part: dict[str, str], line: str
) -> None:
    """Fails when a wrong topic, field or element is a traceback, or the line does not say what is there."""
    path = write(tmp_path / "bag", messages(motion)[:1600])
    columns = {name: dict(value) for name, value in ELBOW["columns"].items()}
    columns |= {name: {"column": text} for name, text in part.items()}
    if part.get("position") == "x":
        columns["time"] = {"column": "t"}
    machine = describe(tmp_path, columns=columns)
    with pytest.raises((RecordingError, DescriptionError), match=line) as refused:
        load_machine(machine, [path])
    assert "\n" not in str(refused.value)
    arguments = ["diagnose", str(path), "--machine", str(machine), "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2
    assert len(result.stderr.strip().splitlines()) == 1


def test_recordings_without_common_times_or_with_few_messages(tmp_path: Path, motion: tuple[np.ndarray, ...]) -> None:
    """Fails when commands that begin after the motion are held backwards, or ten messages are diagnosed."""
    described = load_description(describe(tmp_path))
    own = messages(motion)
    later = [command(seconds(20.0 + k / 50.0), [0.0, 1.0]) for k in range(200)]
    path = write(tmp_path / "later", [*(each for each in own if each[0] == "/joint_states"), *later])
    with pytest.raises(RecordingError, match=r"input and position have no time in common; .*columns.time: {column: se"):
        read_machine(described, path)
    with pytest.raises(RecordingError, match="has 10 samples; at least 100 are needed"):
        read_machine(described, write(tmp_path / "few", [*own[:10], *own[1400:]]))
    with pytest.raises(RecordingError, match=r"x\.csv is a table; columns.position of elbow.yaml names a topic"):
        (tmp_path / "x.csv").write_text("t,u,x\n0,0,0\n", encoding="utf-8")
        read_machine(described, tmp_path / "x.csv")
    none = write(tmp_path / "none", [command(seconds(k / 50.0), [0.0]) for k in range(200)])
    with pytest.raises(RecordingError, match="none of its 1 numbers changes"):
        suggest_map(none)
    with pytest.raises(RecordingError, match="has no topic /joint_states"):
        read_series(none, [POSITION])
