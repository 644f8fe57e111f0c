"""`hand simulate`: the valve commands of a recording through the offline plant."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hand_tool.chosen_model import ChosenModel, choose_model
from hand_tool.console import progress_bar, running
from hand_tool.options import AsJson, Model, Quiet, Verbose
from hand_tool.paths import check_exists, check_new

if TYPE_CHECKING:
    from hand_recording.loader import Recording
    from hand_recording.replay import Replay


def simulate(
    *,
    recording: Annotated[Path, typer.Argument(help="A rosbag2 folder or .mcap/.db3 file.")],
    out: Annotated[Path, typer.Option(help="New folder, or NAME.mcap for one bare file.")],
    model: Model = None,
    storage: Annotated[str, typer.Option(help="mcap or sqlite3.")] = "mcap",
    seed: Annotated[int | None, typer.Option(help="Add sensor noise from this seed. Default: no noise.")] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Replay the valve commands of a recording through the simulated hand and write the same topics.

    Example: hand simulate out/demo/recording.mcap --model config/hand.yaml --out sim.mcap

    Exit codes: 0 done, 2 bad usage or a recording or model that cannot be used.
    """
    with running("simulate", out) as outputs:
        check_exists(recording)
        check_new(out)
        chosen = choose_model(model)
        from hand_model.description import load_hand
        from hand_recording.loader import load_recording
        from hand_recording.replay import replay_recording, write_replay
        from hand_robot.urdf import description_text

        hand = load_hand(chosen.path)
        loaded = load_recording(recording)
        chosen.print(as_json)
        result = replay_recording(loaded, hand)
        with progress_bar(as_json) as progress:
            bar = progress.add_task("writing", total=1.0)
            for share in write_replay(result, out, storage, seed, description_text(hand)):
                progress.update(bar, completed=share)
        outputs.complete(out)
        _report(result, loaded, out, chosen, as_json)


def _report(result: Replay, loaded: Recording, out: Path, chosen: ChosenModel, as_json: bool) -> None:
    import numpy as np

    from hand_tool.replay_difference import difference_deg

    rms = difference_deg(loaded, result)
    frames, recorded = len(result.states), len(np.unique(loaded["joint_states"].stamp_ns))
    if as_json:
        counts = {"frames": frames, "recorded_frames": recorded}
        print(json.dumps({"out": str(out), **counts, "replay_rms_deg": rms, "model_file": chosen.as_json()}))
        return
    worst = max(rms, key=lambda joint: np.nan_to_num(rms[joint]))
    difference = f"the largest difference is {rms[worst]:.3f} degree RMS at {worst}"
    print(f"{frames} of {recorded} frames written to {out}; {difference}")
