"""The board's end of a serial line: a pseudo-terminal that other processes open like a serial port."""

from __future__ import annotations

import os
import tty
from errno import EEXIST
from pathlib import Path

from hand_driver.board import ProtocolMismatch
from hand_driver.negotiation import HIGHEST, BoardSession
from hand_driver.wire import (
    OfferPayload,
    PacketDecoder,
    Payload,
    SamplePayload,
    SetPointPayload,
    encode_answer,
    encode_sample,
)
from hand_sim.emulator import BoardEndpoint, in_session

AUTO = "auto"
CHUNK = 4096
PTS = "/dev/pts/"
OWN = "/dev/pts/../pts/"
"""How the links of an emulator spell the folder of pseudo-terminals; no other program spells it so."""


class Pty:
    """A raw pseudo-terminal under a chosen name; never blocks."""

    def __init__(self, path: str) -> None:
        """Open it, and make a link to it at path ("auto": no link). OSError where the link cannot be made."""
        self._master, self._slave = os.openpty()  # the slave stays open, so that readers may come and go
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.name = os.ttyname(self._slave)
        self._own_target = self.name.replace(PTS, OWN, 1)
        self._link = None if path == AUTO else Path(path)
        if self._link is not None:
            try:
                self._make_link(self._link)
            except OSError:
                self._close_both()
                raise
            self.name = path

    def write(self, data: bytes) -> None:
        """Send data; bytes that do not fit into the buffer are lost, as on a line without flow control."""
        try:
            os.write(self._master, data)
        except (BlockingIOError, OSError):
            return

    def read(self) -> bytes:
        """The bytes that have arrived, possibly none."""
        try:
            return os.read(self._master, CHUNK)
        except (BlockingIOError, OSError):
            return b""

    def close(self) -> None:
        """Close it: a process that has it open sees a disconnect. A link that now belongs to another one stays."""
        if self._link is not None and _target(self._link) == self._own_target:
            self._link.unlink()
        self._close_both()

    def _make_link(self, link: Path) -> None:
        """Replace only a link that an emulator made, never one of another owner such as udev or socat."""
        target = _target(link)
        if target.startswith(OWN):
            link.unlink()
        elif target:
            raise FileExistsError(
                EEXIST, f"is a link to {target} that no emulator made; remove it or name another", link
            )
        link.symlink_to(self._own_target)

    def _close_both(self) -> None:
        for descriptor in (self._master, self._slave):
            os.close(descriptor)


def _target(link: Path) -> str:
    """Where a symbolic link points; empty for any other path."""
    return str(link.readlink()) if link.is_symlink() else ""


class SerialEndpoint(BoardEndpoint):
    """The emulated board on a pseudo-terminal."""

    def __init__(self, path: str, baud: int = 1_000_000, protocol: int = HIGHEST) -> None:
        """Serve at path with protocol versions up to `protocol`; baud only appears in the description."""
        self._pty = Pty(path)
        self._session = BoardSession(protocol)
        self._baud = baud
        self._decoder = PacketDecoder()

    @property
    def session(self) -> BoardSession:
        """See BoardEndpoint.session."""
        return self._session

    @property
    def description(self) -> str:
        """See BoardEndpoint.description."""
        return f"serial {self._pty.name} {self._baud} baud"

    def send(self, sample: SamplePayload, corrupt: bool = False) -> None:
        """See BoardEndpoint.send."""
        packet = bytearray(encode_sample(in_session(sample, self._session)))
        if corrupt:
            packet[len(packet) // 2] ^= 0x55
        self._pty.write(bytes(packet))

    def receive(self) -> list[SetPointPayload]:
        """See BoardEndpoint.receive."""
        accepted = []
        for payload in self._payloads(self._pty.read()):
            if isinstance(payload, OfferPayload) and (answer := self._session.offer(payload)) is not None:
                self._pty.write(encode_answer(answer))
            elif isinstance(payload, SetPointPayload) and self._session.accepts(payload):
                accepted.append(payload)
        return accepted

    def _payloads(self, data: bytes) -> list[Payload]:
        try:
            return self._decoder.feed(data)
        except ProtocolMismatch:
            return []

    def close(self) -> None:
        """See BoardEndpoint.close."""
        self._pty.close()
