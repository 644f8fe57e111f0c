"""A repeated test is repeated for one reason only, and named in the last lines of pytest."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from test.repeating import REPEATED, STALLED, TRIES, again_after_a_stall

CONFTEST = str(Path(__file__).with_name("conftest.py"))


class Hand:
    """A fixture whose hand is vented by a stall in the first tries."""

    def __init__(self, stalls: int) -> None:
        self.stalls, self.tries, self.cleared = stalls, 0, 0

    def vented_by_a_stall(self) -> str:
        return STALLED[0] if self.tries <= self.stalls else ""

    def begin_again(self) -> None:
        self.cleared += 1


@pytest.mark.parametrize(("stalls", "tries", "passes"), [(0, 1, False), (1, 2, True), (2, 3, True), (3, TRIES, False)])
def test_only_a_stall_repeats_a_test(stalls: int, tries: int, passes: bool) -> None:
    """Fails when another failure is repeated, a stall is repeated for ever, or a repetition is not noted."""
    hand = Hand(stalls)

    @again_after_a_stall
    def fails_while_the_machine_stalls(hand: Hand) -> None:
        hand.tries += 1
        assert 0 < stalls < hand.tries

    try:
        if passes:
            fails_while_the_machine_stalls(hand=hand)
        else:
            with pytest.raises(AssertionError):
                fails_while_the_machine_stalls(hand=hand)
        assert [why for _, _, why in REPEATED] == [STALLED[0]] * (tries - 1)
    finally:
        REPEATED.clear()  # this test itself was not repeated
    assert (hand.tries, hand.cleared) == (tries, tries - 1)


def test_the_last_lines_name_each_repetition(request: pytest.FixtureRequest) -> None:
    """Fails when a repeated test that passes, or fails, is not counted and named."""
    (conftest,) = (p for p in request.config.pluginmanager.get_plugins() if getattr(p, "__file__", "") == CONFTEST)
    reports = {
        kind: [SimpleNamespace(when="call", user_properties=[["repeated", f"after a stall of 0.2 s: {kind}"]])]
        for kind in ("passed", "failed")
    }
    printed: list[str] = []
    reporter = SimpleNamespace(stats=reports, section=printed.append, line=printed.append)
    conftest.pytest_terminal_summary(reporter)
    assert printed[0] == "2 repetitions of a test"
    assert printed[1:] == [f"repeated after a stall of 0.2 s: {kind}" for kind in ("passed", "failed")]
