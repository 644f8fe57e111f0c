"""Memory of large messages is given back, and collections do not stop a node."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import weakref
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast
from xml.etree import ElementTree

import pytest

from hand_ros.memory import FROM_FILE, IN_WORKING_FOLDER, PROFILES, spare_collections, use_profiles
from hand_ros.node import HandNode, TransitionCallbackReturn

FILE = Path(__file__).parents[2] / "config" / "fastdds.xml"
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


def test_our_profiles_are_used_where_the_user_has_none(tmp_path: Path) -> None:
    """Fails when readers keep the memory of the largest message, or Fast DDS is to use a missing file."""
    environment: dict[str, str] = {}
    assert use_profiles(FILE, environment, tmp_path)
    assert environment == {PROFILES[0]: str(FILE), FROM_FILE: "1"}
    assert not use_profiles(tmp_path / "missing.xml", environment := {}, tmp_path)
    assert environment == {}


@pytest.mark.parametrize("name", [*PROFILES, FROM_FILE])
def test_the_profiles_of_a_user_come_first(name: str, tmp_path: Path) -> None:
    """Fails when a setting of the user is replaced or mixed with ours."""
    environment = {name: "theirs"}
    assert not use_profiles(FILE, environment, tmp_path)
    assert environment == {name: "theirs"}
    (tmp_path / IN_WORKING_FOLDER).touch()
    assert not use_profiles(FILE, {}, tmp_path)


def test_the_profiles_name_both_kinds_of_endpoint() -> None:
    """Fails when a kind of endpoint is left to the defaults of Fast DDS, which refuse messages of unknown size."""
    policies = {
        element.tag.rpartition("}")[2]: policy.text
        for element in ElementTree.parse(FILE).getroot()[0]
        for policy in element
        if policy.tag.endswith("historyMemoryPolicy")
    }
    assert policies == {"data_writer": "PREALLOCATED_WITH_REALLOC", "data_reader": "DYNAMIC"}
    assert os.access(FILE, os.R_OK)


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
    assert any(one is many for one in gc.get_objects())
    spare_collections()
    assert not any(one is many for one in gc.get_objects())


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
