"""The order of the test files over the test processes."""

from __future__ import annotations

import os
from types import SimpleNamespace
from typing import Any

import pytest

from test.order import Files, in_real_time

WORKER = os.environ.get("PYTEST_XDIST_WORKER", "gw0")
TESTS = [f"test/{path}.py::test_{k}" for path in ("validation/a", "model/b", "model/c", "nodes/d") for k in range(4)]


class Process:
    """Notes which tests it gets."""

    shutting_down = False

    def __init__(self, name: str) -> None:
        self.gateway, self.got = SimpleNamespace(id=name), list[str]()

    def send_runtest_some(self, indices: list[int]) -> None:
        self.got += [TESTS[k] for k in indices]

    def shutdown(self) -> None:
        """Nothing is left."""


@pytest.mark.parametrize("names", [("gw0", "gw1"), ("gw1", "gw0"), ("gw2", "gw0", "gw1"), ("gw0",)])
def test_the_first_process_gets_all_tests_in_real_time_after_one_file(names: tuple[str, ...]) -> None:
    """Fails when another process gets a test with deadlines, they wait for a second file, or a test is lost."""
    option = SimpleNamespace(tx=["popen"] * len(names), loadscopereorder=True)
    config: Any = SimpleNamespace(option=option, getvalue=lambda _: option.tx)
    files, processes = Files(config), [Process(name) for name in names]
    files.numnodes = len(names)
    for process in processes:
        files.add_node(process)  # type: ignore[arg-type]
    for process in processes:
        files.add_node_collection(process, TESTS)  # type: ignore[arg-type]
    files.schedule()
    ended = 0
    while any(ended < len(process.got) for process in processes):
        for process in processes:
            if ended < len(process.got):
                files.mark_test_complete(process, TESTS.index(process.got[ended]))  # type: ignore[arg-type]
        ended += 1
    first = next(process for process in processes if process.gateway.id == "gw0")
    assert [in_real_time(nodeid) for nodeid in first.got[4:8]] == [True] * 4
    assert sorted(nodeid for process in processes for nodeid in process.got) == sorted(TESTS)


def test_other_processes_take_what_is_left_of_the_machine() -> None:
    """Fails when a process that only computes delays one with deadlines."""
    assert os.sched_getscheduler(0) == (os.SCHED_OTHER if WORKER == "gw0" else os.SCHED_IDLE)
