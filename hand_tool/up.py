"""`hand up`: driver or simulation, controller, and robot_description with TF, until Ctrl-C."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from hand_tool import interrupts
from hand_tool.chosen_model import choose_model
from hand_tool.console import fail, note, running
from hand_tool.live import Namespace, Prefix, _client
from hand_tool.node_commands import Link, frames_command, node_commands
from hand_tool.options import AsJson, Model, Quiet, Verbose
from hand_tool.processes import READY_S, ProcessError, Processes

if TYPE_CHECKING:
    from hand_client.node import HandClient

ALONE_S = 3.0
"""Time in which a hand that runs already is heard; discovery takes up to 2.7 s."""
CHECK_S = 0.2


def up(
    *,
    serial: Annotated[str, typer.Option(help="Port of a serial board, such as /dev/ttyUSB0.")] = "",
    can: Annotated[str, typer.Option(help="Channel of a CAN board, such as can0.")] = "",
    sim: Annotated[bool, typer.Option("--sim", help="The simulated hand; this is the default.")] = False,
    can_interface: Annotated[str, typer.Option(help="python-can interface, with --can.")] = "socketcan",
    enabled: Annotated[bool, typer.Option("--enabled", help="Drive a real hand at once; else: hand enable.")] = False,
    frames: Annotated[bool, typer.Option("--frames/--no-frames", help="Publish robot_description and TF.")] = True,
    namespace: Namespace = "hand",
    joint_prefix: Prefix = "",
    model: Model = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Start a hand: driver or simulation, and controller. Ctrl-C vents the hand and ends them.

    Example: hand up --sim

    A simulated hand is enabled at start, a real one is not.

    Exit codes: 0 ended by Ctrl-C, 1 a node failed, 2 bad usage, or a hand runs already.
    """
    with running("up", errors=(ProcessError, RuntimeError)):
        if sum((bool(serial), bool(can), sim)) > 1:
            raise ValueError("--serial, --can and --sim exclude each other")
        chosen = choose_model(model)
        from hand_model.description import load_hand

        hand = load_hand(chosen.path, joint_prefix)
        chosen.print(as_json)
        nodes = list(node_commands(Link(serial, can, can_interface, enabled), namespace, joint_prefix, chosen.path))
        if frames and hand.geometry is not None:
            nodes.append(frames_command(namespace, joint_prefix, chosen.path))
        with _client(namespace, "up") as client:
            interrupts.end_on_sigterm()
            if client.until(lambda: bool(client.state.joints), ALONE_S):
                raise ValueError(f"a hand runs already in {client.namespace}; end it, or choose another --namespace")
            try:
                _run(client, nodes, as_json)
            except ProcessError as error:
                fail("up", str(error), 1)
            except interrupts.Interrupted:
                note("hand up: vented, nodes ended")


def _run(client: HandClient, nodes: list[list[str]], as_json: bool) -> None:
    """Run driver, controller and what viewers need, and print what they report, until a needed one ends or Ctrl-C."""
    driver = nodes[0][0]
    with TemporaryDirectory() as logs, Processes(Path(logs)) as processes:
        for index, command in enumerate(nodes):
            processes.start(command[0], command, optional=index > 1)
        waited, last = 0.0, ""
        while True:
            client.spin(CHECK_S)
            processes.check()
            if lost := processes.lost():
                note(f"hand up: no robot_description and TF any more: {lost}")
            waited += CHECK_S
            state = client.state
            problems = "; ".join(state.problems)
            runs = bool(state.joints and state.safety) and state.rate_hz == state.rate_hz
            if not runs and waited > READY_S:
                raise ProcessError(f"no frames from the hand within {READY_S:g} s; {problems}")
            safety = problems or (state.safety if runs else "")
            if safety in ("", last):
                continue
            last = safety
            if as_json:
                known = {key: value for key, value in state.as_json().items() if key != "joints"}
                print(json.dumps({"namespace": client.namespace} | known), flush=True)
            elif not problems:
                what = f"{driver} and controller of {len(state.joints)} joints"
                print(f"{what} run in {client.namespace} at {state.rate_hz:.0f} Hz: {safety}", flush=True)
            else:
                print(f"{client.namespace} has a problem: {safety}", file=sys.stderr, flush=True)
