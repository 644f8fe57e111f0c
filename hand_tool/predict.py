"""`hand predict`: a model on recordings that it was not fitted to."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hand_tool.chosen_model import choose_model
from hand_tool.console import require, running
from hand_tool.options import AsJson, Model, Quiet, Verbose
from hand_tool.origin import Origin
from hand_tool.paths import check_exists, check_file, check_folder

if TYPE_CHECKING:
    from hand_diagnosis.prediction import Prediction

LINES = 14


def predict(
    *,
    recordings: Annotated[
        list[Path], typer.Argument(help="As of hand diagnose; not those that the model was fitted to.")
    ],
    model: Model = None,
    mapping: Annotated[
        Path | None, typer.Option("--map", help="YAML that names the columns of a CSV or Parquet of a hand.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for prediction.json and prediction.html.")] = None,
    joints: Annotated[str, typer.Option(help="Comma-separated joints. Default: all that move.")] = "",
    sensor_curve: Annotated[
        bool | None,
        typer.Option(help="Angles are readings of the described Hall sensors. Default: what fits better."),
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Simulate recordings with a model as it is, and compare its errors with the noise.

    The model is hand.yaml, a machine file, or the model.yaml that hand diagnose wrote for either.

    Example: hand predict other_run.mcap --model out/diagnosis/model.yaml --out out/prediction

    Exit codes: 0 done, 2 bad usage or a recording or model that cannot be used.
    """
    files = [out / name for name in ("prediction.json", "prediction.html")] if out is not None else []
    with running("predict", *files) as outputs:
        for path in recordings:
            check_exists(path)
        if mapping is not None:
            require("pyarrow")
            check_file(mapping)
        if out is not None:
            check_folder(out)
        chosen = choose_model(model)
        origin = Origin(chosen)
        wanted = [name.strip() for name in joints.split(",") if name.strip()]
        result = _predict(recordings, chosen.path, mapping, wanted, sensor_curve)
        chosen.print(as_json)
        from hand_diagnosis.prediction import document

        content = document(result, [str(path) for path in recordings], str(chosen.path))
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
            files[0].write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
            outputs.complete(files[0])
            from hand_diagnosis.pages.prediction_page import write_page

            write_page(result, content, out, origin.of_page())
    print(json.dumps(content | {"model_file": chosen.as_json()}) if as_json else "\n".join(_summary(content, out)))


def _predict(
    recordings: list[Path], model: Path, mapping: Path | None, joints: list[str], sensor_curve: bool | None
) -> Prediction:
    from hand_diagnosis.prediction import predict as run
    from hand_machine.description import is_machine_file

    if is_machine_file(model):
        for option, given in (("--map", mapping), ("--joints", joints), ("--sensor-curve", sensor_curve is not None)):
            if given:
                raise ValueError(f"{option} cannot be used with a machine file ({model})")
        from hand_machine.machine import load_machine

        machine = load_machine(model, recordings)
        return run(machine.signals, machine.model, wording=machine.wording)
    from hand_diagnosis import read_recording
    from hand_model.description import load_hand

    hand = load_hand(model)
    signals = [read_recording(path, hand, mapping=mapping) for path in recordings]
    return run(signals, hand, joints=joints, sensor_curve=sensor_curve)


def _summary(content: dict[str, Any], out: Path | None) -> list[str]:
    """At most LINES lines: the largest errors against the noise first."""
    rows = sorted(content["scores"], key=lambda row: -(row["noise_floors"] or 0.0))
    lines = [_line(row, len(content["recordings"]) > 1) for row in rows]
    last = [f"not predicted: {row['joint']} ({row['reason']})" for row in content["not_judged"][:2]]
    last += [f"note: {line}" for line in content["data_check"][:3]]
    if out is not None:
        last.append(f"written: {out / 'prediction.html'}, {out / 'prediction.json'}")
    room = LINES - len(last)
    if len(lines) > room:
        lines = [*lines[: room - 1], f"and {len(lines) - room + 1} smaller errors"]
    return (lines or ["no signal could be predicted"]) + last


def _line(row: dict[str, Any], several: bool) -> str:
    name = f"{row['recording']}: " if several else ""
    floors = "" if row["noise_floors"] is None else f", {row['noise_floors']:.3g} times the noise floor"
    share = "" if row["explained"] is None else f"; {row['explained']:.2%} of the variance is predicted"
    return f"{name}{row['joint']} {row['signal']}: {row['rmse']:.3g} {row['unit']} RMS{floors}{share}"
