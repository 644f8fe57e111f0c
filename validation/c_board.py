"""The board sample in C against a model of it in Python: the driver's own codec, sessions and the safety rules.

A `BoardTrace` calls the model and records every call with its result; `replay` runs the same calls through the C
board, which compares every byte that is sent, and every state and set-point.
"""

from __future__ import annotations

import ctypes
import math
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

import numpy as np
from cobs import cobs

from hand_control.board_config import BoardConfig, Sensor
from hand_control.safety_numbers import NUMBERS
from hand_control.safety_rules import Answer, Fault, SafetyLayer, State, limits_of
from hand_driver.board import Echo, ProtocolMismatch, Status
from hand_driver.wire import (
    AnswerPayload,
    OfferPayload,
    PacketDecoder,
    Payload,
    SamplePayload,
    SetPointPayload,
    encode_answer,
    encode_sample,
)
from validation.c_safety import FIRMWARE, HOST, build, keep

BOARD = FIRMWARE / "board"
SOURCES = (BOARD / "hand_board.c", BOARD / "hand_wire.c")
REPLAY = (*SOURCES, FIRMWARE / "hand_safety.c", HOST / "board_replay.c")
CHANNELS = 64
VERSIONS = (1, 2)
FIRST_NUMBER = 2**32 - 40
"""Count of the converter before the first sample; it wraps soon."""
WARN_US = int(NUMBERS["warn_us"].value)


class Accepted(NamedTuple):
    """Accepted set-points, as the echo reports them; see hand_board_accepted in C. at_us: None before the first."""

    at_us: int | None = None
    sequence: int = 0
    packets: int = 0


NOTHING = Accepted()


class Reading(NamedTuple):
    """What the converter has measured; see hand_board_reading in C."""

    number: int
    status: int
    supply_mv: int
    counts: Sequence[int]


@cache
def _library() -> ctypes.CDLL:
    library = ctypes.CDLL(str(build("board.so", REPLAY, "-O2", "-shared", "-fPIC")))
    library.board_replay.restype = library.board_replay_compared.restype = ctypes.c_size_t
    library.board_replay.argtypes = (ctypes.c_void_p, ctypes.c_size_t)
    return library


def consistent(config: BoardConfig) -> bool:
    """Whether every sensor has its channel and every conversion its range."""
    wired = all(sensor.channel < config.channels for sensor in (*config.angle, *config.pressure))
    return (
        0 < config.channels <= CHANNELS
        and config.highest_count <= config.full_scale
        and config.lowest_supply_mv > 0
        and config.reference_mv <= 10 * config.lowest_supply_mv
        and wired
    )


