"""`hand identify angle`: calibration of a Hall angle sensor from a rig."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from hand_tool.console import running
from hand_tool.options import AsJson, Quiet, Verbose
from hand_tool.paths import check_file


def angle(
    rig: Annotated[Path, typer.Argument(help="CSV with the columns angle_deg (reference) and voltage_v.")],
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Calibrate a Hall angle sensor by a two-point line, a sine or harmonics, whichever predicts best.

    Example: hand identify angle rig.csv

    Exit codes: 0 done, 2 bad usage or a file that cannot be used.
    """
    with running("identify angle", about=rig):
        check_file(rig)
        from hand_identification.angle_calibration import calibrate_angle
        from hand_recording.table_file import read_rig

        columns = read_rig(rig, ("angle_deg", "voltage_v"))
        found = calibrate_angle(columns["angle_deg"], columns["voltage_v"])
    if as_json:
        print(json.dumps(asdict(found)))
        return
    print(f"model {found.model}: {', '.join(f'{x:.6g}' for x in found.numbers)}")
    print(f"residual {found.rms_deg:.3f} degree RMS, at most {found.largest_deg:.3f} degree")
    print(f"valid from {found.low_v:g} to {found.high_v:g} V; no angle is given outside")
    for model, error_deg in found.validation_deg.items():
        print(f"  {model:9s} {error_deg:.3f} degree RMS on samples that were left out of the fit")
