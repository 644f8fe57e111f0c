"""Recordings made by the offline plant: a replay of recorded valve commands, or a simulation of given set-points."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

from hand_driver.board import Frame, Status
from hand_driver.measurement import Converter
from hand_driver.topics import TOPICS, FrameTopics
from hand_messages.cdr import Layout
from hand_messages.cdr_walk import Plan
from hand_messages.layouts import VALVE_COMMAND
from hand_model.arrays import Array
from hand_model.description import Hand
from hand_recording.bag_writer import Topic, open_bag
from hand_recording.loader import Recording, RecordingError
from hand_recording.time_base import published_on_stamp_clock
from hand_sim.offline import Commands, Measured, replay, without_noise
from hand_sim.plant import HandPlant, SimulatedPlant
from hand_sim.sample_ticks import Ticks

VELOCITY_TIME_CONSTANT_S = 0.01
"""The driver's default, so that the replayed velocities are comparable."""
START_NS = 1_700_000_000_000_000_000
"""First stamp of a simulated recording."""
MIN_SHARE = 0.1
"""Least share of the frames that a replay must reach."""
LIFETIME_S = 0.1
"""Lifetime of the set-points of a simulated recording."""
DESCRIPTION, DESCRIPTION_TYPE = "robot_description", "std_msgs/msg/String"
_FOREVER = QosTime(9223372036, 854775807)
DESCRIPTION_QOS = Qos(
    QosHistory.KEEP_LAST,
    1,
    QosReliability.RELIABLE,
    QosDurability.TRANSIENT_LOCAL,
    _FOREVER,
    _FOREVER,
    QosLiveliness.AUTOMATIC,
    _FOREVER,
    False,
)
"""As a running hand offers robot_description, so that a player keeps it for late subscribers."""


@dataclass(frozen=True, slots=True)
class Replay:
    """States (N, STATES, joints) of the plant at the recording's frames, and their clock."""

    hand: Hand
    namespace: str
    ticks: Ticks
    states: Array
    commands: Commands

    @property
    def stamp_ns(self) -> NDArray[np.int64]:
        """Stamps (N,) [ns] of the replayed frames: the recorded sample clock without its jitter."""
        return self.ticks.stamp_ns[self.ticks.number]


def replay_recording(recording: Recording, hand: Hand) -> Replay:
    """Simulate the hand with the recorded valve commands. Raises RecordingError where the recording does not fit it."""
    states, pressures = recording["joint_states"], recording["pressures"]
    position = _by_name(recording, "joint_states", "position", hand)
    velocity = _by_name(recording, "joint_states", "velocity", hand)
    stamps, first = np.unique(states.stamp_ns, return_index=True)
    if len(stamps) < 2:
        raise RecordingError(f"{recording.path} has {len(stamps)} frames of joint_states; two or more are needed")
    nearest = np.clip(np.searchsorted(pressures.stamp_ns, stamps), 0, len(pressures) - 1)
    pressure = _by_name(recording, "pressures", "pressure", hand)[nearest]
    commands = _commands(recording, hand)
    ticks, plant_states = replay(hand, Measured(stamps, position[first], velocity[first], pressure), commands)
    if len(plant_states) < MIN_SHARE * len(stamps):
        raise RecordingError(
            f"{recording.path}: the set-points in force are known at {len(plant_states)} of {len(stamps)} frames only;"
            f" at least {MIN_SHARE:.0%} are needed: the commands begin too late, or were sent by another clock"
        )
    return Replay(hand, recording.namespace, ticks, plant_states, commands)


def simulate_recording(hand: Hand, set_point_pa: Array, start_ns: int = START_NS) -> Replay:
    """A hand that starts vented and follows set-points (T, joints) [Pa gauge], one a frame, sent just after it."""
    period_s = 1.0 / hand.rate_hz
    plant = HandPlant(hand, period_s)
    states = np.concatenate([plant.state[None], plant.advance(set_point_pa[:-1])])
    ticks = Ticks(np.arange(len(states)), period_s, start_ns)
    # A set-point in force from tick k on was sent between ticks k - 1 and k.
    sent_ns = ticks.stamp_ns - round(0.8e9 * period_s)
    commands = Commands(sent_ns, set_point_pa, np.full(len(states), LIFETIME_S))
    return Replay(hand, "/hand", ticks, states, commands)


def record_offline(
    hand: Hand, set_point_pa: Array, out: Path, seed: int, storage: str = "mcap", urdf: str = ""
) -> Iterator[float]:
    """Write simulate_recording's recording of set-points (T, joints) [Pa]; yields the share done, 0 to 1."""
    yield from write_replay(simulate_recording(hand, set_point_pa), out, storage, seed, urdf)


