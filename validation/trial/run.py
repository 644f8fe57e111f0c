"""Diagnose the recordings of a trial with the ordinary command, in processes that do not have the key."""

from __future__ import annotations

import json
import os
import subprocess
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

PASSED_ON = ("PATH", "HOME", "LANG", "LD_LIBRARY_PATH", "PYTHONPATH", "AMENT_PREFIX_PATH", "VIRTUAL_ENV", "TMPDIR")
"""The only environment variables that the diagnosing processes get."""
BATCH = 24


def run(folder: Path, command: list[str], jobs: int, tolerance: float, progress: Callable[[float], None]) -> None:
    """Write folder/reports/BATCH/*_case_NNNN/report.json for every case; an interrupted run continues.

    command: how to call the tool, as in ["hand"].  tolerance: relative error of the nominal parameters.  progress:
    called with the share done, 0 to 1.  Raises RuntimeError with the last line of the tool where it fails.
    """
    plan = json.loads((folder / "plan.json").read_text(encoding="utf-8"))
    groups: dict[tuple[str, str], list[int]] = defaultdict(list)
    for case in plan:
        groups[case["model"], case["without"]].append(case["number"])
    environment = {name: os.environ[name] for name in PASSED_ON if name in os.environ}
    environment |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    begun, done = time.monotonic(), 0
    for group, ((model, without), numbers) in enumerate(groups.items()):
        for first in range(0, len(numbers), BATCH):
            batch = numbers[first : first + BATCH]
            recordings = [str(folder / "recordings" / f"case_{number:04d}.mcap") for number in batch]
            reports = folder / "reports" / f"{group}_{first}"
            options = ["--model", str(folder / model), "--out", str(reports), "--tolerance", str(tolerance)]
            options += ["--each", "--jobs", str(min(jobs, len(batch)))] + (["--without", without] if without else [])
            options.append("--no-sensor-curve")  # the trial records true angles, not readings of the Hall sensors
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
