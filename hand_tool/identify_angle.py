"""`hand identify angle`: calibration of a Hall angle sensor from a rig."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hand_tool.console import running
from hand_tool.identify_write import check_target, print_written, replaced, written_entries
from hand_tool.options import AsJson, Quiet, Verbose
from hand_tool.paths import check_file

if TYPE_CHECKING:
    from hand_identification.angle_calibration import AngleCalibration


def angle(
    *,
    rig: Annotated[Path, typer.Argument(help="CSV with the columns angle_deg (reference) and voltage_v.")],
    supply_v: Annotated[float, typer.Option(help="Supply voltage U_0 of the sensor on the rig.")] = 5.0,
    joint: Annotated[str, typer.Option(help="Joint of the sensor, with --write.")] = "",
    write: Annotated[
        Path | None,
        typer.Option(help="Write the line of --joint into this hand.yaml, show the difference; comments stay."),
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Calibrate a Hall angle sensor by a two-point line, a sine or harmonics, whichever predicts best.

    A description holds the two-point line, which is printed as lines of hand.yaml, too.

    Example: hand identify angle rig.csv --joint index_proximal --write hand.yaml

    Exit codes: 0 done, 2 bad usage or a file that cannot be used.
    """
    with running("identify angle", about=rig):
        check_file(rig)
        chosen = check_target(write, joint, "--joint", "the joint of the description whose sensor this is")
        if not 1.0 <= supply_v <= 10.0:
            raise ValueError(f"--supply-v is {supply_v:g}; the allowed range is 1 to 10 V")
        from hand_identification.angle_calibration import calibrate_angle
        from hand_identification.sensor_file import line_texts, write_line
        from hand_recording.table_file import read_rig

        columns = read_rig(rig, ("angle_deg", "voltage_v"))
        found = calibrate_angle(columns["angle_deg"], columns["voltage_v"])
        texts, reason = {}, ""
        try:
            texts = line_texts((found.volts_at_0_deg, found.volts_at_90_deg), supply_v)
        except ValueError as error:
            reason = str(error)
        diff = ""
        if write is not None:
            if reason:
                raise ValueError(f"nothing is written to {write}: {reason}")
            comment = f"Angle sensor of {joint} calibrated from {rig.name}."
            diff = replaced(write, lambda trial: write_line(write, joint, texts, trial, comment))
    if as_json:
        line = {key: float(text) for key, text in texts.items()}
        print(json.dumps(asdict(found) | line | written_entries(chosen, diff)))
        return
    _print(found, texts, reason)
    print_written(chosen, diff)


def _print(found: AngleCalibration, texts: dict[str, str], reason: str) -> None:
    print(f"model {found.model}: {', '.join(f'{x:.6g}' for x in found.numbers)}")
    print(f"residual {found.rms_deg:.3f} degree RMS, at most {found.largest_deg:.3f} degree")
    print(f"valid from {found.low_v:g} to {found.high_v:g} V; no angle is given outside")
    for model, error_deg in found.validation_deg.items():
        print(f"  {model:9s} {error_deg:.3f} degree RMS on samples that were left out of the fit")
    if reason:
        print(f"no line for hand.yaml: {reason}")
        return
    print("the line for the joint in hand.yaml:")
    print("    angle_sensor:")
    print(f"      calibration: {{{', '.join(f'{key}: {text}' for key, text in texts.items())}}}")
