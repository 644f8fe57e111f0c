"""`hand excite`: an experiment on the simulated hand, or on a running driver, recorded."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from hand_tool import interrupts
from hand_tool.chosen_model import choose_model
from hand_tool.console import progress_bar, running
from hand_tool.options import AsJson, Model, Quiet, Verbose
from hand_tool.paths import check_new

if TYPE_CHECKING:
    from hand_model.arrays import Array
    from hand_model.description import Hand

NAMES = (
    "staircase", "slow_triangle", "steps", "multisine", "chirp", "hold", "free_decay", "closed_valve_push",
    "reversals", "taps",
)  # fmt: skip
"""The experiments of hand_identification.excitation, for the help text; a test compares them."""


def excite(
    *,
    name: Annotated[str, typer.Argument(help=f"The experiment: {', '.join(NAMES)}.")],
    out: Annotated[Path, typer.Option(help="New recording: a folder, or NAME.mcap for one bare file.")],
    joints: Annotated[str, typer.Option(help="Comma-separated joints. Default: all.")] = "",
    duration: Annotated[float, typer.Option(help="Length in s, 2 to 3600.")] = 60.0,
    max_pressure_bar: Annotated[float, typer.Option(help="Highest set-point in bar (gauge).")] = 4.0,
    model: Model = None,
    live: Annotated[bool, typer.Option("--live", help="Drive a running driver or simulation node by topics.")] = False,
    namespace: Annotated[str, typer.Option(help="Namespace of the running hand, with --live.")] = "hand",
    storage: Annotated[str, typer.Option(help="mcap or sqlite3.")] = "mcap",
    seed: Annotated[int, typer.Option(help="Seed of random levels and, offline, of sensor noise.")] = 0,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Run an experiment within the limits of pressure, torque and angle and record it; offline without --live.

    Example: hand excite slow_triangle --joints index_proximal --out triangle.mcap

    With --live the controller must not run; the hand is vented at the end and on Ctrl-C.

    Exit codes: 0 done, 2 bad usage, bad input or no running hand.
    """
    with running("excite", out, errors=(RuntimeError,)) as outputs:
        if name not in NAMES:
            raise ValueError(f"experiment is {name!r}; it must be one of {', '.join(NAMES)}")
        check_new(out)
        chosen = choose_model(model)
        from hand_identification.excitation import set_points
        from hand_model.description import load_hand
        from hand_recording.replay import record_offline
        from hand_robot.urdf import description_text

        hand = load_hand(chosen.path)
        if not 0.0 < max_pressure_bar * 1e5 <= hand.supply_pressure_pa:
            top = hand.supply_pressure_pa * 1e-5
            raise ValueError(f"--max-pressure-bar is {max_pressure_bar:g}; the allowed range is above 0 to {top:g}")
        wanted = [joint.strip() for joint in joints.split(",") if joint.strip()] or list(hand.joints)
        commands = set_points(name, hand, wanted, duration, max_pressure_bar * 1e5, seed)
        chosen.print(as_json)
        if live:
            interrupts.release()  # Ctrl-C must vent the hand and close the recording
        with progress_bar(as_json) as progress:
            bar = progress.add_task(name, total=1.0)
            if live:
                shares = _live(hand, commands, out, namespace)
            else:
                shares = record_offline(hand, commands, out, seed, storage, description_text(hand))
            for share in shares:
                progress.update(bar, completed=share)
        outputs.complete(out)
    if as_json:
        outcome = {"experiment": name, "out": str(out), "samples": len(commands), "joints": wanted}
        print(json.dumps(outcome | {"model_file": chosen.as_json()}))
    else:
        print(f"{name}: {len(commands)} samples of {len(wanted)} joints written to {out}")


def _live(hand: Hand, commands: Array, out: Path, namespace: str) -> Iterator[float]:
    """Drive a running hand while a recorder process records it."""
    from hand_tool.live_node import run_experiment
    from hand_tool.processes import Processes

    with TemporaryDirectory() as logs, Processes(Path(logs)) as processes:
        names = ["--ros-args", "-r", f"__ns:=/{namespace.strip('/')}", "-p", f"out:={out.resolve()}"]
        processes.start("recorder", ["recorder", *names])
        yield from run_experiment(hand, commands, namespace, processes.check)
