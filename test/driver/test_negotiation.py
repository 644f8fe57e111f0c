"""Version and session between host and board: offers, answers, old boards, restarts, and which set-points count."""

from __future__ import annotations

import numpy as np
import pytest

from hand_driver.board import ProtocolMismatch
from hand_driver.negotiation import EAGER_OFFERS, EAGER_PERIOD_S, PATIENT_PERIOD_S, SWITCH_S, BoardSession, HostSession
from hand_driver.wire import AnswerPayload, OfferPayload, SetPointPayload

WRAP = 1 << 32


def set_points(sequence: int, session: int | None) -> SetPointPayload:
    return SetPointPayload(sequence, 0.1, np.zeros(2), session)


def agreed(session: int = 5) -> tuple[HostSession, BoardSession]:
    host, board = HostSession(session), BoardSession()
    offer = host.offer(0.0)
    assert offer is not None
    answer = board.offer(offer)
    assert answer is not None
    host.answer(answer, 0.0)
    return host, board


def test_host_and_board_agree_on_version_2() -> None:
    """Fails when the offer is not answered, the two disagree, or the host offers on."""
    host, board = agreed()
    assert (host.version, board.version, board.session) == (2, 2, 5)
    assert host.offer(100.0) is None


def test_a_board_of_version_1_is_asked_patiently_and_used_all_the_same() -> None:
    """Fails when offers flood a board that does not know them, or stop, so that its successor is never found."""
    host, board = HostSession(5), BoardSession(1)
    times = []
    for k in range(3000):
        host.frame(1, k * 0.01)
        offer = host.offer(k * 0.01)
        if offer is not None:
            times.append(k * 0.01)
            assert board.offer(offer) is None
    assert np.diff(times[:EAGER_OFFERS]) == pytest.approx(EAGER_PERIOD_S, abs=0.011)
    assert np.diff(times[EAGER_OFFERS + 1 :]) == pytest.approx(PATIENT_PERIOD_S, abs=0.011)
    assert host.version == 1
    assert board.accepts(set_points(0, None)) and not board.accepts(set_points(0, 5))


def test_answers_to_another_session_are_ignored() -> None:
    """Fails when the answer to another host, or to a former connection, counts."""
    host = HostSession(5)
    host.answer(AnswerPayload(2, 2, 6), 0.0)
    assert host.version == 1


def test_a_board_without_a_version_in_common_is_named() -> None:
    """Fails when host and board without a common version drive the hand in a version that one of them guesses."""
    board = BoardSession()
    answer = board.offer(OfferPayload(3, 4, 5))
    assert answer == AnswerPayload(0, 2, 5)
    with pytest.raises(ProtocolMismatch, match="versions up to 2, this driver uses 1 to 2"):
        HostSession(5).answer(answer, 0.0)


def test_a_future_host_is_served_with_our_highest_version() -> None:
    """Fails when a board refuses a host whose versions include its own."""
    assert BoardSession().offer(OfferPayload(1, 9, 5)) == AnswerPayload(2, 2, 5)


def test_a_restarted_board_is_offered_again() -> None:
    """Fails when a host takes a board that has forgotten the session for one that has agreed."""
    host, _ = agreed()
    host.frame(2, 0.1)
    host.frame(1, 0.2)
    assert host.version == 1
    assert host.offer(0.2) is not None


def test_frames_that_were_under_way_do_not_end_the_session() -> None:
    """Fails when frames of version 1 that were sent before the answer look like a restart."""
    host, _ = agreed()
    host.frame(1, 0.9 * SWITCH_S)
    assert host.version == 2
    host.frame(1, 1.1 * SWITCH_S)
    assert host.version == 1


@pytest.mark.parametrize("first", [0, 7, WRAP - 2])
def test_only_newer_set_points_of_the_session_are_accepted(first: int) -> None:
    """Fails when a repeated, older or foreign packet reaches a valve, or a wrap stops the hand."""
    _, board = agreed()
    for k in range(5):
        sequence = (first + k) % WRAP
        assert board.accepts(set_points(sequence, 5))
        for old in range(k + 1):
            assert not board.accepts(set_points((first + old) % WRAP, 5))
        assert not board.accepts(set_points((sequence + 1) % WRAP, 6))
        assert not board.accepts(set_points((sequence + 1) % WRAP, None))
    assert not board.accepts(set_points((first + 4 + (1 << 31)) % WRAP, 5))
    assert board.accepts(set_points((first + 4 + (1 << 31) - 1) % WRAP, 5))


def test_set_points_of_version_1_count_until_the_session_is_used() -> None:
    """Fails when set-points that were under way during the answer are lost."""
    _, board = agreed()
    assert board.accepts(set_points(3, None))
    assert board.accepts(set_points(0, 5))
    assert not board.accepts(set_points(4, None))


def test_a_repeated_offer_changes_nothing_and_a_new_session_begins_at_any_sequence() -> None:
    """Fails when a repeated offer opens the door to old set-points, or a new host is refused for its low sequence."""
    _, board = agreed()
    assert board.accepts(set_points(100, 5))
    assert board.offer(OfferPayload(1, 2, 5)) == AnswerPayload(2, 2, 5)
    assert not board.accepts(set_points(100, 5))
    board.offer(OfferPayload(1, 2, 6))
    assert not board.accepts(set_points(101, 5))
    assert board.accepts(set_points(0, 6))


def test_a_restarted_board_accepts_nothing_of_the_former_session() -> None:
    """Fails when set-points of the time before a restart drive the hand after it."""
    _, board = agreed()
    assert board.accepts(set_points(1, 5))
    board.restart()
    assert not board.accepts(set_points(2, 5))
    assert (board.version, board.session) == (1, None)
