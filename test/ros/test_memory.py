"""Memory of large messages is given back, and neither collections nor the first line of the log stop a node."""

from __future__ import annotations

import gc
import subprocess
import sys
import weakref
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from rclpy.lifecycle import TransitionCallbackReturn

from hand_ros.memory import spare_collections
from hand_ros.node import HandNode

ROOT = Path(__file__).parents[2]
CODE = """
import sys
from pathlib import Path
from hand_ros.memory import return_large_blocks

def resident():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096

if sys.argv[1] == "set":
    assert return_large_blocks()
before = resident()
for _ in range(5):
    block = bytes(20_000_000)
    other = bytearray(b"x" * 100_000)
    del block
print(resident() - before)
"""


def test_large_blocks_go_back_to_the_system() -> None:
    """Fails when the setting is refused, or a freed message of 20 MB still belongs to the process."""
    done = subprocess.run([sys.executable, "-c", CODE, "set"], capture_output=True, text=True, check=True)
    assert int(done.stdout) < 5_000_000


def test_memory_in_use_is_locked_and_given_back() -> None:
    """Fails when the system may take back what a node uses, or a freed block stays locked."""
    code = """
from pathlib import Path
from hand_ros.memory import lock_memory, return_large_blocks

def locked_bytes():
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * int(next(line.split()[1] for line in lines if line.startswith("VmLck")))

return_large_blocks()
print(lock_memory(), locked_bytes())
block = bytes(50_000_000)
print(locked_bytes())
del block
print(locked_bytes())
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    allowed, before, with_block, after = done.stdout.split()
    if allowed == "False":
        pytest.skip("this user may not lock memory (ulimit -l)")
    assert int(before) > 10_000_000
    assert int(with_block) - int(before) > 45_000_000 > 5_000_000 > abs(int(after) - int(before))


class Link:
    """An object that may refer to itself."""

    other: object = None


@pytest.fixture
def thawed() -> Iterator[None]:
    """The collector as it was."""
    yield
    gc.unfreeze()


@pytest.mark.usefixtures("thawed")
def test_a_collection_leaves_out_what_a_node_has_set_up() -> None:
    """Fails when a collection in motion visits the objects of the compiler: it would take longer than 100 ms."""
    many = [[k] for k in range(1000)]
    assert any(known is many for known in gc.get_objects())
    spare_collections()
    assert not any(known is many for known in gc.get_objects())


@pytest.mark.usefixtures("thawed")
def test_what_an_earlier_setting_up_has_left_is_collected() -> None:
    """Fails when every configuration of a node keeps the objects of the one before for good."""
    link = Link()
    link.other, gone = link, weakref.ref(link)
    spare_collections()
    del link
    spare_collections()
    assert gone() is None


@pytest.mark.usefixtures("thawed")
def test_a_configured_node_has_done_so() -> None:
    """Fails when a node is configured without it."""
    gc.unfreeze()
    node = SimpleNamespace(values={}, table=(), configure=lambda _: None)
    assert HandNode.on_configure(cast(Any, node), cast(Any, None)) == TransitionCallbackReturn.SUCCESS
    assert node.configured and gc.get_freeze_count() > 1000


FIRST_LINE = """
import inspect, sys
from types import SimpleNamespace
from rclpy.logging import get_logger
from hand_ros.node import HandNode

if sys.argv[1] == "configured":
    HandNode.on_configure(SimpleNamespace(values={}, table=(), configure=lambda _: None), None)
asked, inner = 0, inspect.getabsfile

def counted(*args):
    global asked
    asked += 1
    return inner(*args)

inspect.getabsfile = counted
get_logger("node").info("healthy")
print(asked, len(sys.modules))
"""


@pytest.mark.parametrize("state", ["configured", "new"])
def test_the_first_line_of_the_log_does_not_look_through_all_modules(state: str) -> None:
    """Fails when a node that moves the hand stops for 45 ms with its first line; without a configuration it does."""
    done = subprocess.run([sys.executable, "-c", FIRST_LINE, state], capture_output=True, text=True, check=True)
    asked, modules = map(int, done.stdout.split())
    assert asked < 20 if state == "configured" else asked > modules / 2, (asked, modules)
