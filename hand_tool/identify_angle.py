"""`hand identify angle`: calibration of a Hall angle sensor from a rig."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from hand_identification.angle_calibration import calibrate_angle
from hand_recording.rig_file import read_rig


def angle(
    rig: Annotated[Path, typer.Argument(help="CSV with the columns angle_deg (reference) and voltage_v.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the outcome as JSON.")] = False,
) -> None:
    """Calibrate a Hall angle sensor: a two-point line, a sine or harmonics, whichever the data ask for.

    Example: hand identify angle rig.csv

    Exit codes: 0 done, 2 bad usage or a file that cannot be used.
    """
    try:
        columns = read_rig(rig, ("angle_deg", "voltage_v"))
        found = calibrate_angle(columns["angle_deg"], columns["voltage_v"])
    except (ValueError, OSError) as error:
        text = str(error)
        print(f"hand identify angle: {text if str(rig) in text else f'{rig}: {text}'}", file=sys.stderr)
        raise typer.Exit(2) from None
    if as_json:
        print(json.dumps(asdict(found)))
        return
    print(f"model {found.model}: {', '.join(f'{x:.6g}' for x in found.numbers)}")
    print(f"residual {found.rms_deg:.3f} degree RMS, {found.largest_deg:.3f} at most")
    print(f"valid from {found.low_v:g} to {found.high_v:g} V; no angle outside")
    for model, left_out in found.held_out_deg.items():
        print(f"  {model:9s} {left_out:.3f} degree RMS on samples left out of the fit")