def messages(result: Replay, seed: int | None) -> Iterator[tuple[int, tuple[bytes, ...]]]:
    """Stamp [ns] and serialized topics, in the order of TOPICS, of each replayed frame.

    Sensors, ADC and calibration are those of the driver.  seed: of the sensor noise; None: no noise.
    """
    hand = result.hand
    sensors = SimulatedPlant(hand if seed is not None else without_noise(hand), hand.rate_hz, seed or 0)
    converter = Converter(hand, VELOCITY_TIME_CONSTANT_S)
    topics = FrameTopics(hand, "hand")
    supply_v = hand.sensors.supply_voltage_v
    for number, stamp_ns, state in zip(result.ticks.number, result.stamp_ns, result.states, strict=True):
        counts = sensors.convert(state, supply_v)
        frame = Frame(int(number), int(stamp_ns) // 1000, supply_v, Status(0), counts, 0)
        yield int(stamp_ns), topics.encode(int(stamp_ns), frame, converter.convert(frame))


def write_replay(result: Replay, out: Path, storage: str, seed: int | None, urdf: str = "") -> Iterator[float]:
    """Write the replay and its commands as a recording; yields the share done, 0 ... 1. Raises BagError.

    urdf: of the hand, written as robot_description, the first message; empty: none.
    """
    names = [f"{result.namespace}/{topic}" for topic in TOPICS]
    bag = open_bag(out, storage)
    try:
        for name, spec in zip(names, TOPICS.values(), strict=True):
            bag.add_topic(Topic.of(name, spec.type))
        command = f"{result.namespace}/valve_command"
        bag.add_topic(Topic.of(command, VALVE_COMMAND.type))
        if urdf:
            description = f"{result.namespace}/{DESCRIPTION}"
            bag.add_topic(Topic.of(description, DESCRIPTION_TYPE, [DESCRIPTION_QOS]))
            begin_ns = int(min([*result.stamp_ns[:1], *result.commands.sent_ns[:1]]))
            bag.write(description, _encoded_description(urdf), begin_ns, begin_ns)
        sent = iter(_encoded_commands(result))
        waiting = next(sent, None)
        for index, (stamp_ns, raws) in enumerate(messages(result, seed)):
            for name, raw in zip(names, raws, strict=True):
                bag.write(name, raw, stamp_ns, stamp_ns)
            while waiting is not None and waiting[0] <= stamp_ns:
                bag.write(command, waiting[1], waiting[0], waiting[0])
                waiting = next(sent, None)
            yield (index + 1) / len(result.states)
    finally:
        bag.close()


def _encoded_description(urdf: str) -> bytes:
    plan = Plan()
    plan.string(urdf)
    return bytes(plan.template)


def _encoded_commands(result: Replay) -> Iterator[tuple[int, bytes]]:
    layout = Layout(VALVE_COMMAND, "hand", result.hand.joints)
    commands = result.commands
    for sent_ns, pressure, lifetime_s in zip(
        commands.sent_ns.tolist(), commands.pressure_pa, commands.lifetime_s, strict=True
    ):
        yield sent_ns, layout.encode(sent_ns, lifetime_ns=round(lifetime_s * 1e9), pressure=pressure)


def _commands(recording: Recording, hand: Hand) -> Commands:
    """Set-points in the order of their sending; those with a NaN or infinite value are left out, as a board does."""
    data = recording["valve_command"]
    pressure = _by_name(recording, "valve_command", "pressure", hand)
    sent_ns = published_on_stamp_clock(recording.topics)
    usable = np.isfinite(pressure).all(axis=1) & (data["lifetime_ns"] > 0)
    order = np.argsort(sent_ns[usable], kind="stable")
    return Commands(sent_ns[usable][order], pressure[usable][order], data["lifetime_ns"][usable][order] * 1e-9)


def _by_name(recording: Recording, topic: str, field: str, hand: Hand) -> Array:
    """A field (N, joints) in the hand's order. RecordingError names a joint that is missing."""
    data = recording[topic]
    missing = [joint for joint in hand.joints if joint not in data.names]
    if missing:
        raise RecordingError(
            f"{recording.path}: {topic} has no joint {missing[0]!r}; it has {', '.join(data.names)}: "
            "is this the model of another hand?"
        )
    values: Array = data[field][:, [data.names.index(joint) for joint in hand.joints]]
    return values
