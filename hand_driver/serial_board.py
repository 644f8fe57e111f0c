"""A board on a serial port, by pyserial."""

from __future__ import annotations

import termios
import threading
import time
from collections import deque

import serial
from serial.tools import list_ports

from hand_driver.board import Board, BoardError, Frame, LinkCounters, LinkLost, Pressures, ProtocolMismatch, SequenceGap
from hand_driver.wire import PacketDecoder, SamplePayload, SetPointPayload, encode_set_points


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
        self._channels = channels
        self._decoder = PacketDecoder(joining=True)
        self._gap = SequenceGap()
        self._ready: deque[Frame] = deque()
        self._sequence = 0
        self._write_lock = threading.Lock()
        self._counters = LinkCounters()

    @property
    def counters(self) -> LinkCounters:
        """Counters of this connection."""
        self._counters.corrupt = self._decoder.corrupt
        return self._counters

    def read(self, timeout_s: float) -> Frame | None:
        """See Board.read."""
        end = time.monotonic() + timeout_s
        while not self._ready:
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
        frame = self._ready.popleft()
        self._counters.frames += 1
        self._counters.dropped += self._gap.missing_before(frame.sequence)
        return frame

    def _take(self, data: bytes, now_ns: int) -> None:
        for payload in self._decoder.feed(data):
            if not isinstance(payload, SamplePayload):
                continue
            if len(payload.counts) != self._channels:
                raise ProtocolMismatch(
                    f"the board on {self._port} sends {len(payload.counts)} channels; "
                    f"the description has {self._channels}"
                )
            self._ready.append(
                Frame(
                    payload.sequence,
                    payload.board_time_us,
                    payload.supply_voltage_v,
                    payload.status,
                    payload.counts,
                    now_ns,
                )
            )

    def write(self, pressure_pa: Pressures, lifetime_s: float) -> None:
        """See Board.write."""
        with self._write_lock:
            packet = encode_set_points(SetPointPayload(self._sequence, lifetime_s, pressure_pa))
            self._sequence = (self._sequence + 1) & 0xFFFFFFFF
            try:
                self._serial.write(packet)
            except (serial.SerialException, OSError, TypeError) as error:
                raise LinkLost(f"serial port {self._port} accepts no set-points: {error}") from None
            self._counters.written += 1

    def close(self) -> None:
        """See Board.close."""
        self._serial.close()


def _cannot_open(port: str, error: Exception) -> str:
    known = ", ".join(sorted(found.device for found in list_ports.comports())) or "none"
    reason = " ".join(str(error).split())
    return f"serial port {port} cannot be opened ({reason}); ports of this machine: {known}"
