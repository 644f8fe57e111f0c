"""What the boards on a serial port and on a CAN bus share: protocol, counters, offers and set-points."""

from __future__ import annotations

import threading
import time
from abc import abstractmethod
from typing import ClassVar

from hand_driver.board import Board, LinkCounters, LinkLost, Pressures
from hand_driver.host_protocol import HostProtocol
from hand_driver.wire import OfferPayload, SetPointPayload


class LinkedBoard(Board):
    """A board behind a link; read and write may come from two threads."""

    LINK_ERRORS: ClassVar[tuple[type[Exception], ...]]
    """What the library of the link raises where the link is lost."""

    def __init__(self, channels: int, where: str) -> None:
        """A board with this number of ADC channels, connected at a place that messages name."""
        self._where = where
        self._protocol = HostProtocol(channels, where)
        self._write_lock = threading.Lock()

    @property
    def counters(self) -> LinkCounters:
        """Counters of this connection."""
        self._protocol.counters.corrupt = self._corrupt()
        return self._protocol.counters

    @property
    def protocol(self) -> int:
        """See Board.protocol."""
        return self._protocol.version

    def continue_from(self, former: Board) -> None:
        """See Board.continue_from."""
        if isinstance(former, type(self)):
            self._protocol.continue_from(former._protocol)

    def renew(self) -> None:
        """See Board.renew."""
        self._protocol.renew()

    def write(self, pressure_pa: Pressures, lifetime_s: float) -> int:
        """See Board.write."""
        with self._write_lock:
            set_points = self._protocol.set_points(pressure_pa, lifetime_s)
            try:
                self._send(set_points)
            except self.LINK_ERRORS as error:
                raise LinkLost(f"{self._where} accepts no set-points: {' '.join(str(error).split())}") from None
            self._protocol.counters.written += 1
            return set_points.sequence

    def _offer(self) -> None:
        offer = self._protocol.offer(time.monotonic_ns())
        if offer is None:
            return
        with self._write_lock:
            try:
                self._send(offer)
            except self.LINK_ERRORS:
                return  # the next read or write reports a lost link

    @abstractmethod
    def _corrupt(self) -> int:
        """Damaged packets of this connection so far."""

    @abstractmethod
    def _send(self, payload: OfferPayload | SetPointPayload) -> None:
        """Send one payload. Raises LINK_ERRORS."""
