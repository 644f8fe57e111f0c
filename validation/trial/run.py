"""Diagnose the recordings of a trial with the ordinary command, in processes that do not have the key."""

from __future__ import annotations

import json
import os
import subprocess
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

PASSED_ON = ("PATH", "HOME", "LANG", "LD_LIBRARY_PATH", "PYTHONPATH", "AMENT_PREFIX_PATH", "VIRTUAL_ENV", "TMPDIR")
"""The only environment variables that the diagnosing processes get."""
BATCH = 24
CASE: dict[str, type] = {"number": int, "model": str, "without": str, "tolerance": float}
KINDS = {int: "a whole number", str: "text", float: "a number with a decimal point"}
MOST_CASES = 100_000
TOLERANCE = 0.05
"""Relative standard deviation of the nominal numbers where a case states none, as `hand trial run` has it [-]."""
MACHINE = "machine.yaml"
"""Name of the nominal model of a case on another machine than a hand."""


def read_plan(folder: Path) -> list[dict[str, Any]]:
    """The cases of folder/plan.json: number, model, without and tolerance (0: that of the run).

    Raises ValueError, one line, for any other content.
    """
    path = folder / "plan.json"
    try:
        plan = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path} is not JSON: {' '.join(str(error).split())}") from None
    if not isinstance(plan, list) or not plan:
        raise ValueError(f"{path} must be a list with at least one case, as hand trial make writes it")
    numbers = set[int]()
    for place, case in enumerate(plan):
        if not isinstance(case, dict) or case.keys() != CASE.keys():
            raise ValueError(f"{path}: case {place} must be a mapping of {', '.join(CASE)}")
        for key, kind in CASE.items():
            if type(case[key]) is not kind:
                raise ValueError(f"{path}: {key} of case {place} must be {KINDS[kind]}")
        if not 0 <= case["number"] <= MOST_CASES or case["number"] in numbers:
            raise ValueError(f"{path}: number of case {place} must be 0 to {MOST_CASES}, each once")
        numbers.add(case["number"])
        if not 0.0 <= case["tolerance"] <= 0.5:
            raise ValueError(f"{path}: tolerance of case {place} must be 0 to 0.5")
        if not (folder / case["model"]).resolve().is_relative_to(folder.resolve()):
            raise ValueError(f"{path}: model of case {place} must be a file of the trial's folder")
    return plan


def recording_of(folder: Path, model: str, number: int) -> Path:
    """The recording of a case: a rosbag2 file of a hand, a table of another machine. model: as plan.json has it."""
    return folder / "recordings" / f"case_{number:04d}.{'npz' if Path(model).name == MACHINE else 'mcap'}"


def run(
    folder: Path,
    command: list[str],
    jobs: int,
    tolerance: float,
    progress: Callable[[float], None],
    *,
    scheduler: str | None = None,
) -> None:
    """Write folder/reports/BATCH/case_NNNN_*/report.json for every case; an interrupted run continues.

    command: how to call the tool, as in ["hand"].  tolerance: relative error of the nominal parameters.  progress:
    called with the share done, 0 to 1.  scheduler: address of a dask scheduler that diagnoses instead of jobs.  Raises
    ValueError for a broken plan, RuntimeError with the last line of the tool where it fails.
    """
    plan = read_plan(folder)
    groups: dict[tuple[str, str, float], list[int]] = defaultdict(list)
    for case in plan:
        groups[case["model"], case["without"], case["tolerance"] or tolerance].append(case["number"])
    environment = {name: os.environ[name] for name in PASSED_ON if name in os.environ}
    environment |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    begun, done = time.monotonic(), 0
    for group, ((model, without, allowed), numbers) in enumerate(groups.items()):
        for first in range(0, len(numbers), BATCH):
            batch = numbers[first : first + BATCH]
            recordings = [str(recording_of(folder, model, number)) for number in batch]
            reports = folder / "reports" / f"{group}_{first}"
            kind = "--machine" if Path(model).name == MACHINE else "--model"
            options = [kind, str(folder / model), "--out", str(reports), "--tolerance", str(allowed)]
            own = ["--jobs", str(min(jobs, len(batch)))] if scheduler is None else ["--scheduler", scheduler]
            options += ["--each", *own] + (["--without", without] if without else [])
            if kind == "--model":  # the trial records true angles, not readings of the Hall sensors
                options.append("--no-sensor-curve")
            finished = subprocess.run(
                [*command, "diagnose", *recordings, *options, "--json"],
                env=environment, capture_output=True, text=True, check=False,
            )  # fmt: skip
            if finished.returncode != 0:
                lines = finished.stderr.strip().splitlines() or ["no message"]
                raise RuntimeError(f"hand diagnose ended with {finished.returncode}: {lines[-1]}")
            done += len(batch)
            progress(done / len(plan))
    timing = {"seconds": time.monotonic() - begun, "jobs": jobs}
    (folder / "timing.json").write_text(json.dumps(timing), encoding="utf-8")