@dataclass
class BoardModel:
    """The rules of docs/protocol.md and of the safety layer, for one board."""

    config: BoardConfig
    version: int = 1
    session: int | None = None
    session_used: bool = False
    newest: Accepted = NOTHING
    in_force: Accepted = NOTHING
    loops: int = 0
    frames: int = 0
    sampled_us: int = 0
    decoder: PacketDecoder = field(default_factory=PacketDecoder)

    def __post_init__(self) -> None:
        """Begin vented."""
        good = consistent(self.config)
        rows = np.array(self.config.limits, dtype=np.int32).reshape(-1, 9)
        self.safety = SafetyLayer(limits_of(rows) if good else ())
        self.good = self.safety.good
        self.channels = self.config.channels if good else 0

    def receive(self, now_us: int, data: bytes) -> bytes:
        """The answer to bytes of the host."""
        self.loops += 1
        self.safety.heartbeat(now_us, self.loops)
        answer = b""
        for byte in data:  # one by one: a packet of another version ends a longer call of the decoder
            for payload in self._decoded(bytes([byte])):
                answer = self._take(now_us, payload) or answer
        return answer

    def _decoded(self, data: bytes) -> list[Payload]:
        try:
            return self.decoder.feed(data)
        except ProtocolMismatch:
            return []

    def _take(self, now_us: int, payload: Payload) -> bytes:
        if isinstance(payload, OfferPayload):
            return self._offer(payload)
        if isinstance(payload, SetPointPayload) and len(payload.pressure_pa) == len(self.safety.joints):
            self._set_points(now_us, payload)
        return b""

    def _offer(self, offer: OfferPayload) -> bytes:
        version = min(offer.highest, VERSIONS[-1])
        if version < offer.lowest:
            return encode_answer(AnswerPayload(0, VERSIONS[-1], offer.session))
        if offer.session != self.session:
            self.version, self.session, self.session_used = version, offer.session, False
            self.newest = self.in_force = NOTHING
            self.safety.reset()
        return encode_answer(AnswerPayload(self.version, VERSIONS[-1], offer.session))

    def _set_points(self, now_us: int, payload: SetPointPayload) -> None:
        safety = self.safety
        if payload.session is None:
            if self.session_used:
                return
            if safety.state == State.VENTED:
                safety.new_session()
        else:
            if self.version < 2 or payload.session != self.session:
                return
            if not self.session_used:
                safety.new_session()
        pressure_pa = [round(p) for p in payload.pressure_pa]
        if safety.command(now_us, payload.sequence, round(payload.lifetime_s * 1e6), pressure_pa) is Answer.ACCEPTED:
            self.session_used = payload.session is not None
            self.newest = Accepted(now_us, payload.sequence, (self.accepted + 1) % 256)
            if safety.state == State.VENTED and not any(pressure_pa):
                if safety.fault == Fault.COMMAND_LOST:
                    safety.reset()
                safety.arm(now_us)

    def sample(self, now_us: int, reading: Reading) -> tuple[bytes, list[int]]:
        """The frame of one sample, and the set-points of the next period [Pa]."""
        config = self.config
        number, status, supply_mv, counts = reading
        if config.lowest_supply_mv <= supply_mv <= config.highest_supply_mv and not status & Status.ADC_FAULT:
            self._measure(now_us, number, supply_mv, counts)
        status |= Status.VENTED if self.safety.state == State.VENTED else 0
        status |= Status.OVER_PRESSURE if self.safety.fault == Fault.OVER_PRESSURE else 0
        echo = None
        if self.version > 1:
            at_us, sequence, accepted = self.in_force
            age_s = math.nan if at_us is None else (now_us - at_us + 500) // 1000 * 1e-3
            followed = np.floor(np.array(self.safety.output_pa, float) / 10.0 + 0.5) * 10.0
            echo = Echo(sequence, age_s, followed, accepted)
        sent = np.array(counts[: self.channels], np.uint16)
        payload = SamplePayload(self.frames % 2**32, now_us, supply_mv * 1e-3, Status(status), sent, self.version, echo)
        self.frames += 1
        self.sampled_us = now_us
        return encode_sample(payload), self._take_over(now_us)

    def watch(self, now_us: int) -> list[int] | None:
        """The set-points [Pa] where samples have stopped, None while they arrive."""
        return self._take_over(now_us) if now_us - self.sampled_us > WARN_US else None

    def _take_over(self, now_us: int) -> list[int]:
        self.in_force = self.newest
        return self.safety.tick(now_us)

    @property
    def accepted(self) -> int:
        """Packets of set-points in the session, modulo 256."""
        return self.newest.packets

    def _measure(self, now_us: int, number: int, supply_mv: int, counts: Sequence[int]) -> None:
        config, count = self.config, len(self.safety.joints)
        used = [counts[sensor.channel] for sensor in (*config.angle[:count], *config.pressure[:count])]
        valid = all(config.lowest_count < c < config.highest_count for c in used)
        angle = [self._value(sensor, supply_mv, counts) for sensor in config.angle[:count]]
        pressure = [self._value(sensor, supply_mv, counts) for sensor in config.pressure[:count]]
        self.safety.sample(now_us, number, valid, pressure, angle)

    def _value(self, sensor: Sensor, supply_mv: int, counts: Sequence[int]) -> int:
        ratio_ppm = counts[sensor.channel] * self.config.reference_mv * 10**6 // (self.config.full_scale * supply_mv)
        scaled = (ratio_ppm - sensor.zero_ppm) * sensor.per_ratio
        return scaled // 10**6 if scaled >= 0 else -(-scaled // 10**6)


