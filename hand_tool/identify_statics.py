"""`hand identify statics`: the torque map of Eq. 6 from a rig recording."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hand_tool.console import running
from hand_tool.identify_write import check_target, print_written, write_into, written_entries
from hand_tool.options import AsJson, Quiet, Verbose
from hand_tool.paths import check_exists, check_folder

if TYPE_CHECKING:
    from hand_identification.static_map import StaticMap, VolumeMap
    from hand_model.arrays import Array

BAGS = {".mcap", ".db3"}


def statics(
    *,
    rig: Annotated[
        Path, typer.Argument(help="CSV (pressure_pa, angle_deg, torque_nm, volume_m3) or a rosbag2 recording.")
    ],
    joint: Annotated[
        str,
        typer.Option(
            help="Joint to take from a rosbag2 recording (its effort is the torque), or to change by --write."
        ),
    ] = "",
    out: Annotated[Path | None, typer.Option(help="Folder for statics.json and the residual map.")] = None,
    write: Annotated[
        Path | None,
        typer.Option(help="Write a0 to a3 of --joint into this hand.yaml, show the difference; comments stay."),
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Regress a0 to a3 of Eq. 6 with standard errors, and the volume map where volume_m3 was measured.

    A verdict follows where the data show an absolute pressure, a wrong sign or unit, or fail virtual work; such
    numbers are not written.

    Example: hand identify statics rig.csv --out out/statics

    Exit codes: 0 done, 2 bad usage or a file that cannot be used.
    """
    files = [] if out is None else [out / "statics.json", out / "residual_map.png"]
    with running("identify statics", *files, about=rig) as outputs:
        check_exists(rig)
        if out is not None:
            check_folder(out)
        chosen = check_target(write, joint, "--joint", "the joint of the description whose numbers change")
        import numpy as np

        from hand_identification.static_map import TERMS, identify_statics, identify_volume
        from hand_identification.statics_verdict import verdicts

        columns = _columns(rig, joint)
        pressure, angle, torque = columns["pressure_pa"], np.radians(columns["angle_deg"]), columns["torque_nm"]
        found = identify_statics(pressure, angle, torque)
        volume = identify_volume(pressure, angle, columns["volume_m3"], found) if "volume_m3" in columns else None
        verdict = verdicts(found, volume, pressure, angle, torque)
        document = _document(found, volume) | {"verdict": list(verdict)}
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
            files[0].write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
            outputs.complete(files[0])
            _figure(found, pressure, angle, torque, files[1])
        diff = ""
        if write is not None:
            if verdict:
                raise ValueError(f"nothing is written to {write}: {verdict[0]}")
            values, errors = (
                {joint: {f"statics.{term}": float(x) for term, x in zip(TERMS, numbers, strict=True)}}
                for numbers in (found.values, found.errors)
            )
            diff = write_into(write, values, f"Eq. 6 of {joint} identified from {rig.name}.", errors)
    if as_json:
        print(json.dumps(document | written_entries(chosen, diff)))
        return
    _print(found, volume)
    for line in verdict or ("plausible: signs, units and pressure reference fit an actuator",):
        print(f"verdict: {line}")
    print_written(chosen, diff)


def _columns(rig: Path, joint: str) -> dict[str, Array]:
    """Columns, each (n,), by name; the effort of a recorded joint is the torque."""
    import numpy as np

    from hand_recording.loader import load_recording
    from hand_recording.recording_files import RecordingError
    from hand_recording.table_file import read_rig

    if rig.is_dir() or rig.suffix in BAGS:
        recording = load_recording(rig)
        base = recording.on_time_base()
        if joint not in base.joints:
            raise RecordingError(f"{rig}: --joint is {joint!r}; the recording has: {', '.join(base.joints)}")
        j = base.joints.index(joint)
        table = np.array([base.pressure[:, j], np.degrees(base.position[:, j]), base.effort[:, j]])
        table = table[:, np.isfinite(table).all(axis=0)]
        return dict(zip(("pressure_pa", "angle_deg", "torque_nm"), table, strict=True))
    return read_rig(rig, ("pressure_pa", "angle_deg", "torque_nm"), ("volume_m3",))


def _document(found: StaticMap, volume: VolumeMap | None) -> dict[str, object]:
    from hand_identification.static_map import TERMS

    document: dict[str, object] = {
        "parameters": {
            term: {"value": float(value), "std": float(error)}
            for term, value, error in zip(TERMS, found.values, found.errors, strict=True)
        },
        "r2": found.r2,
        "rms_nm": found.rms_nm,
        "samples": found.samples,
        "independent_samples": found.independent,
        "warnings": list(found.warnings),
    }
    if volume is not None:
        document["volume"] = {
            "values": volume.values.tolist(),
            "std": volume.errors.tolist(),
            "r2": volume.r2,
            "displacement_over_a2": volume.displacement_over_a2,
            "curvature_over_half_a3": volume.curvature_over_half_a3,
        }
    return document


def _print(found: StaticMap, volume: VolumeMap | None) -> None:
    from rich.console import Console
    from rich.table import Table

    from hand_identification.static_map import TERMS

    table = Table("parameter", "value", "std", title="Eq. 6: M = a0 + a1 phi + a2 p + a3 p phi")
    for term, value, error in zip(TERMS, found.values, found.errors, strict=True):
        table.add_row(term, f"{value:.5g}", f"{error:.2g}")
    Console().print(table)
    samples = f"{found.samples} samples ({found.independent:.0f} independent)"
    print(f"R^2 {found.r2:.5f}, residual {found.rms_nm:.3g} N m RMS, {samples}")
    for line in found.warnings:
        print(f"warning: {line}")
    if volume is not None:
        v = volume.values
        print(f"V = {v[0]:.4g} + {v[1]:.4g} p + {v[2]:.4g} phi + {v[3]:.4g} phi^2 m^3, R^2 {volume.r2:.4f}")
        ratios = f"{volume.displacement_over_a2:.3f} of a2, curvature {volume.curvature_over_half_a3:.3f} of a3/2"
        print(f"virtual work: dV/dphi is {ratios} (1 agrees)")


def _figure(found: StaticMap, pressure: Array, angle: Array, torque: Array, path: Path) -> None:
    import matplotlib
    import numpy as np

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    from hand_identification.static_map import residual_map

    p_edges, phi_edges, means = residual_map(found, pressure, angle, torque)
    figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
    limit = float(np.nanmax(np.abs(means))) or 1.0
    image = axes.pcolormesh(
        np.degrees(phi_edges), p_edges * 1e-5, 1e3 * means, cmap="RdBu", vmin=-1e3 * limit, vmax=1e3 * limit
    )
    figure.colorbar(image, label="mean residual [mN m]")
    axes.set(xlabel="angle [deg]", ylabel="pressure [bar]", title="torque rig minus Eq. 6")
    figure.savefig(path, dpi=120)
    plt.close(figure)
