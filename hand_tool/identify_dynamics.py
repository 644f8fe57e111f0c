"""`hand identify dynamics`: valve, inertia, friction and creep of a joint from recordings."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import matplotlib
import numpy as np
import typer
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from hand_identification.dynamics import DYNAMIC_KEYS, MATERIAL_KEYS, STATIC_KEYS, JointDynamics, identify
from hand_identification.model_file import write_model
from hand_model.description import Hand, load_hand
from hand_model.kernel.rows import JOINT_PARAMETERS, ROW
from hand_recording.hand_signals import hand_signals, without_sensor_curve
from hand_recording.installed import default_model
from hand_recording.loader import load_recording
from hand_recording.signals import Signals


def dynamics(
    recordings: Annotated[list[Path], typer.Argument(help="rosbag2 folders or .mcap/.db3 files.")],
    out: Annotated[Path, typer.Option(help="Folder for model.yaml, dynamics.json and a figure a joint.")],
    model: Annotated[Path | None, typer.Option(help="Nominal hand.yaml. Default: the installed one.")] = None,
    joints: Annotated[str, typer.Option(help="Comma-separated joints. Default: all that were recorded.")] = "",
    statics: Annotated[bool, typer.Option("--statics", help="Fit a0 ... a3 of Eq. 6, too.")] = False,
    sensor_curve: Annotated[
        bool, typer.Option(help="Take the described Hall characteristic back out of the angles.")
    ] = True,
    seed: Annotated[int, typer.Option(help="Of the random starts.")] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the outcome as JSON.")] = False,
) -> None:
    """Fit J, d, valve, then phi_max, p_min, b0 and both time constants by simulation error; write the patched model.

    Example: hand identify dynamics recording.mcap --model config/hand.yaml --out out/identified

    Exit codes: 0 done, 2 bad usage or a recording or model that cannot be used.
    """
    try:
        hand = load_hand(model or default_model())
        signals = [hand_signals(load_recording(path), hand) for path in recordings]
        if sensor_curve:
            signals = [without_sensor_curve(one, hand) for one in signals]
        wanted = _joints(joints, hand, signals)
        keys = (*DYNAMIC_KEYS, *MATERIAL_KEYS, *(STATIC_KEYS if statics else ()))
        with Progress(console=Console(stderr=True, quiet=as_json)) as progress:
            bar = progress.add_task("identifying", total=len(wanted))
            found = identify(signals, hand, wanted, keys, seed, lambda _: progress.advance(bar))
        names = ", ".join(path.name for path in recordings)
        comment = f"Identified from {names} with seed {seed}; nominal: {hand.path.name}."
        values = {result.joint: result.values() for result in found}
        resolutions = {result.joint: result.resolutions() for result in found}
        write_model(hand, values, out / "model.yaml", comment, resolutions=resolutions)
    except (ValueError, OSError) as error:
        print(f"hand identify dynamics: {error}", file=sys.stderr)
        raise typer.Exit(2) from None
    _write(found, out)
    if as_json:
        print(json.dumps(_document(found)))
    else:
        _print(found, out)


def _joints(text: str, hand: Hand, signals: list[Signals]) -> list[str]:
    recorded = [joint for joint in hand.joints if any(joint in one.joints for one in signals)]
    wanted = [name.strip() for name in text.split(",") if name.strip()]
    for name in wanted:
        if name not in recorded:
            raise ValueError(f"--joints: {name!r} was not recorded; the recording has: {', '.join(recorded)}")
    return wanted or recorded


def _document(found: list[JointDynamics]) -> dict[str, object]:
    return {
        one.joint: {
            "parameters": {
                e.key: {
                    "value": e.value / JOINT_PARAMETERS[ROW[e.key]].scale,
                    "std": e.std / JOINT_PARAMETERS[ROW[e.key]].scale,
                    "verdict": e.verdict,
                    "record": e.record,
                }
                for e in one.estimates
            },
            "rmse_before": one.rmse_before,
            "rmse_after": one.rmse_after,
            "held_out_after": one.held_out_after,
        }
        for one in found
    }


def _print(found: list[JointDynamics], out: Path) -> None:
    console = Console()
    for one in found:
        before, after = (57.2958 * rmse.get("angle", float("nan")) for rmse in (one.rmse_before, one.held_out_after))
        table = Table(title=f"{one.joint}: angle {before:.3f} -> {after:.3f} degree RMS on held-out data")
        for column in ("parameter", "value", "std", "verdict", "to determine it, record"):
            table.add_column(column)
        for e in one.estimates:
            scale = JOINT_PARAMETERS[ROW[e.key]].scale
            table.add_row(e.key, f"{e.value / scale:.5g}", f"{e.std / scale:.2g}", e.verdict, e.record)
        console.print(table)
    print(f"written: {out / 'model.yaml'}, {out / 'dynamics.json'}, a figure a joint")


def _write(found: list[JointDynamics], out: Path) -> None:
    (out / "dynamics.json").write_text(json.dumps(_document(found), indent=2) + "\n", encoding="utf-8")
    matplotlib.use("Agg")
    from matplotlib import pyplot as plt  # noqa: PLC0415 - after the backend is chosen

    for one in found:
        figure, axes = plt.subplots(2, 1, sharex=True, figsize=(9, 5), layout="constrained")
        segment, residual = one.problem.segments[0], one.fit.residuals[0]
        time_s = segment.period_s * np.arange(len(segment.angle_rad))
        axes[0].plot(time_s, np.degrees(segment.angle_rad), label="measured", lw=1.0)
        predicted = np.where(segment.use[1], segment.angle_rad - residual[1], np.nan)
        axes[0].plot(time_s, np.degrees(predicted), "--", label="identified model", lw=1.0)
        axes[0].set_ylabel("angle [deg]")
        axes[0].legend()
        axes[1].plot(time_s, np.degrees(residual[1]), lw=0.7)
        axes[1].set(xlabel="time [s]", ylabel="measured - model [deg]")
        axes[0].set_title(one.joint)
        figure.savefig(out / f"{one.joint}.png", dpi=120)
        plt.close(figure)
