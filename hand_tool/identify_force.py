"""`hand identify force`: calibration of a force sensing resistor from a rig."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from hand_tool.console import running
from hand_tool.options import AsJson, Quiet, Verbose
from hand_tool.paths import check_file


def force(
    rig: Annotated[Path, typer.Argument(help="CSV with the columns force_n and voltage_v.")],
    divider_ohm: Annotated[float, typer.Option(help="Resistor R_D of the divider, Eq. 5.")] = 2.7e4,
    supply_v: Annotated[float, typer.Option(help="Supply voltage U_0 of the divider.")] = 5.0,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Calibrate a force sensing resistor against a scale: a third-order polynomial from log R to log F.

    Example: hand identify force rig.csv --divider-ohm 27000

    Exit codes: 0 done, 2 bad usage or a file that cannot be used.
    """
    with running("identify force", about=rig):
        check_file(rig)
        from hand_identification.force_calibration import calibrate_force
        from hand_recording.table_file import read_rig

        columns = read_rig(rig, ("force_n", "voltage_v"))
        found = calibrate_force(columns["force_n"], columns["voltage_v"], supply_v, divider_ohm)
    if as_json:
        print(json.dumps(asdict(found)))
        return
    terms = " + ".join(f"{c:.6g} x^{k}" for k, c in enumerate(found.coefficients))
    print(f"log10 F = {terms}, x = log10 R_S")
    print(f"residual {found.rms_n:.3g} N RMS, {found.largest_n:.3g} N at most, relative {found.relative_rms:.2%}")
    print(f"valid from {found.low_n:.3g} to {found.high_n:.3g} N; no force is given outside")
    print(f"the resistance is then {found.low_ohm:.4g} to {found.high_ohm:.4g} ohm")
    print(f"straight line of Eq. 5 for hand.yaml: c0 {found.c0:.4f}, c1 {found.c1:.4f}")
