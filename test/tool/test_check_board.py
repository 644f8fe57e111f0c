"""`hand check-board` as a newcomer uses it: bad usage, a missing port, a silent port, an emulated board."""

from __future__ import annotations

import json
import threading
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from hand_model.description import load_hand
from hand_sim.emulator import Emulator
from hand_sim.faults import Faults
from hand_sim.plant import SimulatedPlant
from hand_sim.serial_endpoint import Pty, SerialEndpoint
from hand_tool.cli import app

HAND = load_hand(Path(__file__).parents[2] / "config" / "hand.yaml")


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ((), "give either --serial PORT or --can CHANNEL"),
        (("--serial", "a", "--can", "b"), "give either"),
        (("--serial", "no_port"), "serial port no_port cannot be opened"),
        (("--can", "no_such0"), "CAN channel no_such0 of interface socketcan cannot be opened"),
        (("--serial", "x", "--test-joint", "index_middle"), "--test-joint is 'index_middle'; joints are "),
        (("--serial", "x", "--listen-only", "--test-joint", "index_distal"), "--listen-only sends nothing"),
        (("--serial", "x", "--model", "nowhere.yaml"), "nowhere.yaml"),
    ],
)
def test_bad_usage_is_one_line_and_exit_2(arguments: tuple[str, ...], line: str) -> None:
    """Fails when bad usage ends in a traceback, without a hint, or with another exit code."""
    result = CliRunner().invoke(app, ["check-board", *arguments])
    assert result.exit_code == 2
    assert result.stdout == ""
    assert line in result.stderr
    assert result.stderr.count("\n") == 1


def test_a_silent_port_is_a_fault(tmp_path: Path) -> None:
    """Fails when a port without a board counts as a working board, or as bad usage."""
    pty = Pty(str(tmp_path / "board"))
    try:
        result = CliRunner().invoke(app, ["check-board", "--serial", pty.name, "--seconds", "0.5", "--json", "--quiet"])
    finally:
        pty.close()
    assert result.exit_code == 1
    found = json.loads(result.stdout)
    assert found["verdict"] == "faults"
    assert "0 frames arrived" in found["faults"][0]


def test_a_deaf_board_with_a_dead_channel_is_named(tmp_path: Path) -> None:
    """Fails when the faults of a real serial line do not reach the verdict, or the table lacks a channel."""
    path = str(tmp_path / "board")
    plant = SimulatedPlant(HAND, HAND.rate_hz)
    plant.step(np.zeros(HAND.valve_count))  # compiles, which must not delay the first frames
    faults = Faults(deaf=((0.0, 1e5),), stuck={14: None})
    emulator = Emulator(plant, lambda: SerialEndpoint(path), HAND.rate_hz, HAND.valve_count, faults)
    stopped = threading.Event()
    server = threading.Thread(target=emulator.run, args=(stopped.is_set,))
    server.start()
    try:
        result = CliRunner().invoke(app, ["check-board", "--serial", path, "--seconds", "2", "--quiet"])
    finally:
        stopped.set()
        server.join()
        emulator.close()
    assert result.exit_code == 1
    assert "channel 14 (index_proximal pressure) is dead" in result.stdout
    assert "takes no set-points" in result.stdout
    assert all(joint in result.stdout for joint in HAND.joints)
    assert "version 2" in result.stdout
