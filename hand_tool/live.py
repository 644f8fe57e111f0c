"""`hand move`, `grasp`, `watch`, `enable` and `stop`: a running hand, over its topics, services and actions."""

from __future__ import annotations

import json
import math
import os
import time
from typing import TYPE_CHECKING, Annotated

import typer

from hand_tool import interrupts
from hand_tool.chosen_model import choose_model
from hand_tool.console import fail, running
from hand_tool.options import AsJson, Model, Quiet, Verbose

if TYPE_CHECKING:
    from rich.table import Table

    from hand_client.live_state import LiveState
    from hand_client.node import HandClient

Namespace = Annotated[str, typer.Option(help="Namespace of the hand.")]
Prefix = Annotated[str, typer.Option(help="Beginning of the joints' names, such as left_; default: of the model.")]
ARRIVED_RAD = math.radians(3.0)
SETTLE_S = 2.0
REFRESH_S = 0.2


def _client(namespace: str, command: str) -> HandClient:
    """A client that ends in order on Ctrl-C."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    from hand_client.node import HandClient

    interrupts.release()
    return HandClient(namespace, f"hand_{command}", interrupts.check)


def move(
    *,
    joints: Annotated[list[str], typer.Argument(help="JOINT=ANGLE in rad, or in degrees such as 45deg.")],
    duration: Annotated[float, typer.Option(help="Time of the motion in s, 0.1 to 60.")] = 1.0,
    namespace: Namespace = "hand",
    joint_prefix: Prefix = "",
    model: Model = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Move joints of a running hand to angles, and wait until they are there.

    Example: hand move index_proximal=0.8 middle_proximal=45deg

    Exit codes: 0 arrived within 3 degrees, 1 not arrived, 2 bad usage, or no hand that is enabled.
    """
    with running("move", errors=(RuntimeError,)):
        if not 0.1 <= duration <= 60.0:
            raise ValueError(f"--duration is {duration:g}; the allowed range is 0.1 to 60 s")
        from hand_client.requests import parse_moves
        from hand_model.description import load_hand

        chosen = choose_model(model)
        wanted = parse_moves(joints, load_hand(chosen.path, joint_prefix))
        chosen.print(as_json)
        with _client(namespace, "move") as client:
            client.await_control()
            unknown = sorted(set(wanted) - set(client.state.joints))
            if unknown:
                raise ValueError(f"the hand has no joint {unknown[0]}; it has {', '.join(client.state.joints)}")
            client.move(wanted, duration)
            try:
                client.spin(duration)
                client.until(lambda: not _away(client.state, wanted), SETTLE_S)
            except interrupts.Interrupted:
                client.hold(list(wanted))
                raise
            away, state = _away(client.state, wanted), client.state
    reached = {joint: state.values["position"][joint] for joint in wanted}
    if as_json:
        moved = {"arrived": not away, "angle_rad": reached, "wanted_rad": wanted}
        print(json.dumps(moved | {"model_file": chosen.as_json()}))
    else:
        print(
            ", ".join(f"{joint}: {angle:.3f} rad ({math.degrees(angle):.1f} deg)" for joint, angle in reached.items())
        )
    if away:
        lines = [f"{j} is at {math.degrees(reached[j]):.1f} of {math.degrees(wanted[j]):.1f} degrees" for j in away]
        fail("move", f"{'; '.join(lines)} ({state.safety})", 1)


def _away(state: LiveState, wanted: dict[str, float]) -> list[str]:
    angles = state.values["position"]
    return [joint for joint, angle in wanted.items() if abs(angles[joint] - angle) > ARRIVED_RAD]


