"""`hand magnet`: design of the Hall sensor's magnet for linearity."""

from __future__ import annotations

import csv
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from hand_tool.validation_extra import needs_validation

if TYPE_CHECKING:
    from validation.magnet.contour import Optimum


def magnet(
    out: Annotated[Path, typer.Option(help="Folder for contours, figure and results.json.")],
    method: Annotated[str, typer.Option(help="ga, cmaes or both.")] = "both",
    budget: Annotated[int, typer.Option(help="Field evaluations a method.")] = 1000,
    seed: Annotated[int, typer.Option(help="Of the search.")] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the outcome as JSON.")] = False,
) -> None:
    """Shape a ring magnet so that its field is straight over the joint's range, by Eq. 4 and finite elements.

    Example: hand magnet --out out/magnet --budget 500

    Exit codes: 0 done, 2 bad usage or bad input.
    """
    with needs_validation("magnet"):
        from validation.magnet.contour import METHODS, optimise  # noqa: PLC0415 - a robot need not have it
        from validation.paper.fig06 import draw  # noqa: PLC0415 - as above

    try:
        if method not in (*METHODS, "both"):
            raise ValueError(f"--method is {method!r}; it must be one of {', '.join((*METHODS, 'both'))}")
        if not 30 <= budget <= 100_000:
            raise ValueError(f"--budget is {budget}; the allowed range is 30 to 100000")
        out.mkdir(parents=True, exist_ok=True)
        methods = METHODS if method == "both" else (method,)
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        with Progress(*columns, console=Console(stderr=True, quiet=as_json)) as progress:
            found = []
            for name in methods:
                bar = progress.add_task(name, total=budget)
                found.append(optimise(name, budget, seed, lambda n, bar=bar: progress.advance(bar, n)))  # type: ignore[misc]
        results = [_result(one) for one in found]
        (out / "results.json").write_text(json.dumps(results, indent=2) + "\n", encoding="utf-8")
        for one in found:
            _write_contour(one, out / f"contour_{one.method}.csv")
        draw(found).savefig(out / "magnet.png", dpi=130)
    except (ValueError, OSError, ImportError) as error:
        print(f"hand magnet: {error}", file=sys.stderr)
        raise typer.Exit(2) from None
    if as_json:
        print(json.dumps(results))
        return
    for result in results:
        narrow, wide = result["nonlinearity_percent"]
        ring = "{:.4f} / {:.4f} %".format(*result["ring_nonlinearity_percent"])
        print(f"{result['method']}: position error {result['largest_error_deg']:.2f} degree at most")
        print(f"  nonlinearity {narrow:.4f} / {wide:.4f} %, the round ring's {ring} (0 to 90 / -10 to 100 degrees)")
    print(f"written: {out / 'magnet.png'}, {out / 'results.json'}, a contour a method")


def _result(one: Optimum) -> dict[str, Any]:
    from validation.magnet.contour import magnet_of  # noqa: PLC0415 - as above
    from validation.magnet.field import radial_field  # noqa: PLC0415 - as above
    from validation.magnet.linearity import joint_nonlinearity, position_error_deg  # noqa: PLC0415 - as above

    angle, field = radial_field(magnet_of(one.genes_m))
    ring = radial_field(magnet_of(np.zeros_like(one.genes_m)))
    error = position_error_deg(angle, field)[1]
    return {
        "method": one.method,
        "evaluations": len(one.history_deg),
        "largest_error_deg": float(np.abs(error).max()),
        "rms_error_deg": float(np.sqrt(np.mean(error**2))),
        "nonlinearity_percent": joint_nonlinearity(angle, field),
        "ring_nonlinearity_percent": joint_nonlinearity(*ring),
        "ring_error_deg": float(np.abs(position_error_deg(*ring)[1]).max()),
        "genes_mm": (one.genes_m * 1e3).round(5).tolist(),
    }


def _write_contour(one: Optimum, path: Path) -> None:
    from validation.magnet.contour import contour_m  # noqa: PLC0415 - as above

    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(("angle_deg", "radius_mm"))
        writer.writerows((k, round(float(r) * 1e3, 5)) for k, r in enumerate(contour_m(one.genes_m)))
