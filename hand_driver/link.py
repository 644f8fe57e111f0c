"""A board that is opened again after a failure: by a factory, after a pause that grows with each attempt."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from hand_driver.board import Board, BoardError, Frame, LinkCounters, Pressures

FIRST_PAUSE_S = 0.1
LONGEST_PAUSE_S = 2.0


class Link:
    """Reads and writes a board across disconnections. One thread reads; another one may write and close."""

    def __init__(self, open_board: Callable[[], Board], monotonic_s: Callable[[], float] = time.monotonic) -> None:
        """open_board opens the board at each call; read calls it, write never does."""
        self._open = open_board
        self._now = monotonic_s
        self._board: Board | None = None
        self._closed = threading.Event()
        self._change = threading.Lock()  # guards board, past counters and closing; never held during input or output
        self._pause_s = FIRST_PAUSE_S
        self._retry_s = -1.0
        self._past = LinkCounters()
        self._opened = 0
        self._former: Board | None = None
        self.sequence = 0
        self.error = ""

    @property
    def up(self) -> bool:
        """Whether a board is open."""
        return self._board is not None

    @property
    def protocol(self) -> int:
        """Protocol version in use; 0 without a board."""
        board = self._board
        return 0 if board is None else board.protocol

    @property
    def connections(self) -> int:
        """Number of times a board was opened."""
        return self._opened

    @property
    def reconnects(self) -> int:
        """Number of times the board was opened again."""
        return max(0, self._opened - 1)

    @property
    def counters(self) -> LinkCounters:
        """Sum of the counters over all connections."""
        with self._change:
            return self._sum(self._board)

    def _sum(self, board: Board | None) -> LinkCounters:
        past, now = self._past, LinkCounters() if board is None else board.counters
        return LinkCounters(
            past.frames + now.frames,
            past.dropped + now.dropped,
            past.corrupt + now.corrupt,
            past.written + now.written,
            past.replayed + now.replayed,
            past.restarts + now.restarts,
        )

    def read(self, timeout_s: float) -> Frame | None:
        """The next frame, or None after timeout_s [s] or without a board. Never raises BoardError."""
        board = self._board or self._reopen(timeout_s)
        if board is None:
            return None
        try:
            frame = board.read(timeout_s)
        except BoardError as error:
            self._lost(board, str(error))
            return None
        if frame is not None:
            self._pause_s, self.error = FIRST_PAUSE_S, ""
        return frame

    def _reopen(self, timeout_s: float) -> Board | None:
        """A new board after the pause; None before, after a failure and when closed."""
        if self._closed.wait(min(max(self._retry_s - self._now(), 0.0), timeout_s)) or self._now() < self._retry_s:
            return None
        try:
            board = self._open()
        except BoardError as error:
            self.error = str(error)
            self._wait_before_retry()
            return None
        with self._change:
            if not self._closed.is_set():
                if self._former is not None:
                    board.continue_from(self._former)
                self._board = board
                self._opened += 1
                return board
        board.close()  # `close` was called while it opened
        return None

    def write(self, pressure_pa: Pressures, lifetime_s: float) -> bool:
        """Send set-points, whose sequence then is `sequence`; False without a board. Never raises BoardError."""
        board = self._board
        if board is None:
            return False
        try:
            self.sequence = board.write(pressure_pa, lifetime_s) or 0
        except BoardError as error:
            self.error = str(error)
            return False
        return True

    def renew(self) -> None:
        """Ask the board, where one is open, to clear a fault that it has latched."""
        board = self._board
        if board is not None:
            board.renew()

    def close(self) -> None:
        """Close finally; a waiting read returns soon."""
        with self._change:
            self._closed.set()
            board = self._board
        if board is not None:
            self._lost(board, self.error)

    def _lost(self, board: Board, error: str) -> None:
        """Close a failed board; where reader and closer both find it failed, only the first call has an effect."""
        with self._change:
            if board is not self._board:
                return
            self._past, self._former, self._board, self.error = self._sum(board), board, None, error
        board.close()
        self._wait_before_retry()

    def _wait_before_retry(self) -> None:
        self._retry_s = self._now() + self._pause_s
        self._pause_s = min(2.0 * self._pause_s, LONGEST_PAUSE_S)
