"""What every transport does with the payloads of a board: order, session, echo, counters. No I/O."""

from __future__ import annotations

import secrets

from hand_driver.board import Echo, Frame, LinkCounters, Pressures, ProtocolMismatch
from hand_driver.frame_order import FrameOrder
from hand_driver.negotiation import HostSession
from hand_driver.wire import AnswerPayload, OfferPayload, Payload, SamplePayload, SetPointPayload


class HostProtocol:
    """One connection to a board. `set_points` may run in another thread than the rest."""

    def __init__(self, channels: int, where: str) -> None:
        """A board with this number of channels, connected at a place that messages name."""
        self._channels = channels
        self._where = where
        self._order = FrameOrder()
        self._session = HostSession(secrets.randbits(32))
        self._sequence = 0
        self.counters = LinkCounters()

    @property
    def version(self) -> int:
        """Protocol version in use."""
        return self._session.version

    def continue_from(self, former: HostProtocol) -> None:
        """Check the frames by those of the former connection, so that a restart in between is recognised.

        The session stays the same: only `renew` clears a fault that the board has latched.
        """
        self._order = former._order
        self._order.reconnected()
        self._session = HostSession(former._session.session)
        self._sequence = former._sequence

    def renew(self) -> None:
        """Begin another session: the request to the board to clear a fault that it has latched."""
        self._session = HostSession(secrets.randbits(32))

    def offer(self, now_ns: int) -> OfferPayload | None:
        """The offer to send now, or None."""
        return self._session.offer(now_ns * 1e-9)

    def take(self, payload: Payload, now_ns: int) -> Frame | None:
        """The frame of a payload received at a monotonic time [ns]; None for other payloads and for old frames.

        Raises ProtocolMismatch for another number of channels, and for a board without a version in common.
        """
        if isinstance(payload, AnswerPayload):
            self._session.answer(payload, now_ns * 1e-9)
        return self._frame(payload, now_ns) if isinstance(payload, SamplePayload) else None

    def _frame(self, sample: SamplePayload, now_ns: int) -> Frame | None:
        if len(sample.counts) != self._channels:
            raise ProtocolMismatch(
                f"the board on {self._where} sends {len(sample.counts)} channels; the description has {self._channels}"
            )
        arrival = self._order.take(sample.sequence, sample.board_time_us, now_ns)
        counters = self.counters
        if not arrival.fresh:
            counters.replayed += 1
            return None
        counters.frames += 1
        counters.dropped += arrival.missing
        counters.restarts += arrival.restarted
        self._session.frame(sample.version, now_ns * 1e-9)
        return Frame(
            sample.sequence,
            sample.board_time_us,
            sample.supply_voltage_v,
            sample.status,
            sample.counts,
            now_ns,
            self._echo(sample),
        )

    def _echo(self, sample: SamplePayload) -> Echo | None:
        """The echo; before the board has answered, it concerns the set-points of another session."""
        return sample.echo if sample.version == self._session.version else None

    def set_points(self, pressure_pa: Pressures, lifetime_s: float) -> SetPointPayload:
        """The next set-points to send."""
        session = self._session.session if self._session.version > 1 else None
        payload = SetPointPayload(self._sequence, lifetime_s, pressure_pa, session)
        self._sequence = (self._sequence + 1) & 0xFFFFFFFF
        return payload
