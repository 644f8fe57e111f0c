"""Which process runs which tests, and in which order."""

from __future__ import annotations

import pytest
from xdist.remote import Producer
from xdist.scheduler import LoadScopeScheduling
from xdist.workermanage import WorkerController

REAL_TIME = (
    "nodes/",
    "tool/test_demo",
    "recording/test_recorder_live",
    "driver/test_emulator.py",
    "driver/test_can_",
    "driver/test_c_board",
)
"""Tests of processes that keep deadlines, by the beginning of their path below test/."""
FIRST = ("validation/test_faults.py", "diagnosis/", "machine/", "validation/")
"""Tests in this order come first. The first file compiles what nodes start with; the diagnosis only computes, next to
tests in real time. At the end, the longest files would run while the other processes have nothing left.
"""


def in_real_time(nodeid: str) -> bool:
    """Whether a test keeps deadlines, by its path."""
    return nodeid.removeprefix("test/").startswith(REAL_TIME)


class Files(LoadScopeScheduling):
    """Gives whole files to test processes in order; all tests in real time to the first process, after one file."""

    def __init__(self, config: pytest.Config, log: Producer | None = None) -> None:
        """Begin without tests."""
        super().__init__(config, log)
        config.option.loadscopereorder = False  # the file with most tests is not the longest

    def _split_scope(self, nodeid: str) -> str:
        return "real time" if in_real_time(nodeid) else nodeid.split("::", maxsplit=1)[0]

    def _assign_work_unit(self, node: WorkerController) -> None:
        if "real time" in self.workqueue:
            first = node.gateway.id == "gw0"
            self.workqueue.move_to_end("real time", last=not (first and self.assigned_work[node]))
            if not first and len(self.workqueue) == 1:
                return
        super()._assign_work_unit(node)


def turn(nodeid: str) -> int:
    """The place of a test in the order of FIRST; tests in real time are the last."""
    if in_real_time(nodeid):
        return len(FIRST) + 1
    return next((k for k, first in enumerate(FIRST) if nodeid.removeprefix("test/").startswith(first)), len(FIRST))
