"""A service that is called again where its answer is lost."""

from __future__ import annotations

import time
from concurrent.futures import Future

from hand_client.repeated_call import RepeatedCall


def test_a_lost_answer_is_asked_for_again_and_the_first_one_counts() -> None:
    """Fails when a call is not repeated, is repeated all the time, or the answer of a later call is taken."""
    sent: list[Future[int]] = []

    def send() -> Future[int]:
        sent.append(Future())
        return sent[-1]

    call = RepeatedCall(send, 0.05)
    assert not call.answered() and not call.answered() and len(sent) == 1
    end = time.monotonic() + 5.0
    while len(sent) < 3:
        assert not call.answered() and time.monotonic() < end
    sent[1].set_result(7)
    assert call.answered() and call.answer() == 7
