"""Which frames are new: repeated and older ones are dropped by their sequence, restarts of the board are recognised.

A board that restarts sends low sequence numbers and early times again, exactly as a link does that repeats old frames.
What differs is what follows: a repeated frame comes between new ones, the frames of a restarted board continue. So an
unexpected frame is a restart only after RESTART_S without an expected one, in which the unexpected ones continue.
"""

from __future__ import annotations

from dataclasses import dataclass

WRAP = 1 << 32
MAX_GAP = 1 << 16
"""Largest number of frames that may be missing in a row within a connection."""
RESTART_S = 0.1
"""Duration for which unexpected frames must continue; after the same silence the controller vents."""
RESTART_FRAMES = 3
"""Least number of these frames."""
FORGET_S = 0.05
"""An unexpected frame that is not continued for so long is given up."""
GAP_S = 1.0
"""After a longer silence between two connections, the board's clock must have advanced as the host's has, else the
board was restarted. Within a connection, frames that lag behind may have waited in a buffer."""
CLOCK_SHARE = 0.02
"""Largest relative difference of the two clocks that counts as the same advance; GAP_S / 2 is added."""


@dataclass(frozen=True, slots=True)
class Arrival:
    """What a frame is.  fresh: to be handed over.  missing: frames lost before it.  restarted: first of a new run."""

    fresh: bool
    missing: int = 0
    restarted: bool = False


@dataclass(slots=True)
class _Position:
    sequence: int
    board_time_us: int
    received_ns: int

    def leads_to(self, other: _Position) -> int:
        """Number of frames from this one to a later one; 0 where the other is not later."""
        ahead = (other.sequence - self.sequence) % WRAP
        return ahead if 0 < ahead < WRAP // 2 and other.board_time_us > self.board_time_us else 0

    def agrees(self, other: _Position) -> bool:
        """Whether both clocks have advanced by the same time, as far as a long silence between the frames shows."""
        host_s = (other.received_ns - self.received_ns) * 1e-9
        board_s = (other.board_time_us - self.board_time_us) * 1e-6
        return abs(board_s - host_s) <= 0.5 * GAP_S + CLOCK_SHARE * host_s


class FrameOrder:
    """Checks the frames of one board, over all its connections."""

    def __init__(self) -> None:
        """Begin with no frame."""
        self._last: _Position | None = None
        self._first: _Position | None = None  # of the unexpected frames that continue
        self._newest: _Position | None = None
        self._count = 0
        self._reconnected = False

    def reconnected(self) -> None:
        """The next frame is the first of a new connection."""
        self._reconnected = True

    def take(self, sequence: int, board_time_us: int, received_ns: int) -> Arrival:
        """Check a frame of a sequence and a board time [us], received at a monotonic time [ns]."""
        frame = _Position(sequence, board_time_us, received_ns)
        last = self._last
        if last is None:
            self._last = frame
            return Arrival(fresh=True)
        ahead = last.leads_to(frame)
        silent = received_ns - last.received_ns > GAP_S * 1e9
        agrees = silent and last.agrees(frame)
        if ahead and (agrees or (ahead <= MAX_GAP and not (silent and self._reconnected))):
            self._last, self._first, self._reconnected = frame, None, False
            return Arrival(fresh=True, missing=ahead - 1)
        if self._restarted(frame):
            self._last, self._first, self._reconnected = frame, None, False
            return Arrival(fresh=True, restarted=True)
        return Arrival(fresh=False)

    def _restarted(self, frame: _Position) -> bool:
        first, newest = self._first, self._newest
        if first is None or newest is None or frame.received_ns - newest.received_ns > FORGET_S * 1e9:
            self._first, self._newest, self._count = frame, frame, 1
            return False
        if not 0 < newest.leads_to(frame) <= MAX_GAP:
            return False
        self._newest = frame
        self._count += 1
        return self._count >= RESTART_FRAMES and frame.received_ns - first.received_ns >= RESTART_S * 1e9
