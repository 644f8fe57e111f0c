"""Damaged frames on both transports: none may pass as good, none may raise, and the next good one must be accepted.

Each case damages the bytes of one packet (serial) or the messages of one payload (CAN) and gives them to the decoder of
the receiving side, samples to that of the driver and set-points to that of the board. A payload that comes out and is
not one that was sent is a false accept.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from cobs import cobs

from hand_driver import can_wire, wire
from hand_driver.board import Echo, ProtocolMismatch, Status
from hand_driver.wire import Payload, SamplePayload, SetPointPayload
from validation.faults.result import FaultResult, Size, Tally

CHANNELS, VALVES = 33, 11
POOL = 64
"""Number of different payloads that are damaged."""
PROBE_EVERY = 16
"""After this many damaged frames a good one is sent, which must be accepted."""
CUT, DROP, INSERT, FLIP, BYTES, SWAP, TWICE, SPLICE, NOISE = range(9)
KINDS = ("cut", "byte lost", "byte added", "bit flipped", "bytes changed", "order", "repeated", "spliced", "noise")


def run(size: Size, seed: int) -> list[FaultResult]:
    """At least 10^6 damaged frames a transport; quick: 10^4."""
    cases = size.of(10_000, 1_250_000)  # about one in eight damages nothing
    return [serial(cases, seed), can(cases, seed), resealed(size.of(2_000, 50_000), seed)]


def samples(rng: np.random.Generator, count: int) -> list[SamplePayload]:
    """Samples of random content, of versions 1 and 2 in turn."""
    return [
        SamplePayload(
            int(rng.integers(1 << 32)), int(rng.integers(1 << 63)), int(rng.integers(4000, 6000)) * 1e-3, Status(0),
            rng.integers(0, 4096, CHANNELS).astype(np.uint16), *((2, echo(rng)) if number % 2 else ()),
        )
        for number in range(count)
    ]  # fmt: skip


def echo(rng: np.random.Generator) -> Echo:
    """An echo of random content."""
    age_s = int(rng.integers(1000)) * 1e-3
    return Echo(
        int(rng.integers(1 << 32)),
        age_s,
        10.0 * rng.integers(0, 60_000, VALVES).astype(np.float64),
        int(rng.integers(256)),
    )


def set_points(rng: np.random.Generator, count: int) -> list[SetPointPayload]:
    """Set-points of random content, of versions 1 and 2 in turn."""
    pressures = [10.0 * rng.integers(0, 60_000, VALVES).astype(np.float64) for _ in range(count)]
    numbers = rng.integers(1 << 32, size=(count, 2)).tolist()
    return [SetPointPayload(numbers[k][0], 0.1, pressures[k], numbers[k][1] if k % 2 else None) for k in range(count)]


def identity(payload: Payload) -> tuple[Any, ...]:
    """The whole content of a payload, comparable."""
    if isinstance(payload, SamplePayload):
        head = (payload.sequence, payload.board_time_us, round(payload.supply_voltage_v * 1e3), int(payload.status))
        echo = payload.echo
        held = () if echo is None else (echo.sequence, echo.accepted, echo.age_s, np.rint(echo.pressure_pa).tobytes())
        return (*head, payload.version, payload.counts.tobytes(), *held)
    if not isinstance(payload, SetPointPayload):
        return (payload.session,)
    return (payload.session, payload.sequence, round(payload.lifetime_s * 1e3), np.rint(payload.pressure_pa).tobytes())


def serial(cases: int, seed: int) -> FaultResult:
    """Damaged packets of both directions."""
    rng = np.random.default_rng([seed, 1])
    tally = Tally("frames", "damaged serial packet", seed)
    sent: list[SamplePayload | SetPointPayload] = [*samples(rng, POOL), *set_points(rng, POOL)]
    packets = [wire.encode_sample(p) if isinstance(p, SamplePayload) else wire.encode_set_points(p) for p in sent]
    known = {identity(payload) for payload in sent}
    decoder = wire.PacketDecoder()
    kinds, picks = rng.integers(len(KINDS), size=cases), rng.integers(len(packets), size=(cases, 2))
    accepted = 0
    for case in range(cases):
        packet, other = packets[picks[case, 0]], packets[picks[case, 1]]
        found = _fed(decoder.feed, damage_bytes(int(kinds[case]), packet, other, rng) + b"\x00", tally)
        wrong = sum(identity(payload) not in known for payload in found)
        accepted += len(found) - wrong
        tally.false_accepts += wrong
        if case % PROBE_EVERY == 0 and len(decoder.feed(packet)) != 1:
            tally.case(f"case {case}: the good packet after it is lost", False)
    bad = tally.cases
    tally.many(cases - bad, cases - bad)
    tally.note = f"{accepted} whole packets among the pieces were accepted unchanged"
    return tally.result()


def _fed(feed: Callable[[bytes], list[Payload]], data: bytes, tally: Tally) -> list[Payload]:
    try:
        return feed(data)
    except ProtocolMismatch:
        return []
    except Exception as error:  # whatever it is, the driver would end
        tally.case(f"{type(error).__name__} for {data.hex()[:80]}", False)
        return []


def damage_bytes(kind: int, packet: bytes, other: bytes, rng: np.random.Generator) -> bytes:
    """One packet with damage of a kind; other: another packet to splice with."""
    data = bytearray(packet)
    at = int(rng.integers(len(data)))
    if kind == CUT:
        del data[at:]
    elif kind == DROP:
        del data[at]
    elif kind == INSERT:
        data.insert(at, int(rng.integers(256)))
    elif kind == FLIP:
        data[at] ^= 1 << int(rng.integers(8))
    elif kind == BYTES:
        count = int(rng.integers(1, 9))
        data[at : at + count] = rng.bytes(len(data[at : at + count]))
    elif kind == SWAP:
        data[at:] = data[at:][::-1]
    elif kind == TWICE:
        data += data[:at]
    elif kind == SPLICE:
        data[at:] = other[at:]
    else:
        data = bytearray(rng.bytes(int(rng.integers(1, 2 * len(packet)))))
    return bytes(data)


def can(cases: int, seed: int) -> FaultResult:
    """Damaged, lost, repeated and reordered messages of both directions."""
    rng = np.random.default_rng([seed, 2])
    tally = Tally("frames", "damaged CAN messages", seed)
    sent: list[SamplePayload | SetPointPayload] = [*samples(rng, POOL), *set_points(rng, POOL)]
    sets = [can_wire.encode_sample(p) if isinstance(p, SamplePayload) else can_wire.encode_set_points(p) for p in sent]
    known = {identity(payload) for payload in sent}
    assembler = can_wire.CanAssembler()
    kinds, picks = rng.integers(len(KINDS), size=cases), rng.integers(len(sets), size=(cases, 2))
    accepted = 0
    for case in range(cases):
        messages = sets[picks[case, 0]]
        for message in damage_messages(int(kinds[case]), messages, sets[picks[case, 1]], rng):
            payload = _assembled(assembler, message, tally)
            wrong = payload is not None and identity(payload) not in known
            accepted += payload is not None and not wrong
            tally.false_accepts += wrong
        if case % PROBE_EVERY == 0 and all(assembler.feed(message) is None for message in messages):
            tally.case(f"case {case}: the good messages after it are lost", False)
    bad = tally.cases
    tally.many(cases - bad, cases - bad)
    tally.note = f"{accepted} whole payloads among the pieces were accepted unchanged"
    return tally.result()


def _assembled(assembler: can_wire.CanAssembler, message: can_wire.CanMessage, tally: Tally) -> Payload | None:
    try:
        return assembler.feed(message)
    except ProtocolMismatch:
        return None
    except Exception as error:  # whatever it is, the driver would end
        tally.case(f"{type(error).__name__} for {message}", False)
        return None


def damage_messages(
    kind: int,
    messages: Sequence[can_wire.CanMessage],
    other: Sequence[can_wire.CanMessage],
    rng: np.random.Generator,
) -> list[can_wire.CanMessage]:
    """The messages of one payload with damage of a kind; other: those of another payload to splice with."""
    found = list(messages)
    at = int(rng.integers(len(found)))
    hit = found[at]
    if kind == CUT:
        del found[at:]
    elif kind == DROP:
        del found[at]
    elif kind == INSERT:
        found.insert(at, can_wire.CanMessage(int(rng.integers(0x800)), rng.bytes(int(rng.integers(9)))))
    elif kind == FLIP:
        bit = int(rng.integers(64))
        changed = bytearray(hit.data)
        changed[bit // 8] ^= 1 << bit % 8
        found[at] = can_wire.CanMessage(hit.identifier, bytes(changed))
    elif kind == BYTES:
        found[at] = can_wire.CanMessage(hit.identifier, rng.bytes(int(rng.integers(9))))
    elif kind == SWAP:
        with_ = int(rng.integers(len(found)))
        found[at], found[with_] = found[with_], found[at]
    elif kind == TWICE:
        found.insert(at, hit)
    elif kind == SPLICE:
        found[at:] = other[at:]
    else:
        found[at] = can_wire.CanMessage(int(rng.integers(0x800)), hit.data)
    return found


def resealed(cases: int, seed: int) -> FaultResult:
    """Packets with a right checksum and a wrong content: type, version, count, lifetime, length."""
    rng = np.random.default_rng([seed, 3])
    tally = Tally("frames", "right checksum, wrong type, version, count or length", seed)
    decoder = wire.PacketDecoder()
    pool = [wire.encode_sample(p) for p in samples(rng, 8)] + [wire.encode_set_points(p) for p in set_points(rng, 8)]
    for case in range(cases):
        payload = bytearray(opened(pool[int(rng.integers(len(pool)))]))
        way = case % 5
        if way == 0:
            payload[0] = int(rng.integers(0x10, 256))  # a version of the far future
        elif way == 1:
            payload[1] = int(rng.integers(0x10, 256))
        elif way == 2:
            payload += rng.bytes(int(rng.integers(1, 8)))
        elif way == 3:
            del payload[int(rng.integers(2, len(payload))) :]
        else:
            payload = bytearray(rng.bytes(int(rng.integers(0, 40))))
            payload[:2] = bytes((0xEE, 0xEE))
        found = _fed(decoder.feed, sealed(bytes(payload)), tally)
        tally.false_accepts += len(found)
        tally.case(("version", "type", "length", "cut", "noise")[way], not found)
    return tally.result()


def opened(packet: bytes) -> bytes:
    """The payload of a good serial packet, without its checksum."""
    return bytes(cobs.decode(packet[:-1]))[:-4]


def sealed(payload: bytes) -> bytes:
    """A serial packet of any payload with the right checksum."""
    return bytes(cobs.encode(payload + zlib.crc32(payload).to_bytes(4, "little"))) + b"\x00"
