"""The link that reopens a board: back-off, counters, and no exception that escapes."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from hand_driver.board import Board, BoardError, Frame, LinkCounters, LinkLost, Pressures, Status
from hand_driver.link import FIRST_PAUSE_S, LONGEST_PAUSE_S, Link


class FailingBoard(Board):
    """A board that gives some frames, then is gone."""

    def __init__(self, frames: int) -> None:
        self.left = frames
        self.closed = False
        self.made = LinkCounters()

    @property
    def counters(self) -> LinkCounters:
        return self.made

    def read(self, timeout_s: float) -> Frame | None:
        if not self.left:
            raise LinkLost("the cable is pulled")
        self.left -= 1
        self.made.frames += 1
        return Frame(self.made.frames, 0, 5.0, Status(0), np.zeros(3, np.uint16), 0)

    def write(self, pressure_pa: Pressures, lifetime_s: float) -> None:
        if not self.left:
            raise LinkLost("the cable is pulled")
        self.made.written += 1

    def close(self) -> None:
        self.closed = True


def test_reopens_with_growing_pauses_and_counts_on() -> None:
    """Fails when the pause does not grow, does not end, or counters restart."""
    now = [0.0]
    tries: list[float] = []

    def open_board() -> Board:
        tries.append(now[0])
        if len(tries) in (1, 6):
            return FailingBoard(2)
        raise BoardError("no such port")

    link = Link(open_board, lambda: now[0])
    assert link.read(0.0) is not None
    assert link.write(np.zeros(3), 0.1)
    assert link.read(0.0) is not None
    while len(tries) < 6:
        link.read(0.0)
        assert link.up is (len(tries) == 6)
        now[0] += 0.01
    pauses = np.diff(tries)
    assert pauses == pytest.approx([FIRST_PAUSE_S * 2**k for k in range(5)], abs=0.03)
    assert link.read(0.0) is not None
    assert (link.reconnects, link.counters.frames, link.counters.written) == (1, 4, 1)
    assert link.error == ""


def test_the_pause_is_bounded_and_a_write_never_waits() -> None:
    """Fails when a dead port is retried ever more rarely, or a write without a board raises."""
    now = [0.0]

    def open_board() -> Board:
        raise BoardError("no such port")

    link = Link(open_board, lambda: now[0])
    for _ in range(20):
        link.read(0.0)
        now[0] += LONGEST_PAUSE_S + 0.01
    assert not link.up
    assert link.error == "no such port"
    assert not link.write(np.zeros(3), 0.1)


def test_a_closed_link_opens_nothing() -> None:
    """Fails when a closed link comes back to life."""
    board = FailingBoard(5)
    link = Link(lambda: board)
    link.read(0.0)
    link.close()
    assert board.closed
    assert link.read(0.0) is None
    assert not link.up


def test_a_board_that_opens_while_the_link_closes_is_closed() -> None:
    """Fails when closing during a slow open leaves a port open."""
    board = FailingBoard(5)
    opening, go_on = threading.Event(), threading.Event()

    def open_slowly() -> Board:
        opening.set()
        assert go_on.wait(20.0)
        return board

    link = Link(open_slowly)
    reader = threading.Thread(target=link.read, args=(0.0,))
    reader.start()
    assert opening.wait(20.0)
    link.close()
    go_on.set()
    reader.join(20.0)
    assert board.closed
    assert not link.up


def test_a_board_whose_end_is_seen_twice_is_counted_once() -> None:
    """Fails when a close during a read adds the connection's counters twice or hides the last error."""
    link_of: list[Link] = []

    class ClosedWhileRead(FailingBoard):
        def read(self, timeout_s: float) -> Frame | None:
            if self.left == 1:
                link_of[0].close()
                self.left = 0
            return super().read(timeout_s)

    link = Link(lambda: ClosedWhileRead(3))
    link_of.append(link)
    assert [link.read(0.0) is None for _ in range(4)] == [False, False, True, True]
    assert link.counters.frames == 2
    assert link.error == ""
    assert not link.up


def test_a_pause_ends_at_once_when_the_link_closes() -> None:
    """Fails when a driver that stops has to wait for the back-off."""

    def open_board() -> Board:
        raise BoardError("no such port")

    link = Link(open_board, lambda: 0.0)
    link.read(0.0)
    reader = threading.Thread(target=link.read, args=(600.0,))
    reader.start()
    link.close()
    reader.join(20.0)
    assert not reader.is_alive()
