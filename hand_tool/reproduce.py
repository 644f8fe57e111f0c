"""`hand reproduce`: the paper's figures and tables from this stack's own code."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hand_tool import interrupts
from hand_tool.chosen_model import choose_model
from hand_tool.console import progress_bar, require, running
from hand_tool.options import AsJson, Quiet, Verbose
from hand_tool.origin import Origin
from hand_tool.paths import check_folder

if TYPE_CHECKING:
    from validation.paper.result import Reproduction

NAMES = ("table1", "fig06", "fig07", "fig08", "fig09", "fig10", "fig13", "fig14", "prony")
"""The figures and tables of validation.paper.result, for the help text; a test compares them."""
WORKERS = 2


def reproduce(
    out: Annotated[Path, typer.Option(help="Folder for the PNGs, index.html and results.json.")],
    only: Annotated[list[str] | None, typer.Option(help=f"One of {', '.join(NAMES)}; may be repeated.")] = None,
    seed: Annotated[int, typer.Option(help="Seed of noise and searches.")] = 0,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Regenerate every figure and table of the paper and compare our numbers with the paper's.

    Example: hand reproduce --only fig13 --out out/paper

    Exit codes: 0 done, 2 bad usage or bad input.
    """
    names = tuple(dict.fromkeys(only)) if only else NAMES
    pictures = {name: out / f"{name}.png" for name in names}
    page, numbers = out / "index.html", out / "results.json"
    with running("reproduce", *pictures.values(), page, numbers) as outputs:
        for name in names:
            if name not in NAMES:
                raise ValueError(f"--only is {name!r}; it must be one of {', '.join(NAMES)}")
        check_folder(out)
        require("validation", "skfem", "deap", "cma")
        chosen = choose_model(None)
        origin = Origin(chosen, seed)
        from validation.paper.page import write_page

        chosen.print(as_json)
        out.mkdir(parents=True, exist_ok=True)
        results = _run_all(names, seed, as_json)
        for result, picture in results:
            pictures[result.id].write_bytes(picture)
            outputs.complete(pictures[result.id])
        write_page(results, page, origin.of_page())
        outputs.complete(page)
        quantities = [asdict(quantity) for result, _ in results for quantity in result.quantities]
        text = json.dumps(quantities, indent=2)
        numbers.write_text(text + "\n", encoding="utf-8")
    if as_json:
        print(text)
        return
    for result, _ in results:
        print(f"{result.id}: {result.gets}")
    print(f"written: {page}, {numbers}, one PNG per figure")


def _run_one(name: str, seed: int) -> tuple[Reproduction, bytes]:
    return _reproduced(name, seed, lambda _: None)


def _reproduced(name: str, seed: int, progress: Callable[[float], None]) -> tuple[Reproduction, bytes]:
    from validation.paper.page import png
    from validation.paper.result import reproduce as run

    result = run(name, seed, progress)
    return result, png(result)


def _run_all(names: tuple[str, ...], seed: int, as_json: bool) -> list[tuple[Reproduction, bytes]]:
    """All figures in their order, WORKERS at a time; the slowest begins first."""
    from concurrent.futures import ProcessPoolExecutor, as_completed
    from multiprocessing import get_context

    from validation.trial.workers import end_with_parent

    done: dict[str, tuple[Reproduction, bytes]] = {}
    with progress_bar(as_json, counted=len(names) > 1) as progress:
        if len(names) == 1:
            share = progress.add_task(names[0], total=1.0)
            return [_reproduced(names[0], seed, lambda part: progress.update(share, completed=part))]
        bar = progress.add_task("reproducing", total=len(names))
        interrupts.before_workers()
        with ProcessPoolExecutor(WORKERS, get_context("spawn"), end_with_parent) as pool:
            slowest_first = sorted(names, key=lambda name: name != "fig06")
            waiting = {pool.submit(_run_one, name, seed): name for name in slowest_first}
            for future in as_completed(waiting):
                done[waiting[future]] = future.result()
                progress.update(bar, advance=1, description=waiting[future])
    return [done[name] for name in names]
