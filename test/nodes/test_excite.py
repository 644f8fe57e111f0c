"""`hand excite --live` on a running hand: what it records, who may drive, and how it ends."""

from __future__ import annotations

import json
import signal
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hand_recording.loader import load_recording
from test.nodes.stack import TOOL

if TYPE_CHECKING:
    from test.nodes.stack import Client, Stack


def command(out: Path, *more: str) -> list[str]:
    joints = ["--joints", "index_distal,ring_proximal"]
    return [*TOOL, "excite", "steps", *joints, "--live", "--out", str(out), *more]


def vented(client: Client) -> bool:
    return bool(client.valves and max(client.valves[-1].pressure) == 0.0)


def test_the_experiment_is_driven_and_recorded(stack: Stack, client: Client) -> None:
    """Fails when a selected joint does not move, another does, frames are lost, or it is not vented at the end."""
    stack.node("simulation")
    client.until(lambda: client.joints)
    out = stack.folder / "steps.mcap"
    ran = subprocess.run(
        command(out, "--duration", "4", "--json"), capture_output=True, text=True, timeout=60, check=False
    )
    assert ran.returncode == 0, ran.stderr
    assert json.loads(ran.stdout)["samples"] == 800
    client.until(lambda: vented(client))
    states = load_recording(out)["joint_states"]
    assert len(states) > 780
    moved = dict(zip(states.names, np.degrees(np.ptp(states["position"], axis=0)), strict=True))
    assert min(moved["index_distal"], moved["ring_proximal"]) > 10.0
    assert max(moved[name] for name in moved if name.split("_")[0] in {"thumb", "little"}) < 2.0


def test_who_else_commands_and_ctrl_c(stack: Stack, client: Client) -> None:
    """Fails when two nodes drive one hand, or an interrupted experiment leaves pressure on it."""
    stack.node("simulation")
    controller = stack.node("controller")
    client.controlling()
    out = stack.folder / "no.mcap"
    refused = subprocess.run(command(out), capture_output=True, text=True, timeout=60, check=False)
    assert refused.returncode == 2
    assert "another node commands the valves" in refused.stderr.strip().splitlines()[-1]
    stack.stop(controller)
    client.until(lambda: client.node.count_publishers("valve_command") == 0)
    client.valves.clear()
    running = stack.start("hand", *command(stack.folder / "cut.mcap", "--duration", "60")[len(TOOL) :])
    client.until(lambda: client.valves and max(client.valves[-1].pressure) > 1e4)
    assert stack.stop(running) != 0
    assert "Traceback" not in stack.log("hand"), stack.log("hand")
    assert f"hand excite: interrupted; incomplete: {stack.folder / 'cut.mcap'}" in stack.log("hand")
    client.until(lambda: vented(client))
    assert len(load_recording(stack.folder / "cut.mcap")["joint_states"]) > 0


def test_an_experiment_ends_where_the_hand_falls_silent(stack: Stack, client: Client) -> None:
    """Fails when set-points are sent on although no angle arrives any more."""
    simulation = stack.node("simulation")
    client.until(lambda: client.joints)
    out = stack.folder / "silent.mcap"
    running = stack.start("hand", *command(out, "--duration", "60")[len(TOOL) :])
    client.until(lambda: client.valves and max(client.valves[-1].pressure) > 1e4)
    simulation.send_signal(signal.SIGSTOP)
    try:
        assert running.wait(timeout=30) == 2
    finally:
        simulation.send_signal(signal.SIGCONT)
    assert "no joint_states for 0.3 s; check the driver and the board; vented" in stack.log("hand")
    assert vented(client) or client.last_pressure_pa() == 0.0
