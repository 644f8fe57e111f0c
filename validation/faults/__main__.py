"""Inject every fault and write what was detected: python -m validation.faults [--full] [--only NAME] [--out FILE].

Without --full everything runs in virtual time, within minutes. With --full, processes over loopback, pseudo-terminals
and CAN are killed, stopped, flooded and restarted as well; their times depend on the load of the machine.

Example: python -m validation.faults --only frames --seed 7 --out out/faults.json
"""

from __future__ import annotations

import argparse
import importlib
import json
import sys
import time
import traceback
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from validation.faults.result import FaultResult, Size
from validation.faults.results_page import write_page
from validation.results import LIVE_FAMILIES, provenance

FAMILIES = ("frames", "disconnects", "commands", "timing", "sensors", "board")
"""Modules of this package that run in virtual time, each with `run(size, seed)`."""
FULL_FAMILIES = LIVE_FAMILIES
"""Those that start processes; they run with --full only."""
SEED = 2611


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; exit code 0 all handled, 1 a fault was not handled, 2 bad usage, 130 interrupted."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.faults",
        description="Inject faults and write what was detected, how soon, and what was not.",
        epilog="Example: python -m validation.faults --only frames --seed 7 --out out/faults.json",
    )
    available = [name for name in (*FAMILIES, *FULL_FAMILIES) if is_there(name)]
    parser.add_argument("--full", action="store_true", help="also with processes in real time, about half an hour")
    parser.add_argument("--quick", action="store_true", help="fewer cases: a smoke test, not a measurement")
    parser.add_argument("--only", choices=available, action="append", help="run this family; may be repeated")
    parser.add_argument("--seed", type=int, default=SEED, help="seed of all random faults")
    parser.add_argument("--out", type=Path, default=Path("out/faults.json"), help="file of results")
    options = parser.parse_args(arguments)
    if options.quick and options.full:
        parser.error("give either --quick or --full")
    size = Size.FULL if options.full else Size.QUICK if options.quick else Size.NORMAL
    chosen = options.only or [name for name in available if options.full or name in FAMILIES]
    console = Console()
    done: list[FaultResult] = []
    command = " ".join(["python -m validation.faults", *(arguments if arguments is not None else sys.argv[1:])])
    options.out.parent.mkdir(parents=True, exist_ok=True)
    try:
        for name in chosen:
            begun = time.monotonic()
            try:
                done += run(name, size, options.seed)
            except Exception as error:  # the other families run all the same, and the exit code is 1
                traceback.print_exc()
                done.append(FaultResult(name, "the family itself", 1, 0, (f"{type(error).__name__}: {error}",)))
            console.print(f"{name}: {time.monotonic() - begun:.1f} s")
            write(options.out, command, size, options.seed, done)
    except KeyboardInterrupt:
        print(f"python -m validation.faults: interrupted; {options.out} holds {len(done)} results", file=sys.stderr)
        return 130
    console.print(table(done))
    console.print(f"seed {options.seed}; written: {options.out}, {options.out.with_suffix('.html')}")
    for result in done:
        if not result.passed:
            print(f"not handled: {result.family}: {result.hazard}: {', '.join(result.unhandled)}", file=sys.stderr)
    return 0 if all(result.passed for result in done) else 1


def is_there(name: str) -> bool:
    """Whether a family has its module."""
    return (Path(__file__).parent / f"{name}.py").is_file()


def run(name: str, size: Size, seed: int) -> list[FaultResult]:
    """Results of one family."""
    results: list[FaultResult] = importlib.import_module(f"validation.faults.{name}").run(size, seed)
    return results


def write(path: Path, command: str, size: Size, seed: int, done: list[FaultResult]) -> None:
    """Store the results so far, and show them on a page of the same name."""
    document: dict[str, Any] = {**provenance(command), "size": size.name.lower(), "seed": seed}
    document["faults"] = [result.as_dict() for result in done]
    path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    write_page(path.with_suffix(".html"), document)


def table(results: list[FaultResult]) -> Table:
    """The results for a terminal."""
    view = Table("family", "hazard", "handled", "false accepts", "median", "max", "worst", "all")
    for result in results:
        worst = "" if result.worst is None else f"{result.worst:.4g} {result.unit}"
        view.add_row(
            result.family, result.hazard, f"{result.handled} / {result.cases}", str(result.false_accepts),
            *("" if value is None else f"{value:.3f} s" for value in (result.median_s, result.max_s)),
            worst, "yes" if result.passed else "NO",
        )  # fmt: skip
    return view


if __name__ == "__main__":
    sys.exit(main())
