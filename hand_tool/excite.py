"""`hand excite`: an experiment on the simulated hand, or on a running driver, recorded."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress

from hand_model.arrays import Array
from hand_model.description import Hand, load_hand
from hand_recording.installed import default_model
from hand_recording.replay import record_offline
from hand_tool.processes import Processes


def excite(
    name: Annotated[str, typer.Argument(help="staircase, slow_triangle, steps, multisine, chirp, hold, ...")],
    out: Annotated[Path, typer.Option(help="New recording: a folder, or NAME.mcap for one bare file.")],
    joints: Annotated[str, typer.Option(help="Comma-separated joints. Default: all.")] = "",
    duration: Annotated[float, typer.Option(help="Length in s.")] = 60.0,
    max_pressure_bar: Annotated[float, typer.Option(help="Highest set-point in bar (gauge).")] = 4.0,
    model: Annotated[Path | None, typer.Option(help="hand.yaml. Default: the installed one.")] = None,
    live: Annotated[bool, typer.Option("--live", help="Drive a running driver or simulation node by topics.")] = False,
    namespace: Annotated[str, typer.Option(help="Of the running hand, with --live.")] = "hand",
    storage: Annotated[str, typer.Option(help="mcap or sqlite3.")] = "mcap",
    seed: Annotated[int, typer.Option(help="Of random levels and, offline, of sensor noise.")] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the outcome as JSON.")] = False,
) -> None:
    """Run an experiment within pressure, torque and angle limits and record it; offline unless --live is given.

    Example: hand excite slow_triangle --joints index_proximal --out triangle.mcap

    With --live the controller must be disabled or not running; the hand vents at the end and on Ctrl-C.

    Exit codes: 0 done, 2 bad usage, bad input or no running hand.
    """
    try:
        from hand_diagnosis.excitation import set_points  # noqa: PLC0415 - only where it is used

        hand = load_hand(model or default_model())
        if not 0.0 < max_pressure_bar * 1e5 <= hand.supply_pressure_pa:
            top = hand.supply_pressure_pa * 1e-5
            raise ValueError(f"--max-pressure-bar is {max_pressure_bar:g}; the allowed range is above 0 to {top:g}")
        wanted = [joint.strip() for joint in joints.split(",") if joint.strip()] or list(hand.joints)
        commands = set_points(name, hand, wanted, duration, max_pressure_bar * 1e5, seed)
        with Progress(console=Console(stderr=True, quiet=as_json)) as progress:
            bar = progress.add_task(name, total=1.0)
            shares = (
                _live(hand, commands, out, namespace) if live else record_offline(hand, commands, out, seed, storage)
            )
            for share in shares:
                progress.update(bar, completed=share)
    except (ValueError, OSError, ImportError, RuntimeError) as error:
        print(f"hand excite: {error}", file=sys.stderr)
        raise typer.Exit(2) from None
    if as_json:
        print(json.dumps({"experiment": name, "out": str(out), "samples": len(commands), "joints": wanted}))
    else:
        print(f"{name}: {len(commands)} samples of {len(wanted)} joints written to {out}")


def _live(hand: Hand, commands: Array, out: Path, namespace: str) -> Iterator[float]:
    """Drive a running hand with a recorder beside us."""
    from hand_tool.live_node import run_experiment  # noqa: PLC0415 - needs ROS

    with TemporaryDirectory() as logs, Processes(Path(logs)) as processes:
        names = ["--ros-args", "-r", f"__ns:=/{namespace.strip('/')}", "-p", f"out:={out.resolve()}"]
        processes.start("recorder", ["recorder", *names])
        yield from run_experiment(hand, commands, namespace, processes.check)
