"""The board sample of the firmware: each rule of docs/protocol.md, and every byte compared with a model in Python."""

from __future__ import annotations

import random
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cobs import cobs
from hypothesis import given, settings
from hypothesis import strategies as st

from hand_control import board_config as board_config_module
from hand_control.board_config import BoardConfig, Sensor, board_config
from hand_control.safety_numbers import NUMBERS
from hand_control.safety_rules import Fault, State
from hand_driver import measurement
from hand_driver.board import Frame, Status
from hand_driver.host_protocol import HostProtocol
from hand_driver.measurement import Converter
from hand_driver.pressure_ramp import PressureRamp
from hand_driver.set_point_watch import SetPointWatch
from hand_driver.wire import (
    AnswerPayload,
    OfferPayload,
    PacketDecoder,
    SamplePayload,
    SetPointPayload,
    encode_offer,
    encode_sample,
    encode_set_points,
)
from hand_model.description import load_hand
from validation.c_board import CHANNELS, BoardTrace
from validation.faults.closed_loop import VirtualHand

ROOT = Path(__file__).parents[2]
HAND = load_hand(ROOT / "config" / "hand.yaml")
CONFIG = board_config(HAND)
PERIOD_US = 5_000
START_US = 2**32 - 30_000
N = {name: int(number.value) for name, number in NUMBERS.items()}
SESSION = 710_873_539
VALVES = len(HAND.joints)


def counts(pressure_pa: float = 0.0, angle_rad: float = 0.5) -> list[int]:
    """Counts of a hand at rest at one pressure and angle."""
    sensors = HAND.sensors
    values = np.full(HAND.channel_count, 1000, dtype=np.int64)
    angle = sensors.angle_line.ratio(np.full(VALVES, angle_rad)) * 5.0
    pressure = sensors.pressure.ratio(np.full(VALVES, pressure_pa)) * 5.0
    values[sensors.angle_channel] = sensors.adc.counts(angle)
    values[sensors.pressure_channel] = sensors.adc.counts(pressure)
    return [int(value) for value in values]


REST = counts()


def packet(payload: bytes) -> bytes:
    """A payload with CRC, code and delimiter."""
    return bytes(cobs.encode(payload + struct.pack("<I", zlib.crc32(payload)))) + b"\x00"


