"""Run the benches and write one file of results: python -m validation.bench [--quick] [--only NAME] [--out FILE].

Example: python -m validation.bench --only steps --out out/bench.json
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import json
import shutil
import sys
from functools import cache
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from validation.bench.result import KEYS, reached
from validation.results import provenance

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
    "motion",
    "liquid",
    "grasp",
    "found",
    "rivals",
    "studio",
    "demo",
    "command",
)
PROGRAMS = {
    "plant": ("cc",),
    "firmware": ("arm-none-eabi-gcc", "qemu-system-arm"),
    "studio": ("chromium|chromium-browser|google-chrome",),
}
"""Programs that a bench starts and that this package does not install; one of several names with | between them."""
MODULES = {"codec": ("rclpy",), "loop": ("rclpy", "hand_msgs.msg"), "studio": ("rclpy", "hand_msgs.msg", "viser")}
"""Python modules of ROS 2 that a bench needs."""


def main() -> int:
    """Run what the command line names; exit code 0 done, 2 bad usage, 130 interrupted."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.bench",
        description="Run the benches and write one file of results.",
        epilog="Example: python -m validation.bench --only steps --out out/bench.json",
    )
    parser.add_argument("--out", type=Path, default=Path("out/bench.json"), help="file of results")
    parser.add_argument("--only", choices=BENCHES, action="append", help="run this bench; may be repeated")
    parser.add_argument("--quick", action="store_true", help="fewer rounds: a smoke test, not a measurement")
    options = parser.parse_args()
    console = Console()
    done: dict[str, list[dict[str, Any]]] = {}
    skipped: dict[str, str] = {}
    command = " ".join(["python -m validation.bench", *sys.argv[1:]])
    options.out.parent.mkdir(parents=True, exist_ok=True)
    try:
        for name in options.only or BENCHES:
            if missing := missing_tools(name):
                skipped[name] = missing
                console.print(f"{name}: skipped, it needs {missing}")
                continue
            console.print(f"[bold]{name}[/bold] ...")
            done[name] = run(name, options.quick)
            document = {**provenance(command), "quick": options.quick, "benches": done, "skipped": skipped}
            options.out.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    except KeyboardInterrupt:
        written = f"{options.out} holds {', '.join(done)}" if done else f"{options.out} was not written"
        print(f"python -m validation.bench: interrupted; {written}", file=sys.stderr)
        return 130
    if not done:
        print(f"python -m validation.bench: nothing was run, {options.out} was not written", file=sys.stderr)
        return 2
    console.print(table([result for results in done.values() for result in results]))
    console.print(f"written: {options.out}")
    return 0


def run(name: str, quick: bool) -> list[dict[str, Any]]:
    """Results of one bench of BENCHES, each with the keys of `validation.bench.result`."""
    results: list[dict[str, Any]] = importlib.import_module(f"validation.bench.bench_{name}").run(quick)
    return results


@cache
def quick_results(name: str) -> tuple[dict[str, Any], ...]:
    """Results of a bench's quick form, run once a process."""
    return tuple(run(name, quick=True))


def missing_tools(name: str) -> str:
    """What this machine lacks for a bench, as a phrase; empty where nothing is missing."""
    missing = [names for names in PROGRAMS.get(name, ()) if not any(map(shutil.which, names.split("|")))]
    missing += [f"the Python module {module}" for module in MODULES.get(name, ()) if not _importable(module)]
    return " and ".join(missing)


def _importable(module: str) -> bool:
    try:
        return importlib.util.find_spec(module) is not None
    except ModuleNotFoundError:
        return False


def table(results: list[dict[str, Any]]) -> Table:
    """The results for a terminal."""
    view = Table(*KEYS, "met")
    for result in results:
        met = {None: "-", True: "yes", False: "NO"}[reached(result)]
        view.add_row(*(_cell(result[key]) for key in KEYS), met)
    return view


def _cell(value: object) -> str:
    return "-" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)


if __name__ == "__main__":
    sys.exit(main())
