"""`hand magnet`: design of the Hall sensor's magnet for linearity."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hand_tool.console import progress_bar, require, running
from hand_tool.options import AsJson, Quiet, Verbose
from hand_tool.paths import check_folder

if TYPE_CHECKING:
    from validation.magnet.contour import Optimum

METHODS = ("ga", "cmaes", "lsq")


def magnet(
    *,
    out: Annotated[Path, typer.Option(help="Folder for contours, figure and results.json.")],
    method: Annotated[str, typer.Option(help="ga (genetic algorithm), cmaes, lsq (least squares) or all.")] = "all",
    budget: Annotated[int, typer.Option(help="Field evaluations per method at most, 30 to 100000.")] = 1000,
    seed: Annotated[int, typer.Option(help="Seed of the search.")] = 0,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Shape a ring magnet so that its field is straight over the joint's range, by Eq. 4 and finite elements.

    Example: hand magnet --out out/magnet --budget 500

    Exit codes: 0 done, 2 bad usage or bad input.
    """
    methods = METHODS if method == "all" else (method,)
    numbers, figure = out / "results.json", out / "magnet.png"
    with running("magnet", numbers, figure) as outputs:
        if method not in (*METHODS, "all"):
            raise ValueError(f"--method is {method!r}; it must be one of {', '.join((*METHODS, 'all'))}")
        if not 30 <= budget <= 100_000:
            raise ValueError(f"--budget is {budget}; the allowed range is 30 to 100000")
        check_folder(out)
        require("validation", "skfem", "deap", "cma")
        from validation.magnet.contour import optimise
        from validation.paper.fig06 import draw

        out.mkdir(parents=True, exist_ok=True)
        found = []
        with progress_bar(as_json, counted=True) as progress:
            for name in methods:
                bar = progress.add_task(name, total=budget)
                found.append(optimise(name, budget, seed, lambda n, bar=bar: progress.advance(bar, n)))  # type: ignore[misc]
        results = [_result(optimum) for optimum in found]
        numbers.write_text(json.dumps(results, indent=2) + "\n", encoding="utf-8")
        outputs.complete(numbers)
        for optimum in found:
            _write_contour(optimum, out / f"contour_{optimum.method}.csv")
        draw(found).savefig(figure, dpi=130)
    if as_json:
        print(json.dumps(results))
        return
    for result in results:
        narrow, wide = result["nonlinearity_percent"]
        ring = "{:.4f} / {:.4f} %".format(*result["ring_nonlinearity_percent"])
        print(f"{result['method']}: position error {result['largest_error_deg']:.2f} degree at most")
        print(f"  nonlinearity {narrow:.4f} / {wide:.4f} %, the round ring's {ring} (0 to 90 / -10 to 100 degrees)")
    print(f"written: {out / 'magnet.png'}, {out / 'results.json'}, one contour per method")


def _result(optimum: Optimum) -> dict[str, Any]:
    import numpy as np

    from validation.magnet.contour import magnet_of
    from validation.magnet.field import radial_field
    from validation.magnet.linearity import joint_nonlinearity, position_error_deg

    angle, field = radial_field(magnet_of(optimum.genes_m))
    ring = radial_field(magnet_of(np.zeros_like(optimum.genes_m)))
    error = position_error_deg(angle, field)[1]
    return {
        "method": optimum.method,
        "evaluations": len(optimum.history_deg),
        "largest_error_deg": float(np.abs(error).max()),
        "rms_error_deg": float(np.sqrt(np.mean(error**2))),
        "nonlinearity_percent": joint_nonlinearity(angle, field),
        "ring_nonlinearity_percent": joint_nonlinearity(*ring),
        "ring_error_deg": float(np.abs(position_error_deg(*ring)[1]).max()),
        "genes_mm": (optimum.genes_m * 1e3).round(5).tolist(),
    }


def _write_contour(optimum: Optimum, path: Path) -> None:
    from validation.magnet.contour import contour_m

    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(("angle_deg", "radius_mm"))
        writer.writerows((k, round(float(r) * 1e3, 5)) for k, r in enumerate(contour_m(optimum.genes_m)))
