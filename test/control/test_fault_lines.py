"""Every fault that the controller latches names the joint, the channel, the evidence and what to check."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from hand_control import frame_checks, step_watch
from hand_control.board_watch import LOST_S, OVER_PRESSURE, VENTED, VENTED_S, BoardWatch
from hand_control.sensor_lines import Contradiction, angle_jumped, pressure_off
from hand_control.sensor_watch import SensorWatch
from hand_control.supervisor import Supervisor
from hand_control.unmeasured import Unmeasured
from hand_model.description import load_hand
from validation.faults.page import trip_sites

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")
MEASURED = re.compile(r"(\w+)( and \w+)?: .*\(channels? \d+( and \d+)?\).* [^;]+; .*check .*")
WHOLE = re.compile(r"[^;]+; (.*check|call reset_driver).*")


def unmeasured() -> list[str]:
    lines = []
    for what in range(3):
        safety, values = Supervisor(), [np.zeros(len(HAND.joints)) for _ in range(3)]
        values[what][4] = np.nan
        Unmeasured(HAND, BoardWatch()).trip(safety, 4, values, 0)
        lines.append(safety.fault)
    return lines


def pressures() -> list[str]:
    verdicts = range(frame_checks.FOLLOWING + 1, frame_checks.STUCK_LOW + 1)
    return [pressure_off(verdict, HAND.joints[4], 15, 7.0e5, 6.0e5) for verdict in verdicts]


def contradictions() -> list[str]:
    watch = SensorWatch(HAND)
    verdicts = set(range(9)) - {step_watch.FINE, step_watch.UNCHECKED}
    return [watch.line(Contradiction(verdict, 4, 5, 0.1)) for verdict in verdicts]


def of_the_board(status: int, fault: str = "", reported: bool = True) -> str:
    board, late_ns = BoardWatch(), round(1.1e9 * max(LOST_S, VENTED_S))
    for now_ns in (0, late_ns):
        if reported or not now_ns:
            board.state(status, 2, fault, now_ns)
        line = board.check(True, now_ns)
    return line


def of_silence(command_timeout_s: float, now_ns: int) -> str:
    safety = Supervisor()
    safety.enable()
    safety.frame(0)
    safety.arm(0)
    safety.check(now_ns, command_timeout_s)
    return safety.fault


WHOLE_HAND = (
    of_the_board(OVER_PRESSURE),
    of_the_board(VENTED),
    of_the_board(0, "the board is deaf"),
    of_the_board(0, reported=False),
    of_silence(0.0, 10**9),
    of_silence(0.01, 5 * 10**7),
    SensorWatch(HAND).line(Contradiction(step_watch.UNCHECKED, 0, -1, 0.0)),
)
SITES = {
    "hand_control/controller.py::Controller._react": 3,
    "hand_control/controller.py::Controller._pressure_off": 1,
    "hand_control/controller.py::Controller.check": 1,
    "hand_control/supervisor.py::Supervisor.check": 2,
}
"""Calls of `trip` in controller and supervisor whose lines are tested here."""


@pytest.mark.parametrize("line", [*unmeasured(), angle_jumped(HAND.joints[4], 4, 1.2), *pressures(), *contradictions()])
def test_a_fault_of_a_measurement_names_joint_channel_evidence_and_check(line: str) -> None:
    """Fails when the line of a latch leaves open which joint and channel it concerns, or what to check."""
    found = MEASURED.fullmatch(line)
    assert found is not None, line
    assert found[1] == HAND.joints[4]


@pytest.mark.parametrize("line", WHOLE_HAND)
def test_a_fault_of_the_whole_hand_says_what_to_check(line: str) -> None:
    """Fails when the line of a latch without a joint has no evidence, or does not say what to check."""
    assert WHOLE.fullmatch(line), line


def test_every_trip_of_the_controller_is_tested_here() -> None:
    """Fails when the controller or the supervisor latches a fault whose line is not tested above."""
    sites = [site for site in trip_sites() if site.startswith(("hand_control/controller", "hand_control/supervisor"))]
    assert {site: sites.count(site) for site in sites} == SITES
