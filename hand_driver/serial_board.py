"""A board on a serial port, by pyserial."""

from __future__ import annotations

import termios
import threading
import time
from collections import deque

import serial
from serial.tools import list_ports

from hand_driver.board import Board, BoardError, Frame, LinkCounters, LinkLost, Pressures
from hand_driver.host_protocol import HostProtocol
from hand_driver.wire import PacketDecoder, encode_offer, encode_set_points


class SerialBoard(Board):
    """Reads samples and writes set-points on one port; read and write may come from two threads."""

    def __init__(self, port: str, channels: int, baud: int = 1_000_000) -> None:
        """Open port at baud [bit/s] for a board with this number of channels. BoardError: one line."""
        try:
            self._serial = serial.Serial(port, baud, timeout=0.1, write_timeout=0.1, exclusive=True)
            self._serial.reset_input_buffer()  # these bytes were sampled before the port was opened
        except (serial.SerialException, OSError, ValueError, termios.error) as error:
            raise BoardError(_cannot_open(port, error)) from None
        self._port = port
        self._protocol = HostProtocol(channels, port)
        self._decoder = PacketDecoder(joining=True)
        self._ready: deque[Frame] = deque()
        self._write_lock = threading.Lock()

    @property
    def counters(self) -> LinkCounters:
        """Counters of this connection."""
        self._protocol.counters.corrupt = self._decoder.corrupt
        return self._protocol.counters

    @property
    def protocol(self) -> int:
        """See Board.protocol."""
        return self._protocol.version

    def continue_from(self, former: Board) -> None:
        """See Board.continue_from."""
        if isinstance(former, SerialBoard):
            self._protocol.continue_from(former._protocol)

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
                raise LinkLost(f"serial port {self._port} is lost: {error}") from None
            self._take(data, time.monotonic_ns())
        return self._ready.popleft()

    def _take(self, data: bytes, now_ns: int) -> None:
        for payload in self._decoder.feed(data):
            frame = self._protocol.take(payload, now_ns)
            if frame is not None:
                self._ready.append(frame)

    def _offer(self) -> None:
        offer = self._protocol.offer(time.monotonic_ns())
        if offer is None:
            return
        with self._write_lock:
            try:
                self._serial.write(encode_offer(offer))
            except (serial.SerialException, OSError, TypeError):
                return  # the next read or write reports a lost port

    def write(self, pressure_pa: Pressures, lifetime_s: float) -> int:
        """See Board.write."""
        with self._write_lock:
            set_points = self._protocol.set_points(pressure_pa, lifetime_s)
            try:
                self._serial.write(encode_set_points(set_points))
            except (serial.SerialException, OSError, TypeError) as error:
                raise LinkLost(f"serial port {self._port} accepts no set-points: {error}") from None
            self._protocol.counters.written += 1
            return set_points.sequence

    def close(self) -> None:
        """See Board.close."""
        self._serial.close()


def _cannot_open(port: str, error: Exception) -> str:
    known = ", ".join(sorted(found.device for found in list_ports.comports())) or "none"
    reason = " ".join(str(error).split())
    return f"serial port {port} cannot be opened ({reason}); ports of this machine: {known}"
