"""Ctrl-C in real processes: one line, exit code 130, no child process, no traceback, also during imports."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hand_model.description import load_hand
from hand_recording.replay import record_offline

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / "config" / "hand.yaml"
WAIT_S = 60.0


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording whose diagnosis and replay take longer than the test."""
    out = tmp_path_factory.mktemp("recording") / "long.mcap"
    hand = load_hand(CONFIG)
    rng = np.random.default_rng(0)
    set_point_pa = np.repeat(rng.uniform(0.0, 3e5, (60, len(hand.joints))), 200, axis=0)
    for _ in record_offline(hand, set_point_pa, out, seed=1):
        pass
    return out


class Running:
    """A command in a session of its own, so that the test can see whether processes of it remain."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "hand_tool", *arguments],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def members(self) -> list[int]:
        """Running processes of the session."""
        found = []
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit():
                try:
                    state, _, _, session = (entry / "stat").read_text(encoding="utf-8").rpartition(")")[2].split()[:4]
                except OSError:
                    continue
                if int(session) == self.process.pid and state not in "ZX":
                    found.append(int(entry.name))
        return found

    def until(self, condition: Callable[[], bool]) -> None:
        end = time.monotonic() + WAIT_S
        while not condition():
            assert self.process.poll() is None, self.process.communicate()
            assert time.monotonic() < end
            time.sleep(0.05)

    def interrupt(self, whole_group: bool) -> list[str]:
        """Ctrl-C as a terminal sends it (to the whole group) or as kill sends it; the lines on standard error."""
        send = os.killpg if whole_group else os.kill
        send(self.process.pid, signal.SIGINT)
        _, printed = self.process.communicate(timeout=WAIT_S)
        assert self.process.returncode == 130, printed
        end = time.monotonic() + 5.0
        while self.members() and time.monotonic() < end:
            time.sleep(0.05)
        assert self.members() == []
        return printed.splitlines()


def loaded(process: Running, library: str) -> bool:
    """Whether a process has mapped a library: it is in the middle of its imports or beyond them."""
    try:
        return library in Path(f"/proc/{process.process.pid}/maps").read_text(encoding="utf-8")
    except OSError:
        return False


@pytest.mark.parametrize("whole_group", [False, True], ids=["kill", "terminal"])
@pytest.mark.parametrize(
    ("arguments", "library"),
    [
        (("simulate", "{recording}", "--out", "sim.mcap"), "_multiarray_umath"),
        (("diagnose", "{recording}", "--out", "report"), "libllvmlite"),
        (("trial", "make", "trial", "--cases", "40"), "libllvmlite"),
        (("reproduce", "--out", "paper"), "typer"),
    ],
    ids=["simulate", "diagnose", "trial make", "reproduce"],
)
def test_during_imports(
    arguments: tuple[str, ...], library: str, whole_group: bool, recording: Path, tmp_path: Path
) -> None:
    """Fails when Ctrl-C during imports prints a traceback, leaves a file, or does not end the process."""
    running = Running(tmp_path, *(part.format(recording=recording) for part in arguments))
    if library == "typer":
        time.sleep(0.4)
    else:
        running.until(lambda: loaded(running, library))
    lines = [line for line in running.interrupt(whole_group) if not line.startswith("model: ")]
    assert len(lines) == 1, lines
    assert lines[0].startswith("hand")
    assert "interrupted; " in lines[0]
    assert "incomplete" not in lines[0] or "trial" in lines[0]


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A trial that was made and not run."""
    folder = tmp_path_factory.mktemp("made") / "trial"
    make = [sys.executable, "-m", "hand_tool", "trial", "make", str(folder), "--cases", "5"]
    subprocess.run(make, cwd=ROOT, capture_output=True, check=True)
    return folder


@pytest.mark.parametrize(
    ("command", "whole_group"),
    [
        pytest.param(
            command,
            group,
            id=f"{command}-{'terminal' if group else 'kill'}",
            marks=[pytest.mark.long] if command == "trial run" else [],
        )
        for command in ("simulate", "diagnose", "trial make", "trial run", "reproduce")
        for group in (False, True)
    ],
)
def test_during_the_work(
    command: str, whole_group: bool, recording: Path, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    """Fails when a worker process is left, or the line does not say what was written and what was not."""
    if command == "simulate":
        running = Running(tmp_path, "simulate", str(recording), "--out", "sim.mcap", "--seed", "1")
        running.until((tmp_path / "sim.mcap").exists)
        wanted = "incomplete: sim.mcap"
    elif command == "diagnose":
        running = Running(tmp_path, "diagnose", str(recording), str(recording), "--jobs", "2", "--out", "report")
        running.until(lambda: len(running.members()) >= 3)
        wanted = "not written: report/findings.parquet, report/summary.json, report/index.html"
    elif command == "trial make":
        running = Running(tmp_path, "trial", "make", "trial", "--cases", "200")
        running.until((tmp_path / "trial" / "recordings").exists)
        wanted = "incomplete: trial/recordings; not written: trial/plan.json"
    elif command == "trial run":
        shutil.copytree(request.getfixturevalue("trial"), tmp_path / "trial")
        running = Running(tmp_path, "trial", "run", "trial")
        running.until((tmp_path / "trial" / "reports").exists)
        wanted = "incomplete: trial/reports; not written: trial/timing.json"
    else:
        running = Running(tmp_path, "reproduce", "--out", "paper")
        running.until(lambda: len(running.members()) >= 4)
        wanted = "not written: paper/table1.png"
    lines = running.interrupt(whole_group)
    assert lines[0].startswith("model: ")
    assert len(lines) == 2, lines
    assert lines[1].startswith(f"hand {command}: interrupted; ")
    assert wanted in lines[1]


def opened_by_reader(pipe: Path, writers: list[int]) -> bool:
    """Whether a process opens a named pipe to read from it; it waits there until the writer is closed."""
    try:
        writers.append(os.open(pipe, os.O_WRONLY | os.O_NONBLOCK))
    except OSError:
        return False
    return True


def test_many_recordings_leave_an_index(tmp_path: Path) -> None:
    """Fails when Ctrl-C writes no page of the recordings that are done, or does not say how many are left."""
    (tmp_path / "bad.mcap").write_text("nothing\n", encoding="utf-8")
    os.mkfifo(tmp_path / "waits.mcap")
    writers: list[int] = []
    running = Running(tmp_path, "diagnose", "bad.mcap", "waits.mcap", "--each", "--out", "report")
    running.until(lambda: opened_by_reader(tmp_path / "waits.mcap", writers))
    lines = running.interrupt(whole_group=False)
    os.close(writers[0])
    written = "written: report/index.html; not written: report/findings.parquet, report/summary.json"
    assert lines[-1] == f"hand diagnose: interrupted; {written}"
    page = (tmp_path / "report" / "index.html").read_text(encoding="utf-8")
    wanted = "0 of 1 recordings differ from the model; 1 could not be used; interrupted, 1 not diagnosed yet"
    assert f"<title>{wanted}</title>" in page