class Rig:
    """A board and a host that counts its packets. The trace is replayed in C at the end."""

    def __init__(self, config: BoardConfig = CONFIG) -> None:
        self.trace = BoardTrace(config)
        self.model = self.trace.model
        self.now_us, self.sequence = START_US, -1
        self.session: int | None = None

    def offer(self, lowest: int = 1, highest: int = 2, session: int = SESSION) -> AnswerPayload:
        answer = self.trace.receive(self.now_us, encode_offer(OfferPayload(lowest, highest, session)))
        (payload,) = PacketDecoder().feed(answer)
        assert isinstance(payload, AnswerPayload)
        return payload

    def set_points(self, pressure_pa: float = 0.0, lifetime_s: float = 0.1) -> bytes:
        self.sequence += 1
        pressures = np.full(VALVES, pressure_pa)
        return encode_set_points(SetPointPayload(self.sequence, lifetime_s, pressures, self.session))

    def send(self, pressure_pa: float = 0.0, lifetime_s: float = 0.1) -> bytes:
        data = self.set_points(pressure_pa, lifetime_s)
        self.trace.receive(self.now_us, data)
        return data

    def tick(self, values: list[int] = REST, *, repeated: bool = False, **more: int) -> tuple[SamplePayload, list[int]]:
        self.now_us += PERIOD_US
        frame, valves = self.trace.sample(self.now_us, values, repeated=repeated, **more)
        (payload,) = PacketDecoder().feed(frame)
        assert isinstance(payload, SamplePayload)
        return payload, valves

    def driving(self, pressure_pa: float) -> None:
        """Arm by zero set-points, and follow a pressure after the ramp."""
        self.tick()
        self.send(0.0)
        for _ in range(N["ramp_us"] // PERIOD_US + 2):
            self.send(pressure_pa)
            self.tick()
        assert self.model.safety.state == State.DRIVING


@pytest.fixture
def rig() -> Iterator[Rig]:
    made = Rig()
    yield made
    assert made.trace.replay() > 1


@pytest.fixture
def session(rig: Rig) -> Rig:
    """A board in a session of version 2."""
    assert rig.offer().version == 2
    rig.session = SESSION
    return rig


def test_conversions_are_those_of_the_driver() -> None:
    """Fails when the board measures another pressure or angle than the driver from the same counts."""
    assert (board_config_module.RAIL_MARGIN, board_config_module.SUPPLY_SHARES) == (
        measurement.RAIL_MARGIN,
        measurement.SUPPLY_SHARES,
    )
    converter = Converter(HAND, 0.0)
    for pressure_pa, angle_rad, supply_mv in (
        (0.0, 0.0, 5000),
        (3e5, 1.5, 5100),
        (6.2e5, -0.1, 4100),
        (-4e3, 0.7, 5900),
    ):
        trace = BoardTrace(CONFIG)
        values = counts(pressure_pa, angle_rad)
        trace.sample(PERIOD_US, values, supply_mv=supply_mv)
        frame = Frame(0, 0, supply_mv * 1e-3, Status(0), np.array(values, np.uint16), 0)
        measured = converter.convert(frame)
        layer = trace.model.safety
        assert np.asarray(layer._pressure_pa) == pytest.approx(measured.pressure, abs=3.0)
        assert np.asarray(layer._angle_urad) == pytest.approx(measured.position * 1e6, abs=10.0)
        trace.replay()


def test_the_worked_examples_of_the_page(rig: Rig) -> None:
    """Fails when the board differs from the examples of docs/protocol.md: an offer and its answer."""
    answer = rig.trace.receive(5, bytes.fromhex("0d01030102c3115f2a4d4578b600"))
    assert answer == bytes.fromhex("0d01040202c3115f2a6d094bf500")


def test_the_watch_of_the_driver_accepts_the_board(session: Rig) -> None:
    """Fails when the driver's watch takes the limits or the ramp of the board for a fault, or no longer finds one."""
    watch, ramp = SetPointWatch(HAND.joints), PressureRamp(VALVES)
    highest, lines = 0.0, []
    for tick in range(1_000):
        sample, _ = session.tick(counts(0.0, 0.0))
        now_ns = session.now_us * 1000
        echo, status = sample.echo, sample.status
        frame = Frame(sample.sequence, session.now_us, 5.0, status, sample.counts, now_ns, echo)
        assert echo is not None
        highest = max(highest, float(echo.pressure_pa.max()))
        ramp.frame(Status.VENTED in status, np.zeros(VALVES), now_ns)
        wanted = np.full(VALVES, 0.0 if tick < 120 else 3e5)  # after the ramp of the board
        if tick > 800:
            wanted[4] = 6e5  # at this angle more than the torque limit and its margin allow
        allowed = ramp.limit(wanted, now_ns)
        lines.append(watch.frame(frame, now_ns))
        session.sequence += 1
        packet_of = SetPointPayload(session.sequence, 0.1, allowed, session.session)
        session.trace.receive(session.now_us, encode_set_points(packet_of))
        watch.sent(session.sequence, allowed, 0.1, now_ns)
    assert highest > 3e5 and [(k, line) for k, line in enumerate(lines[:800]) if line] == []
    assert HAND.joints[4] in lines[-1], "a set-point that the board reduced is named by the driver"


def test_the_watch_of_the_driver_accepts_set_points_that_change(session: Rig) -> None:
    """Fails when the echo has the sequence of set-points that no valve follows yet: motion would latch the driver."""
    session.driving(0.0)
    watch, sent = SetPointWatch(HAND.joints), {session.sequence: 0.0}
    for tick in range(300):
        sample, _ = session.tick(counts(0.0, 0.0))
        assert sample.echo is not None
        assert list(sample.echo.pressure_pa) == [sent[sample.echo.sequence]] * VALVES
        frame = Frame(sample.sequence, session.now_us, 5.0, sample.status, sample.counts, 0, sample.echo)
        assert watch.frame(frame, session.now_us * 1000) == ""
        pressure = 1e3 * (tick if tick < 150 else 300 - tick)
        session.send(pressure)
        sent[session.sequence] = pressure
        watch.sent(session.sequence, np.full(VALVES, pressure), 0.1, session.now_us * 1000)


def test_a_full_step_is_bounded_and_no_fault_for_the_driver(session: Rig) -> None:
    """Fails when the layer passes the full range in one tick, or bounds it so that the driver latches a fault."""
    session.driving(0.0)
    watch = SetPointWatch(HAND.joints)
    flexed = counts(0.0, 1.2)
    levels: list[int] = []
    for _ in range(40):
        wanted = np.full(VALVES, 6e5 if len(levels) % 20 > 9 else 0.0)
        session.send(wanted[0])
        watch.sent(session.sequence, wanted, 0.1, session.now_us * 1000)
        sample, valves = session.tick(flexed)
        frame = Frame(sample.sequence, session.now_us, 5.0, sample.status, sample.counts, 0, sample.echo)
        assert watch.frame(frame, session.now_us * 1000) == ""
        levels.append(valves[0])
    assert max(levels) == 600_000
    assert max(np.diff(levels)) == N["rate_pa_per_s"] * PERIOD_US // 1_000_000 <= 250_000


def test_normal_steps_stay_within_the_rate() -> None:
    """Fails when the layer would reduce set-points of fast steps of the controller."""
    hand, rises = VirtualHand(3), [0.0]
    hand.run(1.0)
    for degrees in (0.0, 90.0, 30.0, 80.0, -10.0, 100.0):
        hand.move(degrees)
        for _ in range(120):
            before = hand.set_points_pa
            hand.step()
            rises.append(float(np.max(hand.set_points_pa - before)))
    assert hand.controller.safety.fault == ""
    assert 1e5 < max(rises) < 0.8 * N["rate_pa_per_s"] * PERIOD_US * 1e-6


def test_only_zero_set_points_arm_it(rig: Rig) -> None:
    """Fails when a pressure reaches a valve before a request, or zero set-points do not arm."""
    rig.tick()
    for _ in range(3):
        rig.send(2e5)
        frame, valves = rig.tick()
        assert valves == [0] * VALVES and Status.VENTED in frame.status
    rig.send(0.0)
    assert Status.VENTED in rig.tick()[0].status or rig.model.safety.state == State.RAMPING
    rig.send(2e5)
    frame, valves = rig.tick()
    rise = N["ramp_pa_per_s"] * PERIOD_US // 1_000_000
    assert max(valves) <= 2 * rise and min(valves) >= rise and Status.VENTED not in frame.status


@pytest.mark.parametrize("valve", [0, VALVES - 1])
def test_one_pressure_that_is_not_zero_is_no_request(rig: Rig, valve: int) -> None:
    """Fails when set-points with a pressure for one valve alone count as a request."""
    rig.tick()
    pressures = np.zeros(VALVES)
    pressures[valve] = 10.0
    rig.trace.receive(rig.now_us, encode_set_points(SetPointPayload(0, 0.1, pressures)))
    assert rig.model.safety.state == State.VENTED


def test_silence_vents_and_is_shown(rig: Rig) -> None:
    """Fails when set-points outlive their lifetime, or pressure returns without a request."""
    rig.driving(3e5)
    for _ in range(18):
        rig.trace.receive(rig.now_us)
        frame, valves = rig.tick()
        assert valves == [300_000] * VALVES and Status.VENTED not in frame.status
    rig.trace.receive(rig.now_us)
    assert rig.tick()[1] == [0] * VALVES
    assert rig.model.safety.fault == Fault.COMMAND_LOST
    rig.send(3e5)
    frame, valves = rig.tick()
    assert valves == [0] * VALVES and Status.VENTED in frame.status
    rig.send(0.0)
    rig.tick()
    rig.send(3e5)
    assert 0 < max(rig.tick()[1]) < 20_000


def test_a_main_loop_that_hangs_vents(rig: Rig) -> None:
    """Fails when samples go on and set-points stay in force although nothing reads the line any more."""
    rig.driving(1e5)
    rig.send(1e5, lifetime_s=1.0)
    for _ in range(N["heartbeat_us"] // PERIOD_US):
        assert rig.tick()[1] == [100_000] * VALVES
    assert rig.tick()[1] == [0] * VALVES
    assert rig.model.safety.fault == Fault.HEARTBEAT_LOST


def test_an_acquisition_that_stops_vents(rig: Rig) -> None:
    """Fails when the valves keep their set-points although only the main loop, which the host feeds, still runs."""
    rig.driving(1e5)
    sampled_us = rig.now_us
    for late_us in (-1, 0, 1, N["warn_us"]):
        assert rig.trace.watch(sampled_us + late_us) is None, "samples arrive"
    for late_us in range(N["warn_us"] + 1, N["vent_us"] + 1, PERIOD_US):
        rig.now_us = sampled_us + late_us
        rig.send(1e5)
        assert rig.trace.watch(rig.now_us) == [100_000] * VALVES
    rig.now_us = sampled_us + N["vent_us"] + 1
    rig.send(1e5)
    assert rig.trace.watch(rig.now_us) == [0] * VALVES
    assert rig.model.safety.fault == Fault.SENSORS_LOST
    rig.send(0.0)
    frame, valves = rig.tick()
    assert valves == [0] * VALVES and Status.VENTED in frame.status, "samples that return do not arm it"


def test_set_points_end_although_the_acquisition_stopped(rig: Rig) -> None:
    """Fails when the lifetime of set-points is checked by samples alone."""
    rig.driving(1e5)
    rig.send(1e5, lifetime_s=0.05)
    rig.trace.receive(rig.now_us + 49_999)
    assert rig.trace.watch(rig.now_us + 49_999) == [100_000] * VALVES
    assert rig.trace.watch(rig.now_us + 50_000) == [0] * VALVES
    assert rig.model.safety.fault == Fault.COMMAND_LOST


def test_a_board_without_any_sample_is_vented(rig: Rig) -> None:
    """Fails when a board whose converter never starts drives, or the watch takes its start for a stop of samples."""
    rig.send(0.0)
    assert rig.trace.watch(rig.now_us) == [0] * VALVES
    assert rig.model.safety.state == State.VENTED
    assert rig.trace.watch(0) is None


def test_a_converter_that_repeats_a_sample_vents(rig: Rig) -> None:
    """Fails when one sample that the converter hands over for ever counts as new ones, or a single repetition vents."""
    rig.driving(1e5)
    sequence = -1
    for k in range(2 * N["vent_us"] // PERIOD_US):
        rig.send(1e5)
        frame, valves = rig.tick(repeated=k % 2 == 0)
        assert valves == [100_000] * VALVES and frame.sequence > sequence
        sequence = frame.sequence
    for _ in range(N["vent_us"] // PERIOD_US):
        rig.send(1e5)
        assert rig.tick(repeated=True)[1] == [100_000] * VALVES
    rig.send(1e5)
    assert rig.tick(repeated=True)[1] == [0] * VALVES
    assert rig.model.safety.fault == Fault.SENSORS_LOST


@pytest.mark.parametrize("version", [1, 2])
def test_a_replayed_packet_changes_nothing(rig: Rig, version: int) -> None:
    """Fails when a repeated or older packet reaches a valve, or lengthens the lifetime."""
    if version == 2:
        rig.offer()
        rig.session = SESSION
    rig.driving(1e5)
    old, last = rig.send(4e5), rig.send(1e5)
    before = rig.model.accepted
    for _ in range(19):
        rig.trace.receive(rig.now_us, old + last)
        assert rig.tick()[1] == [100_000] * VALVES
    assert rig.model.accepted == before
    rig.trace.receive(rig.now_us, last)
    assert rig.tick()[1] == [0] * VALVES


def test_the_echo_is_what_acts_on_the_valves(session: Rig) -> None:
    """Fails when the echo is a copy of the packet, or its number, count or age is another."""
    frame, _ = session.tick()
    assert frame.version == 2 and frame.echo is not None and np.isnan(frame.echo.age_s)
    session.send(0.0)
    session.tick()
    session.send(3e5)
    _, valves = session.tick()
    frame, _ = session.tick()
    assert frame.echo is not None
    assert frame.echo.sequence == session.sequence and frame.echo.accepted == 2
    assert frame.echo.age_s == pytest.approx(2 * PERIOD_US * 1e-6)
    assert list(frame.echo.pressure_pa) == [10 * ((value + 5) // 10) for value in valves]
    assert 0 < valves[0] < 300_000, "the ramp acts, and the echo shows it"


@pytest.mark.parametrize(
    ("after_us", "code_ms"),
    [(499, 0), (500, 1), (1_499, 1), (65_533_499, 65_533), (65_534_000, 65_534), (10**9, 65_534), (2**33, 65_534)],
)
def test_the_age_of_the_echo_is_limited(session: Rig, after_us: int, code_ms: int) -> None:
    """Fails when an age is rounded otherwise or wraps."""
    session.send(0.0)
    session.trace.sample(session.now_us, REST)
    session.now_us += after_us - PERIOD_US
    frame, _ = session.tick()
    assert frame.echo is not None and round(frame.echo.age_s * 1e3) == code_ms


def test_the_count_of_packets_wraps(session: Rig) -> None:
    """Fails when the number of accepted packets is not modulo 256."""
    for _ in range(257):
        session.send(0.0)
    session.tick()
    frame, _ = session.tick()
    assert frame.echo is not None and frame.echo.accepted == 1


@pytest.mark.parametrize(
    ("lowest", "highest", "version"), [(1, 2, 2), (1, 1, 1), (2, 2, 2), (2, 255, 2), (3, 3, 0), (3, 9, 0)]
)
def test_an_offer_is_answered_with_the_highest_common_version(
    rig: Rig, lowest: int, highest: int, version: int
) -> None:
    """Fails when a host gets a version that it does not have, or another session."""
    answer = rig.offer(lowest, highest, 77)
    assert (answer.version, answer.highest, answer.session) == (version, 2, 77)
    assert rig.tick()[0].version == max(version, 1)
    if version == 0:
        rig.driving(1e5)


@pytest.mark.parametrize(
    "payload",
    [
        struct.pack("<BBBBI", 1, 3, 0, 2, 9),
        struct.pack("<BBBBI", 1, 3, 2, 1, 9),
        struct.pack("<BBBBIB", 1, 3, 1, 2, 9, 0),
        struct.pack("<BBBBI", 2, 3, 1, 2, 9),
    ],
)
def test_an_offer_that_cannot_be_read_is_not_answered(rig: Rig, payload: bytes) -> None:
    """Fails when an offer of another length or version byte, or with exchanged versions, begins a session."""
    assert rig.trace.receive(5, packet(payload)) == b""
    assert rig.model.decoder.corrupt == 1 and rig.model.version == 1


def test_a_session_excludes_other_senders(session: Rig) -> None:
    """Fails when set-points of another session, or of version 1 after the first of the session, are accepted."""
    session.session = None
    session.send(0.0)
    assert session.model.accepted == 1, "version 1 is accepted until the session is used"
    session.session, session.sequence = SESSION, -1
    session.send(0.0)
    assert session.model.accepted == 2, "the numbers of a session begin anywhere"
    for other in (None, SESSION + 1):
        session.session, session.sequence = other, 100
        session.send(0.0)
        assert session.model.accepted == 2
    assert session.offer().version == 2
    assert session.model.session_used, "a repeated offer changes nothing"
    session.offer(session=5)
    assert session.model.accepted == 0 and session.tick()[0].echo is not None
    session.session, session.sequence = None, 500
    session.send(0.0)
    assert session.model.accepted == 1, "until the new session is used"


def test_set_points_of_version_2_need_a_session(rig: Rig) -> None:
    """Fails when set-points of version 2 are accepted before an offer, or by a session of version 1."""
    rig.session = 0
    rig.send(0.0)
    assert rig.model.accepted == 0
    rig.offer(1, 1, 0)
    rig.send(0.0)
    assert rig.model.accepted == 0


def test_a_new_session_keeps_the_set_points_in_force(session: Rig) -> None:
    """Fails when a host that connects again vents the hand before the lifetime ends."""
    session.driving(1e5)
    session.offer(session=4)
    assert session.tick()[1] == [100_000] * VALVES
    session.session, session.sequence = 4, 40
    session.send(2e5)
    assert session.tick()[1] == [200_000] * VALVES


def test_another_host_of_version_1_begins_while_vented(rig: Rig) -> None:
    """Fails when a host of version 1 that starts again at number 0 is refused for ever, or accepted while driven."""
    rig.driving(1e5)
    rig.sequence = -1
    rig.send(2e5)
    assert rig.tick()[1] == [100_000] * VALVES
    for _ in range(25):
        rig.trace.receive(rig.now_us)
        rig.tick()
    assert rig.model.safety.state == State.VENTED
    rig.send(0.0)
    assert rig.model.safety.state == State.RAMPING


@pytest.mark.parametrize(
    "payload",
    [
        b"\x01",
        b"\x01\x02",
        struct.pack("<BBIHB", 1, 2, 5, 100, 3),
        struct.pack("<BBIHB22x", 1, 2, 5, 0, 11),
        struct.pack("<BBIHB23x", 1, 2, 5, 100, 11),
        struct.pack("<BBI", 1, 7, 0),
        struct.pack("<BBIHIB21x", 2, 2, 5, 9, 3, 11),
    ],
)
def test_a_packet_with_another_content_is_counted(rig: Rig, payload: bytes) -> None:
    """Fails when a packet of a wrong length, type or lifetime is taken, or not counted."""
    rig.tick()
    assert rig.trace.receive(rig.now_us, packet(payload)) == b""
    assert rig.model.decoder.corrupt == 1 and rig.model.accepted == 0


@pytest.mark.parametrize("version", [0, 3, 255])
def test_a_packet_of_a_later_version_is_not_interpreted(rig: Rig, version: int) -> None:
    """Fails when a version that the board does not know is taken for one that it does, or counted as noise."""
    rig.trace.receive(5, packet(struct.pack("<BBIHB22x", version, 2, 5, 100, 11)))
    assert rig.model.decoder.corrupt == 0 and rig.model.accepted == 0


@pytest.mark.parametrize(("size", "corrupt"), [(2, 0), (1270, 0), (1271, 1)])
def test_the_shortest_and_the_longest_packet(rig: Rig, size: int, corrupt: int) -> None:
    """Fails when a packet of 1280 bytes or of two is refused, or a longer one is kept."""
    rig.trace.receive(5, packet(bytes([9]) * size))
    assert rig.model.decoder.corrupt == corrupt


@pytest.mark.parametrize("valves", [0, 10, 12, 255])
def test_set_points_of_another_hand_are_ignored(rig: Rig, valves: int) -> None:
    """Fails when a packet with another number of valves is taken, or writes beyond the arrays."""
    rig.tick()
    rig.trace.receive(rig.now_us, encode_set_points(SetPointPayload(0, 0.1, np.zeros(valves))))
    assert rig.model.accepted == 0 and rig.model.decoder.corrupt == 0


def test_noise_is_counted_and_skipped(rig: Rig) -> None:
    """Fails when the board loses its place in the stream: bad codes, bad CRC, too long packets, empty packets."""
    rig.tick()
    good = rig.set_points()
    damaged = bytearray(rig.set_points())
    damaged[10] ^= 4
    for data in (b"\x00\x00", b"\x05\x01\x00", b"\x01\x01\x00", bytes(damaged), good):
        rig.trace.receive(rig.now_us, data)
    assert rig.model.decoder.corrupt == 3 and rig.model.accepted == 1
    rig.trace.receive(rig.now_us, b"\x07" * 1281 + b"\x00")
    rig.trace.receive(rig.now_us, b"\x07" * 4000)
    rig.trace.receive(rig.now_us, b"\x07" * 10 + b"\x00" + rig.set_points())
    assert rig.model.decoder.corrupt == 5 and rig.model.accepted == 2
    rig.trace.receive(rig.now_us, b"\x01" * 1279 + b"\xff\x00" + rig.set_points())
    assert rig.model.decoder.corrupt == 6 and rig.model.accepted == 3


@pytest.mark.parametrize("cut", [1, 20, 33])
def test_a_packet_may_arrive_in_pieces(rig: Rig, cut: int) -> None:
    """Fails when a packet that arrives in two calls is lost."""
    rig.tick()
    data = rig.set_points()
    rig.trace.receive(rig.now_us, data[:cut])
    rig.trace.receive(rig.now_us, data[cut:])
    assert rig.model.accepted == 1


def test_over_pressure_vents_and_is_shown(rig: Rig) -> None:
    """Fails when an actuator above its limit is not vented, or the host does not learn why."""
    rig.driving(1e5)
    frame = None
    for _ in range(20):
        rig.send(1e5)
        frame, _ = rig.tick(counts(6.7e5))
        if Status.OVER_PRESSURE in frame.status:
            break
    assert frame is not None and Status.OVER_PRESSURE | Status.VENTED in frame.status
    assert rig.model.safety.fault == Fault.OVER_PRESSURE
    assert rig.tick()[1] == [0] * VALVES


def over_pressure(rig: Rig) -> None:
    """Latch an over-pressure in a board that drives."""
    rig.driving(1e5)
    while rig.model.safety.fault == Fault.NONE:
        rig.send(1e5)
        rig.tick(counts(6.7e5))
    assert rig.model.safety.fault == Fault.OVER_PRESSURE


def hang(rig: Rig) -> None:
    """Latch a main loop that hangs in a board that drives."""
    rig.driving(1e5)
    rig.send(1e5, lifetime_s=1.0)
    while rig.model.safety.fault == Fault.NONE:
        rig.tick()
    assert rig.model.safety.fault == Fault.HEARTBEAT_LOST


def lose_sensors(rig: Rig) -> None:
    """Latch the loss of the sensors in a board that drives."""
    rig.driving(1e5)
    while rig.model.safety.fault == Fault.NONE:
        rig.send(1e5)
        rig.tick(status=int(Status.ADC_FAULT))
    assert rig.model.safety.fault == Fault.SENSORS_LOST


@pytest.mark.parametrize("latch", [over_pressure, hang, lose_sensors])
def test_a_latched_fault_needs_a_new_session(session: Rig, latch: Callable[[Rig], None]) -> None:
    """Fails when zero set-points, which a driver sends while it vents, clear a fault, or a new session does not."""
    latch(session)
    fault = session.model.safety.fault
    for pressure in (0.0, 0.0, 1e5, 0.0):
        session.send(pressure)
        frame, valves = session.tick()
        assert valves == [0] * VALVES and Status.VENTED in frame.status
        assert (Status.OVER_PRESSURE in frame.status) == (fault == Fault.OVER_PRESSURE)
    assert session.offer().version == 2  # the same session again, as after a cable was plugged in
    session.send(0.0)
    assert (session.model.safety.state, session.model.safety.fault) == (State.VENTED, fault)
    session.session = SESSION + 1
    assert session.offer(session=SESSION + 1).version == 2
    assert (session.model.safety.state, session.model.safety.fault) == (State.VENTED, Fault.NONE)
    session.send(1e5)
    frame, valves = session.tick()
    assert valves == [0] * VALVES and Status.VENTED in frame.status, "cleared, but not armed"
    session.send(0.0)
    assert session.model.safety.state == State.RAMPING
    session.send(1e5)
    assert 0 < max(session.tick()[1]) < 20_000


def test_a_new_session_arms_nothing_above_its_limit(session: Rig) -> None:
    """Fails when the request to clear a fault drives an actuator that is still above its limit."""
    over_pressure(session)
    session.session = SESSION + 1
    session.offer(session=SESSION + 1)
    session.send(0.0)
    session.tick(counts(6.7e5))
    session.send(0.0)
    assert session.model.safety.state == State.VENTED


def test_a_driver_that_restarts_clears_the_latch_and_arms_nothing(session: Rig) -> None:
    """Fails when the page on a restarted driver is wrong: its first offer clears a latch, and no pressure follows."""
    over_pressure(session)
    restarted = HostProtocol(CHANNELS, "here")
    offer = restarted.offer(0)
    assert offer is not None and offer.session != SESSION
    session.session, session.sequence = offer.session, -1
    session.offer(session=offer.session)
    assert (session.model.safety.state, session.model.safety.fault) == (State.VENTED, Fault.NONE)
    for pressure in (1e5, 0.0, 0.0, 1e5):
        session.send(pressure)
        assert session.tick(counts(6.7e5))[1] == [0] * VALVES, "no request, or a pressure above its limit"


def test_the_host_renews_its_session_on_request_only() -> None:
    """Fails when a new connection clears what the board has latched, or `renew` does not begin another session."""
    first, second = HostProtocol(CHANNELS, "here"), HostProtocol(CHANNELS, "here")
    offered = first.offer(0)
    assert offered is not None
    sent = first.set_points(np.zeros(VALVES), 0.1)
    second.continue_from(first)
    again = second.offer(0)
    assert again is not None and again.session == offered.session
    assert second.set_points(np.zeros(VALVES), 0.1).sequence == sent.sequence + 1  # older ones count as replays
    second.renew()
    renewed = second.offer(0)
    assert renewed is not None and renewed.session != offered.session


@pytest.mark.parametrize(
    ("more", "driven"),
    [
        ({"status": int(Status.ADC_FAULT)}, False),
        ({"status": int(Status.SUPPLY_LOW)}, True),
        ({"supply_mv": 3999}, False),
        ({"supply_mv": 4000}, True),
        ({"supply_mv": 6000}, True),
        ({"supply_mv": 6001}, False),
        ({"supply_mv": 0}, False),
    ],
)
def test_samples_that_are_not_believed_vent(rig: Rig, more: dict[str, Any], driven: bool) -> None:
    """Fails when the hand is driven on a failed conversion or a supply out of range, or a bound is off by one."""
    values = [min(value, 55_000) for value in REST]
    rig.driving(1e5)
    for _ in range(N["vent_us"] // PERIOD_US + 1):
        rig.send(1e5)
        frame, valves = rig.tick(values, **more)
    assert (valves == [100_000] * VALVES) == driven
    assert more.get("status", 0) & frame.status == more.get("status", 0)


@pytest.mark.parametrize(("count", "driven"), [(131, False), (132, True), (65_403, True), (65_404, False)])
@pytest.mark.parametrize("channel", [0, 10, 21, 32])
def test_a_channel_at_its_rail_is_not_believed(rig: Rig, channel: int, count: int, driven: bool) -> None:
    """Fails when a broken wire of an angle or pressure sensor drives the hand, or one of a force sensor vents it."""
    rig.driving(1e5)
    values = [*REST]
    values[channel] = count
    for _ in range(N["vent_us"] // PERIOD_US + 1):
        rig.send(1e5)
        rig.tick(values)
        if rig.model.safety.fault == Fault.OVER_PRESSURE:
            return  # the highest count of a pressure sensor is an over-pressure
    assert (rig.model.safety.state == State.DRIVING) == (driven or channel == 32)


@pytest.mark.parametrize(
    ("changed", "good"),
    [
        ({}, True),
        ({"channels": 0}, False),
        ({"channels": 22}, True),
        ({"channels": 21}, False),
        ({"channels": CHANNELS}, True),
        ({"channels": CHANNELS + 1}, False),
        ({"highest_count": 65_535}, True),
        ({"full_scale": 65_403}, False),
        ({"full_scale": 65_404}, True),
        ({"lowest_supply_mv": 0}, False),
        ({"lowest_supply_mv": 512}, True),
        ({"lowest_supply_mv": 511}, False),
        ({"joints": 0}, False),
        ({"joints": 17}, False),
        ({"angle": tuple(replace(s, channel=33) if k == 10 else s for k, s in enumerate(CONFIG.angle))}, False),
        ({"pressure": tuple(replace(s, channel=33) if k == 0 else s for k, s in enumerate(CONFIG.pressure))}, False),
        ({"limits": tuple((0, *row[1:]) if k == 10 else row for k, row in enumerate(CONFIG.limits))}, False),
        ({"angle": tuple(Sensor(s.channel, -(2**31), 2**31 - 1) for s in CONFIG.angle)}, True),
        ({"angle": tuple(Sensor(s.channel, 2**31 - 1, 2**31 - 1) for s in CONFIG.angle)}, True),
        ({"pressure": tuple(Sensor(s.channel, 0, 2_000_000) for s in CONFIG.pressure)}, True),
    ],
)
def test_a_configuration_that_cannot_be_used_stays_vented(changed: dict[str, object], good: bool) -> None:
    """Fails when a board with a sensor without a channel, or constants out of range, can be armed or reads beyond."""
    config = replace(CONFIG, **changed)  # type: ignore[arg-type]
    if config.joints == 17:
        limits, angle, pressure = ((*values, *values[:6]) for values in (config.limits, config.angle, config.pressure))
        config = replace(config, limits=limits, angle=angle, pressure=pressure)  # type: ignore[arg-type]
    if config.joints == 0:
        config = replace(config, limits=(), angle=(), pressure=())
    rig = Rig(config)
    assert rig.model.good == good
    values = [*REST, *[5_000] * 100][: config.channels]
    rig.tick(values)
    rig.send(0.0)
    rig.send(0.0)
    assert good or rig.model.safety.state == State.VENTED
    assert good or rig.tick(values)[1] == [0] * len(rig.model.safety.joints)
    rig.trace.replay()


def random_stream(seed: int, count: int) -> BoardTrace:
    """Packets of both versions, most of them intact, some repeated, damaged, cut or of another kind; and samples."""
    rng = random.Random(seed)
    rig = Rig()
    rig.now_us = rng.choice((0, START_US, 2**63))
    sent: list[bytes] = [b""]
    late = b""
    for _ in range(count):
        kind = rng.random()
        if kind < 0.03:
            data = encode_offer(OfferPayload(1, rng.choice((1, 2, 2)), rng.choice((SESSION, 3))))
            rig.session = rig.model.session if rng.random() < 0.5 else SESSION
        elif kind < 0.05:
            data = bytes(rng.randrange(256) for _ in range(rng.randrange(60)))
        elif kind < 0.1:
            data = (
                encode_sample(SamplePayload(1, 1, 5.0, Status(0), np.zeros(3, np.uint16)))[: rng.randrange(20)]
                + b"\x00"
            )
        elif kind < 0.6:
            data = rig.set_points(rng.choice((0.0, 0.0, 1e5, 6e5, 6.1e5)), rng.choice((0.02, 0.1, 1.0)))
        elif kind < 0.65:
            data = rng.choice(sent[-5:])
        else:
            data = b""
        sent.append(data)
        damaged = bytearray(data)
        if damaged and rng.random() < 0.05:
            damaged[rng.randrange(len(damaged))] ^= 1 << rng.randrange(8)
        stream = late + bytes(damaged)
        cut = len(stream) if rng.random() < 0.9 else rng.randrange(len(stream) + 1)
        rig.trace.receive(rig.now_us, stream[:cut])
        late = stream[cut:]
        if rng.random() < 0.8:
            wild = rng.random() < 0.02
            values = counts(rng.uniform(0.0, 6e5), rng.uniform(-0.3, 1.8))
            if wild:
                values[rng.randrange(33)] = rng.choice((0, 65_535))
            rig.now_us += rng.choice((0, 60_000, 120_000)) if rng.random() < 0.02 else 0
            status, repeated = rng.choice((0, 0, 0, 2, 8)) if wild else 0, rng.random() < 0.05
            rig.trace.sample(rig.now_us + PERIOD_US, values, status, repeated=repeated)
            rig.now_us += PERIOD_US
        elif rng.random() < 0.3:
            rig.now_us += rng.choice((0, 5_000, 60_000, 120_000))
            rig.trace.watch(rig.now_us)
    return rig.trace


@settings(max_examples=25, print_blob=True, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_board_and_model_agree_on_random_streams(seed: int) -> None:
    """Fails when the C board sends another byte, or sets another valve, than the model with the driver's own codec."""
    print(f"seed {seed}")
    random_stream(seed, 120).replay()


def test_random_streams_drive_the_valves() -> None:
    """Fails when the random streams no longer arm the board: then they would compare little."""
    driven = sum(
        " [0, " not in line and line.startswith("sample") for k in range(10) for line in random_stream(k, 120).lines
    )
    assert driven > 50


def test_the_driver_decodes_what_the_board_encodes_and_back() -> None:
    """Fails when payloads of any content and length, long blocks without a zero included, are packed otherwise."""
    config = replace(CONFIG, channels=CHANNELS)
    for value in (0, 1, 0x0100, 0xFFFF, 0x0101):
        trace = BoardTrace(config)
        trace.receive(0, encode_offer(OfferPayload(1, 2, 0x01010101)))
        trace.sample(0x0101010101010101, [value or 0] * CHANNELS, supply_mv=0x0101)
        trace.sample(2**64 - 1, [value] * CHANNELS)
        trace.replay()


@pytest.mark.parametrize("size", [2, 248, 249, 250, 251, 252, 253, 254, 255, 503, 504, 505, 508, 509, 1269])
def test_long_blocks_are_packed_as_the_driver_packs_them(rig: Rig, size: int) -> None:
    """Fails when blocks of 254 bytes without a zero are packed or unpacked otherwise, at any place of a packet."""
    for fill in (0, 1, 255):
        rig.trace.packet(bytes([1, 9]) + bytes([fill]) * (size - 2))
        rig.trace.receive(rig.now_us, packet(bytes([1, 9]) + bytes([fill]) * (size - 2)))
    corrupt = rig.model.decoder.corrupt
    assert corrupt == 3, "an unknown type is counted"
    rig.trace.receive(rig.now_us, rig.set_points())
    assert rig.model.accepted == 1
