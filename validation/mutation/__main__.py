"""Run the mutation groups of this folder: `python -m validation.mutation [--group NAME] [--sample N --seed S]`.

The group `firmware` mutates C (c_session.py). Each TOML file of this folder is one group in the format of cosmic-ray:
the modules to mutate, the tests to run, the operators that are left out. The tree is copied to a temporary folder
first, so that no mutated file can remain here. `python -m validation.figures --take out/mutation.json` stores a run.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from validation.results import provenance

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
SKIPPED = shutil.ignore_patterns(".*", "build", "install", "log", "out", "docs", "__pycache__", "hand_msgs")
GOAL = 0.9
FIRMWARE = "firmware"
"""The group of the C files."""


def main() -> int:
    """Run the chosen groups; 1 where a group stays below the goal, 2 for bad usage or tests that fail unmutated."""
    names = sorted([*(path.stem for path in HERE.glob("*.toml")), FIRMWARE])
    parser = argparse.ArgumentParser(
        prog="python -m validation.mutation",
        description=__doc__.splitlines()[0],
        epilog="Example: python -m validation.mutation --group effects --sample 20",
    )
    parser.add_argument("--group", action="append", choices=names, help="a group; may be repeated; default: all")
    parser.add_argument("--sample", type=int, default=0, metavar="N", help="random mutants per group; default: all")
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="seed of the random sample")
    parser.add_argument("--out", type=Path, default=Path("out/mutation.json"), help="result file")
    arguments = parser.parse_args()
    if arguments.sample < 0:
        parser.error(f"--sample is {arguments.sample}; it must be 0 or more")
    version = importlib.metadata.version("cosmic-ray")
    command = " ".join(["python -m validation.mutation", *sys.argv[1:]])
    about = provenance(command)
    print(f"cosmic-ray {version}, seed {arguments.seed}, sample {arguments.sample or 'all mutants'}", flush=True)
    with tempfile.TemporaryDirectory(prefix="mutation-") as folder:
        tree = Path(folder) / "tree"
        shutil.copytree(ROOT, tree, ignore=SKIPPED)
        groups = {name: _run(tree, name, arguments.sample, arguments.seed) for name in arguments.group or names}
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    drawn = {"seed": arguments.seed, "sample": arguments.sample}
    result = {**about, "cosmic_ray": version, "mutation": {name: {**groups[name], **drawn} for name in groups}}
    arguments.out.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    _print_table(groups)
    print(f"details: {arguments.out}")
    if any("error" in group for group in groups.values()):
        return 2
    return 0 if all(group["killed"] >= GOAL * group["mutants"] for group in groups.values()) else 1


def _run(tree: Path, name: str, sample: int, seed: int) -> dict[str, Any]:
    """Run one group in the copied tree; its counts and survivors."""
    fixed = {"NUMBA_DISABLE_JIT": "1", "PYTHONDONTWRITEBYTECODE": "1", "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    environment = os.environ | {"PYTHONPATH": str(tree)} | ({} if name == FIRMWARE else fixed)
    session = "validation.mutation.c_session" if name == FIRMWARE else "validation.mutation.session"
    command = [sys.executable, "-m", session, name, str(sample), str(seed)]
    process = subprocess.Popen(command, cwd=tree, env=environment, stdout=subprocess.PIPE, text=True)
    result: dict[str, Any] = {"mutants": 0, "killed": 0, "error": "the session ended without a result"}
    assert process.stdout is not None
    for line in process.stdout:
        message = json.loads(line)
        if "progress" in message:
            print(f"\r{name}: {message['progress']}", end="", file=sys.stderr, flush=True)
        else:
            result = message
    process.wait()
    print(file=sys.stderr)
    return result


def _print_table(groups: dict[str, dict[str, Any]]) -> None:
    print(f"{'group':<14}{'mutants':>9}{'of':>7}{'killed':>8}{'survived':>10}{'share':>8}{'seconds':>9}")
    for name, group in groups.items():
        if "error" in group:
            print(f"{name:<14}{group['error']}")
            continue
        share = group["killed"] / max(group["mutants"], 1)
        survived = len(group["survivors"])
        print(
            f"{name:<14}{group['mutants']:>9}{group['total']:>7}{group['killed']:>8}{survived:>10}"
            f"{100.0 * share:>7.1f}%{group['seconds']:>9.0f}"
        )
    for name, group in groups.items():
        for survivor in group.get("survivors", []):
            print(f"{name}: survived {survivor['module']}:{survivor['line']} {survivor['operator']}")
            print(f"    - {survivor['before']}\n    + {survivor['after']}")


if __name__ == "__main__":
    sys.exit(main())