class BoardTrace:
    """The model, with every call recorded."""

    def __init__(self, config: BoardConfig) -> None:
        """Start a board."""
        self.model = BoardModel(config)
        self.words: list[int] = []
        self.lines: list[str] = []
        self._valves = [0] * len(self.model.safety.joints)
        self._number = FIRST_NUMBER
        limits = [value for row in config.limits for value in row]
        sensors = [v for s in (*config.angle, *config.pressure) for v in (s.channel, s.zero_ppm, s.per_ratio)]
        numbers = [
            config.joints, config.channels, config.lowest_supply_mv, config.highest_supply_mv, config.reference_mv,
            config.full_scale, config.lowest_count, config.highest_count,
        ]  # fmt: skip
        self._record("start", [0, *numbers, *limits, *sensors, int(self.model.good)])

    def _record(self, line: str, words: Sequence[int]) -> None:
        model = self.model
        after = (int(model.safety.state), int(model.safety.fault), model.decoder.corrupt)
        self.words += [*words, *after, len(self._valves), *self._valves]
        self.lines.append(f"{line} -> {after} {self._valves}")

    def receive(self, now_us: int, data: bytes = b"") -> bytes:
        """See BoardModel.receive."""
        answer = self.model.receive(now_us, data)
        words = [1, now_us >> 32, now_us & 0xFFFFFFFF, len(data), *data, len(answer), *answer]
        self._record(f"receive {now_us} {data.hex()}: {answer.hex()}", words)
        return answer

    def sample(
        self, now_us: int, counts: Sequence[int], status: int = 0, supply_mv: int = 5000, *, repeated: bool = False
    ) -> tuple[bytes, list[int]]:
        """See BoardModel.sample; the converter counts on, unless it repeats its last sample."""
        self._number = (self._number + (not repeated)) % 2**32
        frame, valves = self.model.sample(now_us, Reading(self._number, status, supply_mv, counts))
        self._valves = list(valves)
        times = (now_us >> 32, now_us & 0xFFFFFFFF)
        self._record(
            f"sample {now_us} {self._number} {status} {supply_mv}: {frame.hex()}",
            [2, *times, self._number, status, supply_mv, *map(int, counts), len(frame), *frame],
        )
        return frame, self._valves

    def watch(self, now_us: int) -> list[int] | None:
        """See BoardModel.watch."""
        valves = self.model.watch(now_us)
        self._valves = list(valves or self._valves)
        self._record(f"watch {now_us}", [4, now_us >> 32, now_us & 0xFFFFFFFF, int(valves is not None)])
        return valves

    def packet(self, payload: bytes) -> bytes:
        """A payload as the C codec has to pack it."""
        made = bytes(cobs.encode(payload + struct.pack("<I", zlib.crc32(payload)))) + b"\x00"
        self._record(f"packet {payload.hex()}: {made.hex()}", [3, len(payload), *payload, len(made), *made])
        return made

    def replay(self) -> int:
        """Compare with the C board; the number of calls. AssertionError names the first one that differs."""
        words = np.array(self.words, dtype=np.int64).astype(np.uint32)
        keep(words)
        differs = int(_library().board_replay(words.ctypes.data, len(words)))
        assert differs == 0, f"call {differs} differs in C: " + "\n".join(
            line[:300] for line in self.lines[max(differs - 3, 0) : differs]
        )
        return int(_library().board_replay_compared())
