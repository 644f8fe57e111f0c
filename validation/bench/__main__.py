"""Run every bench and write one list of results: python -m validation.bench [--quick] [--only NAME] [--out FILE]."""

from __future__ import annotations

import argparse
import importlib
import json
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

BENCHES = (
    "plant",
    "controller",
    "steps",
    "loader",
    "codec",
    "loop",
    "diagnose",
    "effects",
    "compare",
    "control",
    "firmware",
)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m validation.bench", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/bench.json"), help="where the list of results goes")
    parser.add_argument("--only", choices=BENCHES, action="append", help="run these only")
    parser.add_argument("--quick", action="store_true", help="fewer rounds: a smoke test, not a measurement")
    options = parser.parse_args()
    console = Console()
    results: list[dict[str, Any]] = []
    for name in options.only or BENCHES:
        console.print(f"[bold]{name}[/bold] ...")
        results += importlib.import_module(f"validation.bench.bench_{name}").run(options.quick)
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text(json.dumps(results, indent=2) + "\n", encoding="utf-8")
    console.print(table(results))
    console.print(f"written to {options.out}")


def table(results: list[dict[str, Any]]) -> Table:
    columns = ("name", "ours", "reference", "ratio", "goal", "unit")
    view = Table(*columns, "met")
    for result in results:
        met = "-" if result["goal"] is None else ("yes" if reached(result) else "NO")
        view.add_row(*(_show(result[column]) for column in columns), met)
    return view


def reached(result: dict[str, Any]) -> bool:
    """A goal bounds the ratio where there is a reference, else our own figure."""
    value = result["ours"] if result["ratio"] is None else result["ratio"]
    return bool(value <= result["goal"])


def _show(value: object) -> str:
    return "-" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)


if __name__ == "__main__":
    main()
