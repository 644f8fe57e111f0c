"""`hand identify force`: calibration of a force sensing resistor from a rig."""

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
    from hand_identification.force_calibration import ForceCalibration


def force(
    *,
    rig: Annotated[Path, typer.Argument(help="CSV with the columns force_n and voltage_v.")],
    divider_ohm: Annotated[float, typer.Option(help="Resistor R_D of the divider, Eq. 5.")] = 2.7e4,
    supply_v: Annotated[float, typer.Option(help="Supply voltage U_0 of the divider.")] = 5.0,
    site: Annotated[str, typer.Option(help="Force site of the sensor, with --write.")] = "",
    write: Annotated[
        Path | None,
        typer.Option(help="Write the polynomial of --site into this hand.yaml, show the difference; comments stay."),
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Calibrate a force sensing resistor against a scale: a third-order polynomial from log R to log F.

    It is printed as lines of hand.yaml, too.

    Example: hand identify force rig.csv --divider-ohm 27000 --site index_distal_pad --write hand.yaml

    Exit codes: 0 done, 2 bad usage or a file that cannot be used.
    """
    with running("identify force", about=rig):
        check_file(rig)
        chosen = check_target(write, site, "--site", "the force site of the description whose sensor this is")
        from hand_identification.force_calibration import calibrate_force
        from hand_identification.sensor_file import polynomial_texts, write_polynomial
        from hand_recording.table_file import read_rig

        columns = read_rig(rig, ("force_n", "voltage_v"))
        found = calibrate_force(columns["force_n"], columns["voltage_v"], supply_v, divider_ohm)
        texts = polynomial_texts(found.coefficients)
        diff = ""
        if write is not None:
            comment = f"Force sensor of {site} calibrated from {rig.name}."
            diff = replaced(write, lambda trial: write_polynomial(write, site, texts, divider_ohm, trial, comment))
    if as_json:
        print(json.dumps(asdict(found) | written_entries(chosen, diff)))
        return
    _print(found, texts)
    print_written(chosen, diff)


def _print(found: ForceCalibration, texts: list[str]) -> None:
    terms = " + ".join(f"{c:.6g} x^{k}" for k, c in enumerate(found.coefficients))
    print(f"log10 F = {terms}, x = log10 R_S")
    print(f"residual {found.rms_n:.3g} N RMS, {found.largest_n:.3g} N at most, relative {found.relative_rms:.2%}")
    print(f"valid from {found.low_n:.3g} to {found.high_n:.3g} N; no force is given outside")
    print(f"the resistance is then {found.low_ohm:.4g} to {found.high_ohm:.4g} ohm")
    print(f"straight line of Eq. 5 for hand.yaml: c0 {found.c0:.4f}, c1 {found.c1:.4f}")
    print("the lines for the force site in hand.yaml:")
    print(f"    divider_ohm: {found.divider_ohm:g}")
    print(f"    calibration_log_polynomial: [{', '.join(texts)}]")
