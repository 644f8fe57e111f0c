"""`hand reproduce`: the paper's figures and tables from this stack's own code."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from hand_tool.validation_extra import needs_validation

if TYPE_CHECKING:
    from validation.paper.result import Reproduction

WORKERS = 2


def reproduce(
    out: Annotated[Path, typer.Option(help="Folder for the PNGs, index.html and results.json.")],
    only: Annotated[list[str] | None, typer.Option(help="One figure or table, such as fig13; may be repeated.")] = None,
    seed: Annotated[int, typer.Option(help="Of noise and searches.")] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="Print results.json's content.")] = False,
) -> None:
    """Regenerate every figure and table of the paper and put our numbers beside the paper's.

    Example: hand reproduce --only fig13 --out out/paper

    Exit codes: 0 done, 2 bad usage or bad input.
    """
    with needs_validation("reproduce"):
        from validation.paper.catalogue import IDS  # noqa: PLC0415 - a robot need not have it
        from validation.paper.page import write_page  # noqa: PLC0415 - as above

    try:
        names = tuple(dict.fromkeys(only)) if only else IDS
        for name in names:
            if name not in IDS:
                raise ValueError(f"--only is {name!r}; it must be one of {', '.join(IDS)}")
        out.mkdir(parents=True, exist_ok=True)
        results = _run_all(names, seed, Console(stderr=True, quiet=as_json))
        for result, picture in results:
            (out / f"{result.id}.png").write_bytes(picture)
        write_page(results, out / "index.html")
    except (ValueError, OSError, ImportError) as error:
        print(f"hand reproduce: {error}", file=sys.stderr)
        raise typer.Exit(2) from None
    quantities = [asdict(quantity) for result, _ in results for quantity in result.quantities]
    text = json.dumps(quantities, indent=2)
    (out / "results.json").write_text(text + "\n", encoding="utf-8")
    if as_json:
        print(text)
        return
    for result, _ in results:
        print(f"{result.id}: {result.gets}")
    print(f"written: {out / 'index.html'}, {out / 'results.json'}, a PNG a figure")


def _one(name: str, seed: int) -> tuple[Reproduction, bytes]:
    return _reproduced(name, seed, lambda _: None)


def _reproduced(name: str, seed: int, progress: Callable[[float], None]) -> tuple[Reproduction, bytes]:
    from validation.paper.catalogue import reproduce as run  # noqa: PLC0415 - a robot need not have it
    from validation.paper.page import png  # noqa: PLC0415 - as above

    result = run(name, seed, progress)
    return result, png(result)


def _run_all(names: tuple[str, ...], seed: int, console: Console) -> list[tuple[Reproduction, bytes]]:
    """All figures in their order, two at a time; the slowest begins first."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    done: dict[str, tuple[Reproduction, bytes]] = {}
    with Progress(*columns, console=console) as progress:
        bar = progress.add_task("reproducing", total=len(names))
        if len(names) == 1:
            share = progress.add_task(names[0], total=1.0)
            return [_reproduced(names[0], seed, lambda part: progress.update(share, completed=part))]
        with ProcessPoolExecutor(WORKERS, mp_context=get_context("spawn")) as pool:
            slowest_first = sorted(names, key=lambda name: name != "fig06")
            waiting = {pool.submit(_one, name, seed): name for name in slowest_first}
            for future in as_completed(waiting):
                done[waiting[future]] = future.result()
                progress.update(bar, advance=1, description=waiting[future])
    return [done[name] for name in names]
