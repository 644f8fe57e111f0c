"""A full disk while the recorder writes: it ends with one line, and the file can be read or repaired.

The limit is that of one process for the size of a file, which gives the same error at the same place as a full disk.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from hand_recording.loader import load_recording
from validation.faults.live import Nodes, TooLateError, User
from validation.faults.result import FaultResult, Size, Tally

FAMILY = "disk"
LIMITED = ("bash", "-c", 'ulimit -f "$1"; shift; exec "$@"', "limit")
BLOCKS = (64, 400, 2000)
"""Largest size of a file in units of 1,024 bytes."""
FILL_S = 90.0


def run(size: Size, seed: int) -> list[FaultResult]:
    """Each storage at each limit; quick: the smallest limit."""
    tally = Tally(FAMILY, "full disk while recording", seed, real_time=True)
    with tempfile.TemporaryDirectory() as folder, Nodes(Path(folder)) as nodes:
        user = User()
        try:
            nodes.node("simulation")
            nodes.node("controller")
            user.drive()
            for blocks in BLOCKS[: size.of(1, 2, len(BLOCKS))]:
                for storage in ("mcap", "sqlite3"):
                    one_case(nodes, user, tally, storage, blocks)
        finally:
            user.close()
    return [tally.result()]


def one_case(nodes: Nodes, user: User, tally: Tally, storage: str, blocks: int) -> None:
    """Record until the limit is reached."""
    out = nodes.folder / f"{storage}_{blocks}"
    name = f"{storage}, {blocks} kB"
    (nodes.folder / "recorder.log").unlink(missing_ok=True)
    recorder = nodes.node("recorder", *LIMITED, str(blocks), out=out, storage=storage)
    try:
        user.until(lambda: recorder.poll() is not None, "the recorder does not end", FILL_S)
    except TooLateError as error:
        nodes.end("recorder")
        tally.case(f"{name}: {error}", False)
        return
    nodes.running.pop("recorder")
    fault = fault_of(out, nodes.log("recorder"), recorder.returncode)
    tally.case(f"{name}: {fault}", not fault)
    if user.latched:
        tally.case(f"{name}: the hand was vented", False)


def fault_of(out: Path, log: str, code: int) -> str:
    """What is wrong with the end of a recorder; empty where nothing is."""
    if "Traceback" in log:
        return "traceback"
    if code != 2:
        return f"exit code {code}"
    try:
        if "joint_states" in load_recording(out):
            return ""
    except (ValueError, OSError) as error:
        return "" if "--repair" in str(error) or "--repair" in log else f"not readable: {error}"
    return "no joint_states in it"
