"""Diagnose the recordings of a trial with the ordinary command, in processes that do not have the key."""

from __future__ import annotations

import json
import os
import subprocess
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

PASSED_ON = ("PATH", "HOME", "LANG", "LD_LIBRARY_PATH", "PYTHONPATH", "AMENT_PREFIX_PATH", "VIRTUAL_ENV", "TMPDIR")
"""The only environment variables that the diagnosing processes get."""
BATCH = 6
"""Recordings that one process diagnoses: few, so that no core waits long for another one."""
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


@dataclass(frozen=True, slots=True)
class Batch:
    """Recordings with one nominal model that one process diagnoses; name: of the folder of their reports."""

    name: str
    model: str
    without: str
    tolerance: float
    numbers: tuple[int, ...]

    def arguments(self, folder: Path) -> list[str]:
        """Arguments of `hand diagnose`."""
        of_machine = Path(self.model).name == MACHINE
        return [
            *(str(recording_of(folder, self.model, number)) for number in self.numbers),
            *("--machine" if of_machine else "--model", str(folder / self.model)),
            *("--out", str(folder / "reports" / self.name), "--tolerance", str(self.tolerance), "--each"),
            *(["--without", self.without] if self.without else []),
            # The trial records true angles, not readings of the Hall sensors.
            *([] if of_machine else ["--no-sensor-curve"]),
        ]


def _batches(folder: Path, plan: Sequence[Mapping[str, Any]], tolerance: float, most: int) -> list[Batch]:
    """Batches of at most `most` recordings, those with the largest files first: these take longest."""
    groups: dict[tuple[str, str, float], list[int]] = defaultdict(list)
    for case in plan:
        groups[case["model"], case["without"], case["tolerance"] or tolerance].append(case["number"])

    found: list[Batch] = []
    sizes: dict[int, int] = {}
    for group, ((model, without, allowed), numbers) in enumerate(groups.items()):
        files = {number: recording_of(folder, model, number) for number in numbers}
        sizes |= {number: file.stat().st_size if file.is_file() else 0 for number, file in files.items()}
        ordered = sorted(numbers, key=sizes.__getitem__, reverse=True)
        for first in range(0, len(ordered), most):
            found.append(Batch(f"{group}_{first}", model, without, allowed, tuple(ordered[first : first + most])))
    return sorted(found, key=lambda batch: -sizes[batch.numbers[0]])


class _Processes:
    """Commands that run side by side, and end with what started them."""

    def __init__(self, jobs: int) -> None:
        self._pool = ThreadPoolExecutor(jobs)
        self._running: list[subprocess.Popen[str]] = []
        self._ended = threading.Event()

    def __enter__(self) -> _Processes:
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._pool.shutdown(wait=False, cancel_futures=True)
        for process in self._running:
            process.terminate()
        self._pool.shutdown()

    def start(self, command: Sequence[str], environment: Mapping[str, str]) -> Future[None]:
        """Run a command; its result raises RuntimeError with the last line of the command where it fails."""
        return self._pool.submit(self._run, command, environment)

    def _run(self, command: Sequence[str], environment: Mapping[str, str]) -> None:
        with subprocess.Popen(
            command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        ) as process:
            self._running.append(process)
            if self._ended.is_set():
                process.terminate()
            lines = process.communicate()[1].strip().splitlines() or ["no message"]
        if process.returncode != 0:
            raise RuntimeError(f"hand diagnose ended with {process.returncode}: {lines[-1]}")


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
    environment = {name: os.environ[name] for name in PASSED_ON if name in os.environ}
    environment |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    begun, done = time.monotonic(), 0
    most = len(plan) if scheduler else min(BATCH, -(-len(plan) // jobs))
    batches = _batches(folder, plan, tolerance, most)
    where = ["--jobs", "1"] if scheduler is None else ["--scheduler", scheduler]
    with _Processes(1 if scheduler else jobs) as processes:
        waiting = {
            processes.start([*command, "diagnose", *batch.arguments(folder), *where, "--json"], environment): batch
            for batch in batches
        }
        for future in as_completed(waiting):
            future.result()
            done += len(waiting[future].numbers)
            progress(done / len(plan))
    timing = {"seconds": time.monotonic() - begun, "jobs": jobs}
    (folder / "timing.json").write_text(json.dumps(timing), encoding="utf-8")
