"""When the state of the board is published, and what it contains."""

from __future__ import annotations

import numpy as np
import pytest

from hand_driver.board import Echo, Frame, Status
from hand_driver.board_report import REPORT_HZ, Reporter
from hand_driver.driver_health import SILENCE_S

FINE = Status(0)
ECHO = Echo(7, 0.005, np.array([1e5, 0.0]))


def frame(status: Status = FINE) -> Frame:
    return Frame(3, 15_000, 4.9, status, np.zeros(2, np.uint16), 0, ECHO)


def test_an_unchanged_state_is_published_at_the_report_rate() -> None:
    """Fails when the topic stops while nothing changes, or is published with every frame."""
    reporter = Reporter()
    published = []
    for k in range(400):
        reporter.frame(frame(), k / 200)
        if reporter.due(2, True, "", k / 200) is not None:
            published.append(k / 200)
    assert np.diff(published) == pytest.approx(1.0 / REPORT_HZ)


@pytest.mark.parametrize(
    ("protocol", "up", "fault", "status"),
    [
        (1, True, "", Status(0)),
        (2, False, "", Status(0)),
        (2, True, "the board is deaf", Status(0)),
        (2, True, "", Status.VENTED),
        (2, True, "", Status.OVER_PRESSURE),
    ],
)
def test_a_change_is_published_at_once(protocol: int, up: bool, fault: str, status: Status) -> None:
    """Fails when the controller learns of a change of the board only with the next regular report."""
    reporter = Reporter()
    reporter.frame(frame(), 0.0)
    assert reporter.due(2, True, "", 0.0) is not None
    reporter.frame(frame(status), 0.001)
    report = reporter.due(protocol, up, fault, 0.001)
    assert report is not None
    assert (report.protocol, report.link_up, report.status, report.fault) == (protocol, up, status, fault)
    assert report.supply_voltage_v == 4.9


def test_a_silent_link_is_down_and_reports_no_set_points() -> None:
    """Fails when an open port without frames counts as a link, or old set-points look like present ones."""
    reporter = Reporter()
    first = reporter.due(0, True, "", 0.0)
    assert first is not None
    assert (first.link_up, first.echo) == (False, None)
    reporter.frame(frame(), 1.0)
    up = reporter.due(2, True, "", 1.0)
    assert up is not None
    assert (up.link_up, up.echo) == (True, ECHO)
    down = reporter.due(2, True, "", 1.0 + 1.1 * SILENCE_S)
    assert down is not None
    assert (down.link_up, down.echo) == (False, None)
