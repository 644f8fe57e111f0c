"""`hand identify dynamics`: valve, inertia, friction and creep of a joint from recordings."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hand_tool.chosen_model import choose_model
from hand_tool.console import progress_bar, running
from hand_tool.identify_write import print_written, write_into, written_entries
from hand_tool.options import AsJson, Model, Quiet, Verbose
from hand_tool.paths import check_exists, check_folder

if TYPE_CHECKING:
    from hand_identification.dynamics import JointDynamics
    from hand_model.description import Hand
    from hand_recording.signals import Signals


MOVES_DEG = 2.0
"""Range of a joint's angle above which it is identified without being named."""
NOT_DETERMINED = "not determined"
"""Verdict of a number that the recording does not determine; its standard error has no meaning."""


def dynamics(
    *,
    recordings: Annotated[list[Path], typer.Argument(help="rosbag2 folders or .mcap/.db3 files.")],
    out: Annotated[Path, typer.Option(help="Folder for model.yaml, dynamics.json and one figure per joint.")],
    model: Model = None,
    joints: Annotated[str, typer.Option(help="Comma-separated joints. Default: all that move.")] = "",
    statics: Annotated[bool, typer.Option("--statics", help="Fit a0 to a3 of Eq. 6, too.")] = False,
    sensor_curve: Annotated[
        bool, typer.Option(help="Remove the described Hall characteristic from the angles.")
    ] = True,
    write: Annotated[
        Path | None, typer.Option(help="Write the numbers into this hand.yaml, too, and show the difference.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the random starts.")] = 0,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Fit J, d, valve, then phi_max, p_min, b0 and both time constants by simulation error; write the patched model.

    Example: hand identify dynamics recording.mcap --model config/hand.yaml --out out/identified

    Exit codes: 0 done, 2 bad usage or a recording or model that cannot be used.
    """
    files = (out / "model.yaml", out / "dynamics.json")
    with running("identify dynamics", *files) as outputs:
        for path in recordings:
            check_exists(path)
        check_folder(out)
        changed = choose_model(write) if write is not None else None
        chosen = choose_model(model)
        from hand_identification.dynamics import DYNAMIC_KEYS, MATERIAL_KEYS, STATIC_KEYS, identify
        from hand_identification.model_file import write_model
        from hand_model.description import load_hand

        hand = load_hand(chosen.path)
        signals = _signals(recordings, hand, sensor_curve)
        wanted, resting = _joints(joints, hand, signals)
        chosen.print(as_json)
        keys = (*DYNAMIC_KEYS, *MATERIAL_KEYS, *(STATIC_KEYS if statics else ()))
        with progress_bar(as_json, counted=True) as progress:
            bar = progress.add_task("identifying", total=len(wanted))
            found = identify(signals, hand, wanted, keys, seed, lambda _: progress.advance(bar))
        names = ", ".join(path.name for path in recordings)
        comment = f"Identified from {names} with seed {seed}; nominal: {hand.path.name}."
        values = {result.joint: result.values() for result in found}
        resolutions = {result.joint: result.resolutions() for result in found}
        write_model(hand, values, files[0], comment, resolutions=resolutions)
        outputs.complete(files[0])
        files[1].write_text(json.dumps(_document(found), indent=2) + "\n", encoding="utf-8")
        outputs.complete(files[1])
        _draw(found, out)
        diff = write_into(write, values, comment, resolutions) if write is not None else ""
    if as_json:
        print(json.dumps(_document(found) | written_entries(changed, diff) | {"model_file": chosen.as_json()}))
        return
    _print(found, resting, out)
    print_written(changed, diff)


def _signals(recordings: list[Path], hand: Hand, sensor_curve: bool) -> list[Signals]:
    from hand_recording.hand_signals import hand_signals, without_sensor_curve
    from hand_recording.loader import load_recording

    signals = [hand_signals(load_recording(path), hand) for path in recordings]
    return [without_sensor_curve(recorded, hand) for recorded in signals] if sensor_curve else signals


def _joints(text: str, hand: Hand, signals: list[Signals]) -> tuple[list[str], list[str]]:
    """The joints to identify, and those that are left out because they do not move. ValueError, one line."""
    recorded = [joint for joint in hand.joints if any(joint in part.joints for part in signals)]
    wanted = [name.strip() for name in text.split(",") if name.strip()]
    for name in wanted:
        if name not in recorded:
            raise ValueError(f"--joints: {name!r} was not recorded; the recording has: {', '.join(recorded)}")
    if wanted:
        return wanted, []
    moving = [joint for joint in recorded if any(_travel_deg(part, joint) > MOVES_DEG for part in signals)]
    if not moving:
        raise ValueError(
            f"no joint moves by more than {MOVES_DEG:g} degrees; record steps with: hand excite steps --live"
        )
    return moving, [joint for joint in recorded if joint not in moving]


def _travel_deg(signals: Signals, joint: str) -> float:
    """The range of a joint's angle [degree]; 0 where it was not recorded."""
    import numpy as np

    if joint not in signals.joints:
        return 0.0
    angle = signals.angle_rad[:, signals.joints.index(joint)]
    return float(np.degrees(np.nanmax(angle) - np.nanmin(angle)))


def _document(found: list[JointDynamics]) -> dict[str, object]:
    from hand_model.kernel.rows import JOINT_PARAMETERS, ROW

    return {
        result.joint: {
            "parameters": {
                e.key: {
                    "value": e.value / JOINT_PARAMETERS[ROW[e.key]].scale,
                    "std": e.std / JOINT_PARAMETERS[ROW[e.key]].scale,
                    "verdict": e.verdict,
                    "record": e.record,
                }
                for e in result.estimates
            },
            "rmse_before": result.rmse_before,
            "rmse_after": result.rmse_after,
            "validation_after": result.validation_after,
        }
        for result in found
    }


def _print(found: list[JointDynamics], resting: list[str], out: Path) -> None:
    from rich.console import Console
    from rich.table import Table

    from hand_model.kernel.rows import JOINT_PARAMETERS, ROW

    console = Console()
    longest = max((len(e.key) for result in found for e in result.estimates), default=0)
    for result in found:
        errors_rad = (result.rmse_before.get("angle", float("nan")), result.validation_after.get("angle", float("nan")))
        before, after = (57.2958 * error for error in errors_rad)
        title = (
            f"{result.joint}: error of the angle {before:.3f} -> {after:.3f} degree RMS on data that were not fitted"
        )
        table = Table(title=title)
        table.add_column("parameter", no_wrap=True, min_width=longest)
        for column in ("value", "standard error", "verdict", "to determine it, record"):
            table.add_column(column)
        for e in result.estimates:
            scale = JOINT_PARAMETERS[ROW[e.key]].scale
            std = "" if e.verdict == NOT_DETERMINED else f"{e.std / scale:.2g}"
            table.add_row(e.key, f"{e.value / scale:.4g}", std, e.verdict, e.record)
        console.print(table)
    if resting:
        print(f"not identified, moved less than {MOVES_DEG:g} degrees: {', '.join(resting)}")
    print(f"written: {out / 'model.yaml'}, {out / 'dynamics.json'}, one figure per joint")


def _draw(found: list[JointDynamics], out: Path) -> None:
    """One figure per joint: the angle, measured and predicted, and the residual."""
    import matplotlib
    import numpy as np

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    for result in found:
        figure, axes = plt.subplots(2, 1, sharex=True, figsize=(9, 5), layout="constrained")
        segment, residual = result.problem.segments[0], result.fit.residuals[0]
        time_s = segment.period_s * np.arange(len(segment.angle_rad))
        axes[0].plot(time_s, np.degrees(segment.angle_rad), label="measured", lw=1.0)
        predicted = np.where(segment.use[1], segment.angle_rad - residual[1], np.nan)
        axes[0].plot(time_s, np.degrees(predicted), "--", label="identified model", lw=1.0)
        axes[0].set_ylabel("angle [deg]")
        axes[0].legend()
        axes[1].plot(time_s, np.degrees(residual[1]), lw=0.7)
        axes[1].set(xlabel="time [s]", ylabel="measured - model [deg]")
        axes[0].set_title(result.joint)
        figure.savefig(out / f"{result.joint}.png", dpi=120)
        plt.close(figure)
