"""Examine real machines: python -m validation.machines [collect] ...

Examples: python -m validation.machines collect --clones clones --data data
          python -m validation.machines --data data --out out/machines.json
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from validation.machines.cases import Case, described_cases, older_cases
from validation.machines.collect import collect
from validation.machines.examine import examine
from validation.machines.page import write_page
from validation.results import provenance

TOOL = [sys.executable, "-m", "hand_tool"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; exit code 0 done, 1 a machine could not be examined, 2 bad usage or bad input."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.machines",
        description="Diagnose recordings of real machines, predict other recordings of them, and compare with rivals.",
        epilog="Example: python -m validation.machines --data data --out out/machines.json",
    )
    parser.add_argument("step", nargs="?", choices=("collect",), help="collect: write the recordings from clones")
    parser.add_argument("--clones", type=Path, help="folder with clones of the sources, for collect")
    parser.add_argument("--data", type=Path, required=True, help="folder of the recordings")
    parser.add_argument("--only", default="", help="comma-separated machines; default: all")
    parser.add_argument("--out", type=Path, default=Path("out/machines.json"), help="file of the results")
    options = parser.parse_args(arguments)
    try:
        cases = _chosen(options)
        if options.step == "collect":
            return _collect(cases, options.clones, options.data)
    except (OSError, ValueError) as error:
        print(f"python -m validation.machines: {error}", file=sys.stderr)
        return 2
    return _examine(cases, options.data, options.out)


def _chosen(options: argparse.Namespace) -> list[Case]:
    """The machines asked for that have data. ValueError: unknown names, or no data at all."""
    cases = described_cases()
    if options.step != "collect":
        cases = [case for case in cases if (options.data / case.name).is_dir()]
        cases += older_cases(options.data, options.out.parent / "machines" / "data")
    wanted = [name.strip() for name in options.only.split(",") if name.strip()]
    unknown = [name for name in wanted if name not in {case.name for case in cases}]
    if unknown:
        raise ValueError(f"--only: {', '.join(unknown)}: the machines are: {', '.join(case.name for case in cases)}")
    if not cases:
        raise ValueError(f"{options.data} has no recordings; the steps are in docs/proof.md, section Real machines")
    return [case for case in cases if not wanted or case.name in wanted]


def _collect(cases: Sequence[Case], clones: Path | None, data: Path) -> int:
    if clones is None:
        raise ValueError("collect needs --clones, the folder with the clones")
    missing = collect(cases, clones, data, print)
    for line in missing:
        print(line, file=sys.stderr)
    return 1 if missing else 0


def _examine(cases: Sequence[Case], data: Path, out: Path) -> int:
    """Examine each machine and write the results; a machine that fails is reported, and the others go on."""
    results, failed = [], []
    for case in cases:
        try:
            results.append(examine(case, data, out.parent / "machines", TOOL))
        except (OSError, ValueError, RuntimeError) as error:
            failed.append({"machine": case.name, "title": case.title, "error": str(error)})
            print(f"{case.name}: {error}", file=sys.stderr)
            continue
        last = results[-1]
        best = min(last["rivals"].values())
        print(f"{case.name}: {last['verdict']}, {last['ours']:.3g} {last['unit']}, best rival {best:.3g}", flush=True)
    content = {**provenance("make machines DATA=folder"), "machines": results, "failed": failed}
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    write_page(out.with_suffix(".html"), content)
    print(f"written: {out}, {out.with_suffix('.html')}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
