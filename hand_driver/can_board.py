"""A board on a CAN bus, by python-can: any of its interfaces."""

from __future__ import annotations

import os
import time
from typing import Any, cast

import can
import serial

from hand_driver.board import BoardError, Frame, LinkLost
from hand_driver.can_wire import ID_OFFSETS, CanAssembler, CanMessage, encode_offer, encode_set_points
from hand_driver.linked_board import LinkedBoard
from hand_driver.wire import OfferPayload, SetPointPayload

SLCAN = "slcan"
SEND_TIMEOUT_S = 0.05
"""Time for which a message may wait for a place in the transmit queue before the link counts as lost."""


class ReadAhead:
    """A serial port that is read in blocks. python-can's slcan takes each byte by system calls: half a processor."""

    def __init__(self, port: serial.SerialBase) -> None:
        """Read an open port."""
        self._port, self._ahead = port, bytearray()
        self.write, self.flush = port.write, port.flush
        self.close, self.fileno = port.close, port.fileno

    @property
    def in_waiting(self) -> int:
        """Bytes that can be read at once."""
        return len(self._ahead) or int(self._port.in_waiting)

    @property
    def is_open(self) -> bool:
        """Whether the port is open."""
        return bool(self._port.is_open)

    def read(self, size: int = 1) -> bytes:
        """At most size bytes; waits for the first as long as the port's time-out."""
        if not self._ahead:
            self._ahead += self._port.read(max(size, self._port.in_waiting))
        taken = bytes(self._ahead[:size])
        del self._ahead[:size]
        return taken

    def reset_input_buffer(self) -> None:
        """Forget what has arrived."""
        self._ahead.clear()
        self._port.reset_input_buffer()

    @property
    def write_timeout(self) -> float | None:
        """See serial.Serial; [s]."""
        allowed: float | None = self._port.write_timeout
        return allowed

    @write_timeout.setter
    def write_timeout(self, allowed_s: float | None) -> None:
        """See serial.Serial."""
        self._port.write_timeout = allowed_s


def open_bus(interface: str, channel: str, bitrate: int) -> can.BusABC:
    """A bus of python-can. BoardError: one line that names interface and channel."""
    options: dict[str, Any] = {"bitrate": bitrate}
    if interface == SLCAN:
        options |= {"sleep_after_open": 0.0, "tty_baudrate": 1_000_000}
    try:
        bus: Any = can.Bus(interface=interface, channel=channel, **options)
    except (can.CanError, OSError, ValueError, TypeError, ImportError, NotImplementedError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise BoardError(f"CAN channel {channel} of interface {interface} cannot be opened: {reason}") from None
    if interface == SLCAN:
        bus.serialPortOrig = ReadAhead(bus.serialPortOrig)
    return cast(can.BusABC, bus)


def send_message(bus: can.BusABC, message: CanMessage, id_offset: int) -> None:
    """Send one message with id_offset added to its identifier. Raises the exceptions of python-can."""
    identifier = message.identifier + id_offset
    bus.send(can.Message(arbitration_id=identifier, data=message.data, is_extended_id=False), timeout=SEND_TIMEOUT_S)


def received_message(message: can.Message | None, id_offset: int) -> CanMessage | None:
    """A data message with an 11-bit identifier; None for others (error frames of a bus have identifiers, too)."""
    if message is None or message.is_extended_id or message.is_remote_frame or message.is_error_frame:
        return None
    return CanMessage(message.arbitration_id - id_offset, bytes(message.data))


def check_id_offset(id_offset: int) -> int:
    """The offset. BoardError for one with which the identifiers of two hands would overlap."""
    if id_offset not in ID_OFFSETS:
        allowed = ", ".join(f"{offset:#04x}" for offset in ID_OFFSETS)
        raise BoardError(f"CAN identifier offset {id_offset:#x} is not one of {allowed}")
    return id_offset


class CanBoard(LinkedBoard):
    """Reads samples and writes set-points on one bus; read and write may come from two threads."""

    LINK_ERRORS = (can.CanError, OSError, TypeError)

    def __init__(
        self, interface: str, channel: str, channels: int, bitrate: int = 1_000_000, id_offset: int = 0
    ) -> None:
        """Open a bus for a board with this number of ADC channels. BoardError: one line.

        id_offset, one of ID_OFFSETS, is added to every identifier.
        """
        self._id_offset = check_id_offset(id_offset)
        self._bus = open_bus(interface, channel, bitrate)
        # An unplugged serial adapter can read as silence; then its device file is missing.
        self._device = channel.partition("@")[0] if interface == SLCAN else None
        super().__init__(channels, f"CAN channel {channel}")
        self._assembler = CanAssembler()

    def read(self, timeout_s: float) -> Frame | None:
        """See Board.read."""
        end = time.monotonic() + timeout_s
        while (left := end - time.monotonic()) > 0.0:
            self._offer()
            message = self._receive(left)
            payload = None if message is None else self._assembler.feed(message)
            if payload is not None and (frame := self._protocol.take(payload, time.monotonic_ns())) is not None:
                return frame
        if self._device is not None and not os.path.exists(self._device):  # noqa: PTH110 - may be "COM3"
            raise LinkLost(f"{self._where} is lost")
        return None

    def _receive(self, timeout_s: float) -> CanMessage | None:
        try:
            message = self._bus.recv(timeout_s)
        except (ValueError, IndexError):  # python-can raises these for a line of noise on a serial adapter
            self._assembler.corrupt += 1
            return None
        except (can.CanError, OSError, TypeError) as error:
            raise LinkLost(f"{self._where} is lost: {' '.join(str(error).split())}") from None
        return received_message(message, self._id_offset)

    def _corrupt(self) -> int:
        return self._assembler.corrupt

    def _send(self, payload: OfferPayload | SetPointPayload) -> None:
        messages = [encode_offer(payload)] if isinstance(payload, OfferPayload) else encode_set_points(payload)
        for message in messages:
            send_message(self._bus, message, self._id_offset)

    def close(self) -> None:
        """See Board.close."""
        try:
            self._bus.shutdown()
        except (can.CanError, OSError):  # the adapter is already lost; python-can then keeps its device open
            if self._device is not None:
                self._bus.serialPortOrig.close()
