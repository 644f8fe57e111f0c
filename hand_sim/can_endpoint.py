"""The board's end of a CAN bus: a real bus, or a serial-line CAN adapter (slcan) on a pseudo-terminal."""

from __future__ import annotations

import can

from hand_driver.board import LinkLost, ProtocolMismatch
from hand_driver.can_board import check_id_offset, open_bus, received_message, send_message
from hand_driver.can_wire import CanAssembler, CanMessage, encode_answer, encode_sample
from hand_driver.negotiation import HIGHEST, BoardSession
from hand_driver.wire import OfferPayload, SamplePayload, SetPointPayload
from hand_sim.emulator import BoardEndpoint, in_session
from hand_sim.serial_endpoint import Pty

ANSWERS = {
    b"V": b"V0101\r",  # hardware and software version
    b"N": b"N0001\r",  # serial number
    b"F": b"F00\r",  # no fault
    **dict.fromkeys((b"", b"S", b"s", b"Y", b"O", b"L", b"C", b"Z", b"T", b"r", b"R"), b"\r"),
}
"""The answer of the adapter to each command."""


class _HostReader:
    """Turns messages of the host into set-points and answers; invalid ones are skipped."""

    def __init__(self, session: BoardSession) -> None:
        self._assembler = CanAssembler()
        self._session = session

    def of(self, messages: list[CanMessage]) -> tuple[list[SetPointPayload], list[CanMessage]]:
        """The accepted set-points, and the answers to send."""
        accepted, answers = [], []
        for message in messages:
            try:
                payload = self._assembler.feed(message)
            except ProtocolMismatch:
                continue
            if isinstance(payload, OfferPayload) and (answer := self._session.offer(payload)) is not None:
                answers.append(encode_answer(answer))
            elif isinstance(payload, SetPointPayload) and self._session.accepts(payload):
                accepted.append(payload)
        return accepted, answers


def _messages(sample: SamplePayload, corrupt: bool) -> list[CanMessage]:
    messages = encode_sample(sample)
    if corrupt:
        middle = len(messages) // 2
        damaged = bytes([messages[middle].data[0] ^ 0x55]) + messages[middle].data[1:]
        messages[middle] = CanMessage(messages[middle].identifier, damaged)
    return messages


class CanEndpoint(BoardEndpoint):
    """The emulated board on a bus of python-can."""

    def __init__(self, interface: str, channel: str, bitrate: int, id_offset: int = 0, protocol: int = HIGHEST) -> None:
        """Join the bus with protocol versions up to `protocol`; id_offset as of CanBoard. BoardError: it cannot."""
        self._id_offset = check_id_offset(id_offset)
        self._bus = open_bus(interface, channel, bitrate)
        self._name = f"CAN {interface} {channel} {bitrate} bit/s"
        self._session = BoardSession(protocol)
        self._reader = _HostReader(self._session)

    @property
    def session(self) -> BoardSession:
        """See BoardEndpoint.session."""
        return self._session

    @property
    def description(self) -> str:
        """See BoardEndpoint.description."""
        return self._name

    def send(self, sample: SamplePayload, corrupt: bool = False) -> None:
        """See BoardEndpoint.send."""
        self._send(_messages(in_session(sample, self._session), corrupt))

    def _send(self, messages: list[CanMessage]) -> None:
        for message in messages:
            try:
                send_message(self._bus, message, self._id_offset)
            except can.CanError:
                return  # a full transmit queue: the rest is lost, as on a real bus

    def receive(self) -> list[SetPointPayload]:
        """See BoardEndpoint.receive. Raises LinkLost when the bus is lost."""
        arrived = []
        try:
            while (message := self._bus.recv(0.0)) is not None:
                if (ours := received_message(message, self._id_offset)) is not None:
                    arrived.append(ours)
        except (can.CanError, OSError) as error:
            raise LinkLost(f"{self._name} is lost: {' '.join(str(error).split())}") from None
        accepted, answers = self._reader.of(arrived)
        self._send(answers)
        return accepted

    def close(self) -> None:
        """See BoardEndpoint.close."""
        self._bus.shutdown()


class SlcanEndpoint(BoardEndpoint):
    """The emulated board behind an emulated slcan adapter, so that CAN crosses processes without a kernel module.

    Lawicel's ASCII protocol: a command is answered with a carriage return, an unknown one with a bell; tIIILDD... is a
    standard frame.
    """

    def __init__(self, path: str, protocol: int = HIGHEST) -> None:
        """Serve the adapter at path; the board uses protocol versions up to `protocol`."""
        self._pty = Pty(path)
        self._open = False
        self._line = b""
        self._session = BoardSession(protocol)
        self._reader = _HostReader(self._session)

    @property
    def session(self) -> BoardSession:
        """See BoardEndpoint.session."""
        return self._session

    @property
    def description(self) -> str:
        """See BoardEndpoint.description."""
        return f"CAN slcan {self._pty.name}"

    def send(self, sample: SamplePayload, corrupt: bool = False) -> None:
        """See BoardEndpoint.send; a closed channel sends nothing."""
        if self._open:
            self._send(_messages(in_session(sample, self._session), corrupt))

    def _send(self, messages: list[CanMessage]) -> None:
        self._pty.write(b"".join(b"t%03X8%s\r" % (m.identifier, m.data.hex().upper().encode()) for m in messages))

    def receive(self) -> list[SetPointPayload]:
        """See BoardEndpoint.receive; commands to the adapter are executed and answered."""
        arrived = []
        while data := self._pty.read():
            *lines, self._line = (self._line + data).split(b"\r")
            self._line = self._line[-64:]
            arrived += [message for line in lines if (message := self._execute(line)) is not None]
        accepted, answers = self._reader.of(arrived)
        if self._open:
            self._send(answers)
        return accepted

    def _execute(self, line: bytes) -> CanMessage | None:
        command = line[:1]
        if command == b"t":
            return _standard_frame(line) if self._open else None
        if command in (b"O", b"L", b"C"):
            self._open = command != b"C"
        self._pty.write(ANSWERS.get(command, b"\a"))
        return None

    def close(self) -> None:
        """See BoardEndpoint.close."""
        self._pty.close()


def _standard_frame(line: bytes) -> CanMessage | None:
    """The frame of a t line; None for a damaged one."""
    try:
        identifier, length = int(line[1:4], 16), int(line[4:5])
        data = bytes.fromhex(line[5:].decode("ascii"))
    except ValueError:
        return None
    return CanMessage(identifier, data) if len(data) == length else None
