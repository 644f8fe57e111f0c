"""The board's end of a serial line: a pseudo-terminal that other processes open like any serial port."""

from __future__ import annotations

import os
import tty
from pathlib import Path

from hand_driver.board import ProtocolMismatch
from hand_driver.wire import PacketDecoder, SamplePayload, SetPointPayload, encode_sample
from hand_sim.port import Order, Port, Sample

AUTO = "auto"
CHUNK = 4096
PTS = "/dev/pts/"


class Pty:
    """A raw pseudo-terminal under a name of one's choice; never blocks."""

    def __init__(self, path: str) -> None:
        """Make it, and a link to it at path ("auto": none). OSError where the link cannot be made."""
        self._master, self._slave = os.openpty()  # the slave stays open, so that readers may come and go
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self._device = self.name = os.ttyname(self._slave)
        self._link = None if path == AUTO else Path(path)
        if self._link is not None:
            try:
                self._make_link(self._link)
            except OSError:
                self._close_both()
                raise
            self.name = path

    def write(self, data: bytes) -> None:
        """Send; what a full buffer does not take is lost, as on a wire without flow control."""
        try:
            os.write(self._master, data)
        except (BlockingIOError, OSError):
            return

    def read(self) -> bytes:
        """What has arrived; empty where nothing has."""
        try:
            return os.read(self._master, CHUNK)
        except (BlockingIOError, OSError):
            return b""

    def close(self) -> None:
        """Hang up: whoever has it open sees a disconnect. A link that is another's by now stays."""
        if self._link is not None and _target(self._link) == self._device:
            self._link.unlink()
        self._close_both()

    def _make_link(self, link: Path) -> None:
        """Replace only what an emulator left behind: other links, such as udev's, are their owner's."""
        if _target(link).startswith(PTS):
            link.unlink()
        link.symlink_to(self._device)

    def _close_both(self) -> None:
        for descriptor in (self._master, self._slave):
            os.close(descriptor)


def _target(link: Path) -> str:
    """Where a symbolic link points; empty for what is none."""
    return str(link.readlink()) if link.is_symlink() else ""


class SerialPort(Port):
    """The emulated board on a pseudo-terminal."""

    def __init__(self, path: str, baud: int = 1_000_000) -> None:
        """Serve at path; baud is only told, a pseudo-terminal has none."""
        self._pty = Pty(path)
        self._baud = baud
        self._decoder = PacketDecoder()

    @property
    def description(self) -> str:
        """For people."""
        return f"serial {self._pty.name} {self._baud} baud"

    def send(self, sample: Sample, corrupt: bool = False) -> None:
        """See Port.send."""
        packet = bytearray(
            encode_sample(
                SamplePayload(
                    sample.sequence, sample.board_time_us, sample.supply_voltage_v, sample.status, sample.counts
                )
            )
        )
        if corrupt:
            packet[len(packet) // 2] ^= 0x55
        self._pty.write(bytes(packet))

    def receive(self) -> list[Order]:
        """See Port.receive."""
        try:
            payloads = self._decoder.feed(self._pty.read())
        except ProtocolMismatch:
            return []
        return [Order(p.pressure_pa, p.lifetime_s) for p in payloads if isinstance(p, SetPointPayload)]

    def close(self) -> None:
        """See Port.close."""
        self._pty.close()