def grasp(
    *,
    pattern: Annotated[str, typer.Argument(help="A pattern of grasps.yaml, such as tripod, cylindrical or open.")],
    closure: Annotated[float, typer.Option(help="0 open to 1 closed.")] = 1.0,
    max_torque: Annotated[float, typer.Option(help="Torque of a joint in N m; 0: the configured limit.")] = 0.0,
    namespace: Namespace = "hand",
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Close a running hand into a pattern: each joint stops at an object and then holds a torque.

    Example: hand grasp tripod --max-torque 0.08

    Exit codes: 0 done, 1 the grasp was refused or did not end as wanted, 2 bad usage, or no hand that is enabled.
    """
    with running("grasp", errors=(RuntimeError,)), _client(namespace, "grasp") as client:
        client.await_control()
        done, message = client.grasp(pattern, closure, max_torque, lambda: None)
    if as_json:
        print(json.dumps({"success": done, "message": message}))
    elif done:
        print(f"{pattern}: {message}")
    if not done:
        fail("grasp", message, 1)


def enable(
    reset: Annotated[
        bool, typer.Option("--reset", help="First clear latched faults of driver and controller.")
    ] = False,
    namespace: Namespace = "hand",
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Let the controller drive a running hand, from the pose that the hand has.

    Example: hand enable --reset

    Exit codes: 0 enabled, 1 refused, 2 bad usage or no running hand.
    """
    with running("enable", errors=(RuntimeError,)), _client(namespace, "enable") as client:
        done, message = client.enable(reset)
    if as_json:
        print(json.dumps({"success": done, "message": message}))
    elif done:
        print(message)
    if not done:
        fail("enable", message, 1)


def stop(
    namespace: Namespace = "hand", as_json: AsJson = False, quiet: Quiet = False, verbose: Verbose = False
) -> None:
    """Emergency stop: vent the hand and keep it vented until `hand enable --reset`.

    Example: hand stop

    Exit codes: 0 every node that drives the hand confirms the stop, 2 none received it or one does not confirm it.
    """
    with running("stop", errors=(RuntimeError,)), _client(namespace, "stop") as client:
        client.stop()
    print(json.dumps({"stopped": True}) if as_json else "vented and latched; go on with: hand enable --reset")


def watch(
    duration: Annotated[float | None, typer.Option(help="Length in s. Default: until Ctrl-C.")] = None,
    namespace: Namespace = "hand",
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Show angles, pressures, torques and contacts of a running hand as a live table, or as lines of JSON.

    Example: hand watch --duration 10

    Exit codes: 0 done, 2 bad usage or no running hand, 130 Ctrl-C.
    """
    with running("watch", errors=(RuntimeError,)), _client(namespace, "watch") as client:
        client.await_hand()
        end = math.inf if duration is None else time.monotonic() + duration
        if as_json:
            while time.monotonic() < end:
                client.spin(REFRESH_S)
                print(json.dumps(client.state.as_json()), flush=True)
            return
        from rich.live import Live

        with Live(auto_refresh=False) as live:
            while time.monotonic() < end:
                client.spin(REFRESH_S)
                live.update(_table(client.state, client.namespace), refresh=True)


def _table(state: LiveState, namespace: str) -> Table:
    """The live table: one row a joint."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    known = state.as_json()
    title = f"{namespace}: {state.safety}, {state.rate_hz:.0f} Hz, latency {1e3 * state.latency_s:.1f} ms"
    table = Table(title=title, caption="; ".join(state.problems) or None, box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("\njoint", no_wrap=True, min_width=max(map(len, state.joints), default=0))
    for heading in ("angle\ndeg", "reference\ndeg", "pressure\nbar", "set-point\nbar", "torque\nN m"):
        table.add_column(heading, justify="right")
    table.add_column("\ncontact")
    for joint, row in known["joints"].items():
        scaled = [(row["angle_rad"], 180 / math.pi, 1), (row["reference_rad"], 180 / math.pi, 1)]
        scaled += [(row["pressure_pa"], 1e-5, 2), (row["set_point_pa"], 1e-5, 2), (row["torque_nm"], 1.0, 3)]
        cells = ["-" if value is None else f"{value * factor:.{digits}f}" for value, factor, digits in scaled]
        table.add_row(joint, *cells, "yes" if row["contact"] else "")
    return table
