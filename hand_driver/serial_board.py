"""A board on a serial port, by pyserial."""

from __future__ import annotations

import termios
import time
from collections import deque

import serial
from serial.tools import list_ports

from hand_driver.board import BoardError, Frame, LinkLost
from hand_driver.linked_board import LinkedBoard
from hand_driver.wire import OfferPayload, PacketDecoder, SetPointPayload, encode_offer, encode_set_points


class SerialBoard(LinkedBoard):
    """Reads samples and writes set-points on one port; read and write may come from two threads."""

    LINK_ERRORS = (serial.SerialException, OSError, TypeError)

    def __init__(self, port: str, channels: int, baud: int = 1_000_000) -> None:
        """Open port at baud [bit/s] for a board with this number of channels. BoardError: one line."""
        try:
            self._serial = serial.Serial(port, baud, timeout=0.1, write_timeout=0.1, exclusive=True)
            self._serial.reset_input_buffer()  # these bytes were sampled before the port was opened
        except (serial.SerialException, OSError, ValueError, termios.error) as error:
            raise BoardError(_cannot_open(port, error)) from None
        super().__init__(channels, f"serial port {port}")
        self._decoder = PacketDecoder(joining=True)
        self._ready: deque[Frame] = deque()

    def read(self, timeout_s: float) -> Frame | None:
        """See Board.read."""
        end = time.monotonic() + timeout_s
        while not self._ready:
            self._offer()
            left = end - time.monotonic()
            if left <= 0.0:
                return None
            try:
                self._serial.timeout = left
                data = self._serial.read(max(1, self._serial.in_waiting))
            except (serial.SerialException, OSError, TypeError, ValueError) as error:
                # pyserial raises TypeError and ValueError for a port closed by another thread.
                raise LinkLost(f"{self._where} is lost: {error}") from None
            self._take(data, time.monotonic_ns())
        return self._ready.popleft()

    def _take(self, data: bytes, now_ns: int) -> None:
        for payload in self._decoder.feed(data):
            frame = self._protocol.take(payload, now_ns)
            if frame is not None:
                self._ready.append(frame)

    def _corrupt(self) -> int:
        return self._decoder.corrupt

    def _send(self, payload: OfferPayload | SetPointPayload) -> None:
        encode = encode_offer if isinstance(payload, OfferPayload) else encode_set_points
        self._serial.write(encode(payload))  # type: ignore[arg-type]

    def close(self) -> None:
        """See Board.close."""
        self._serial.close()


def _cannot_open(port: str, error: Exception) -> str:
    known = ", ".join(sorted(found.device for found in list_ports.comports())) or "none"
    reason = " ".join(str(error).split())
    return f"serial port {port} cannot be opened ({reason}); ports of this machine: {known}"
