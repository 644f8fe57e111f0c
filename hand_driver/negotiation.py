"""The version and session that host and board agree on: the host offers, the board answers. Both sides, no I/O.

A board of version 1 ignores offers; the host then stays at version 1 and offers again from time to time. A board that
was restarted has forgotten its session and sends version 1, so that the host offers again. A session is a random number
of the host: set-points of a former host are refused by it. A new session is also the request to clear a fault that the
board has latched, so that a host that connects again offers the same one.
"""

from __future__ import annotations

from hand_driver.board import ProtocolMismatch
from hand_driver.wire import VERSIONS, AnswerPayload, OfferPayload, SetPointPayload

LOWEST, HIGHEST = VERSIONS[0], VERSIONS[-1]
EAGER_PERIOD_S = 0.1
EAGER_OFFERS = 10
PATIENT_PERIOD_S = 2.0
"""The first offers are sent at EAGER_PERIOD_S, those to a board that did not answer at PATIENT_PERIOD_S."""
SWITCH_S = 0.5
"""Time after the answer in which frames of the former version may still arrive."""


class HostSession:
    """The host's side of one connection. Times are those of the host's monotonic clock [s]."""

    def __init__(self, session: int) -> None:
        """Begin at the lowest version with a session number of 32 bits."""
        self.session = session
        self.version = LOWEST
        self._offers = 0
        self._offered_s = 0.0
        self._answered_s = 0.0
        self._switched = False

    def offer(self, now_s: float) -> OfferPayload | None:
        """The offer to send now, or None while an answer is awaited or has arrived."""
        if self.version != LOWEST:
            return None
        period_s = EAGER_PERIOD_S if self._offers < EAGER_OFFERS else PATIENT_PERIOD_S
        if self._offers and now_s - self._offered_s < period_s:
            return None
        self._offers += 1
        self._offered_s = now_s
        return OfferPayload(LOWEST, HIGHEST, self.session)

    def answer(self, answer: AnswerPayload, now_s: float) -> None:
        """Take an answer; one to another session is ignored. ProtocolMismatch: no version in common."""
        if answer.session != self.session:
            return
        if answer.version not in VERSIONS:
            own = f"{LOWEST} to {HIGHEST}"
            raise ProtocolMismatch(f"the board uses protocol versions up to {answer.highest}, this driver uses {own}")
        self.version, self._answered_s, self._switched = answer.version, now_s, False

    def frame(self, version: int, now_s: float) -> None:
        """Note the version of a frame: one below the agreed version means that the board has forgotten the session."""
        if version == self.version:
            self._switched = True
        elif version < self.version and (self._switched or now_s - self._answered_s > SWITCH_S):
            self.version, self._offers = LOWEST, 0


class BoardSession:
    """The board's side: answers offers, and decides which set-points are accepted."""

    def __init__(self, highest: int = HIGHEST) -> None:
        """A board that uses versions up to the highest; with 1 it ignores offers, as boards of version 1 do."""
        self._highest = highest
        self.restart()

    def restart(self) -> None:
        """Forget the session, as a board does whose power was off."""
        self.version = LOWEST
        self.session: int | None = None
        self._sequence: int | None = None

    def offer(self, offer: OfferPayload) -> AnswerPayload | None:
        """The answer to an offer, None for no answer. An offer of the present session changes nothing."""
        if self._highest == LOWEST:
            return None
        version = min(offer.highest, self._highest)
        if version < offer.lowest:
            return AnswerPayload(0, self._highest, offer.session)
        if offer.session != self.session:
            self.version, self.session, self._sequence = version, offer.session, None
        return AnswerPayload(self.version, self._highest, offer.session)

    def accepts(self, set_points: SetPointPayload) -> bool:
        """Whether set-points are to be taken over. In a session, each needs a higher sequence than the last.

        Version 1 has no session; its set-points are accepted until the first ones of the session.
        """
        if set_points.session is None:
            return self._sequence is None
        if self.version == LOWEST or set_points.session != self.session:
            return False
        if self._sequence is not None and not 0 < (set_points.sequence - self._sequence) % (1 << 32) < 1 << 31:
            return False
        self._sequence = set_points.sequence
        return True
