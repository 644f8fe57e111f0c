"""A latched fault survives a restart of its node, and a file that cannot be used counts as a fault."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from hand_ros.fault_file import FaultFile, state_path

FAULT = "index_proximal: over-pressure, 6.40 bar"
SECOND_NS = 1_000_000_000


def file(folder: Path) -> FaultFile:
    return FaultFile(folder / "state" / "hand.controller.json", "/hand/controller")


def test_nothing_is_latched_at_first(tmp_path: Path) -> None:
    """Fails when a first start is taken for a restart after a fault, or leaves a file."""
    assert file(tmp_path).read() == ""
    assert list((tmp_path / "state").iterdir()) == []


def test_a_fault_is_read_again_until_it_is_cleared(tmp_path: Path) -> None:
    """Fails when a restart forgets the fault, its time or the node, or a cleared one comes back."""
    assert file(tmp_path).keep(FAULT, 0)
    lines = (tmp_path / "state" / "hand.controller.json").read_text(encoding="utf-8").splitlines()
    assert len(lines) == 1
    record = json.loads(lines[0])
    assert (record["fault"], record["node"], sorted(record)) == (FAULT, "/hand/controller", ["fault", "node", "time"])
    for _ in range(3):  # several restarts do not lengthen the line
        again = file(tmp_path)
        line = again.read()
        assert line == f"{FAULT} (latched {record['time']}, before a restart)"
        assert again.keep(line, 0)
    again.clear()
    assert file(tmp_path).read() == ""
    assert again.keep(FAULT, 0)  # the same fault once more
    assert FAULT in file(tmp_path).read()


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "it is not JSON"),
        (b"{", "it is not JSON"),
        (b"\xff\xfe", "it is not JSON"),
        (b"[]", "it has no text 'fault'"),
        (b'{"fault": "", "time": "now"}', "it has no text 'fault'"),
        (b'{"fault": 3, "time": "now"}', "it has no text 'fault'"),
        (b'{"fault": "x"}', "it has no text 'time'"),
        (b'"' + b"x" * 70_000 + b'"', "it is larger than 65536 bytes"),
    ],
)
def test_a_damaged_file_is_a_fault(tmp_path: Path, content: bytes, reason: str) -> None:
    """Fails when a file that cannot be understood passes for no fault, or the line does not say which file and why."""
    state = file(tmp_path)
    state.path.parent.mkdir()
    state.path.write_bytes(content)
    assert state.read() == f"the state file {state.path} cannot be used: {reason}"
    state.clear()
    assert file(tmp_path).read() == ""


def test_a_place_that_cannot_be_written_is_a_fault(tmp_path: Path) -> None:
    """Fails when a node starts that could not remember its latch, when `clear` hides it, or when another type hangs."""
    (tmp_path / "state").write_text("a file where the folder should be", encoding="utf-8")
    state = file(tmp_path)
    assert state.read() == f"the state file {state.path} cannot be used: File exists"
    with pytest.raises(OSError, match="File exists"):
        state.clear()
    (tmp_path / "other").mkdir()
    fifo = FaultFile(tmp_path / "other" / "x.json", "/hand/driver")
    os.mkfifo(fifo.path)
    assert "it is not a regular file" in fifo.read()
    dangling = FaultFile(tmp_path / "other" / "y.json", "/hand/driver")
    dangling.path.symlink_to(tmp_path / "nowhere")
    assert "it is not a regular file" in dangling.read()


def test_a_failed_write_is_reported_and_tried_again(tmp_path: Path) -> None:
    """Fails when a fault that cannot be stored is not reported, is tried at every call, or is never tried again."""
    state = file(tmp_path)
    assert state.read() == ""
    state.path.parent.rmdir()
    state.path.parent.write_text("in the way", encoding="utf-8")
    assert not state.keep(FAULT, 0)
    assert state.problem == f"the latched fault cannot be stored in {state.path}: File exists"
    state.path.parent.unlink()
    assert state.keep(FAULT, SECOND_NS // 2) and not state.path.exists()
    assert state.keep(FAULT, SECOND_NS) and state.path.exists()
    assert state.problem == ""
    assert list(state.path.parent.iterdir()) == [state.path]


def test_the_place_is_one_for_each_namespace_and_node() -> None:
    """Fails when two hands share a file, or the parameter or ROS_HOME is not used."""
    home = {"ROS_HOME": "/r"}
    assert state_path("", "/hand", "controller", home) == Path("/r/fluidic_hand/hand.controller.json")
    assert state_path("", "/left/hand", "driver", home) == Path("/r/fluidic_hand/left.hand.driver.json")
    assert state_path("", "/", "driver", home) == Path("/r/fluidic_hand/driver.json")
    assert state_path("", "/hand", "driver", {}) == Path("~/.ros/fluidic_hand/hand.driver.json").expanduser()
    assert state_path("/a/b.json", "/hand", "driver", home) == Path("/a/b.json")
