"""`hand simulate`: a recording's valve commands through the offline plant."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import Progress, TimeElapsedColumn

from hand_model.description import load_hand
from hand_recording.installed import default_model
from hand_recording.loader import Recording, load_recording
from hand_recording.replay import Replay, replay_recording, write_replay
from hand_tool.replay_difference import difference_deg


def simulate(
    recording: Annotated[Path, typer.Argument(help="A rosbag2 folder or .mcap/.db3 file.")],
    out: Annotated[Path, typer.Option(help="New folder, or NAME.mcap for one bare file.")],
    model: Annotated[Path | None, typer.Option(help="hand.yaml to simulate. Default: the installed one.")] = None,
    storage: Annotated[str, typer.Option(help="mcap or sqlite3.")] = "mcap",
    seed: Annotated[int | None, typer.Option(help="Add sensor noise from this seed. Default: no noise.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the outcome as JSON.")] = False,
) -> None:
    """Replay a recording's valve commands through the simulated hand and write the same topics.

    Example: hand simulate out/demo/recording.mcap --model config/hand.yaml --out sim.mcap

    Exit codes: 0 done, 2 bad usage or a recording or model that cannot be used.
    """
    console = Console(stderr=True, quiet=as_json)
    try:
        loaded = load_recording(recording)
        result = replay_recording(loaded, load_hand(model or default_model()))
        with Progress(*Progress.get_default_columns(), TimeElapsedColumn(), console=console) as progress:
            bar = progress.add_task("writing", total=1.0)
            for share in write_replay(result, out, storage, seed):
                progress.update(bar, completed=share)
    except (ValueError, OSError) as error:
        print(f"hand simulate: {error}", file=sys.stderr)
        raise typer.Exit(2) from None
    _report(result, loaded, out, as_json)


def _report(result: Replay, loaded: Recording, out: Path, as_json: bool) -> None:
    rms = difference_deg(loaded, result)
    if as_json:
        print(json.dumps({"out": str(out), "frames": len(result.states), "replay_rms_deg": rms}))
        return
    worst = max(rms, key=lambda joint: np.nan_to_num(rms[joint]))
    print(f"{len(result.states)} frames written to {out}; largest difference {rms[worst]:.3f} degree RMS at {worst}")
