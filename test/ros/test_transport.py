"""Which profiles of Fast DDS a node uses."""

from __future__ import annotations

import os
from pathlib import Path
from xml.etree import ElementTree

import pytest

from hand_ros.transport import (
    ANYWHERE,
    FROM_FILE,
    IN_WORKING_FOLDER,
    LOOPBACK,
    ONLY_LOCAL,
    PEERS,
    PROFILES,
    RANGE,
    use_profiles,
)

CONFIG = Path(__file__).parents[2] / "config"


def test_our_profiles_are_used_where_the_user_has_none(tmp_path: Path) -> None:
    """Fails when readers keep the memory of the largest message, or Fast DDS is to use a missing file."""
    environment: dict[str, str] = {}
    assert use_profiles(CONFIG, environment, tmp_path)
    assert environment == {PROFILES[0]: str(CONFIG / ANYWHERE), FROM_FILE: "1"}
    assert not use_profiles(tmp_path, environment := {}, tmp_path)
    assert environment == {}


def test_one_machine_alone_is_served_without_shared_memory(tmp_path: Path) -> None:
    """Fails when a program that joins may stop a publisher, or a node is heard beyond the loopback interface."""
    environment = {RANGE: "LOCALHOST"}
    assert use_profiles(CONFIG, environment, tmp_path)
    assert environment == {PROFILES[0]: str(CONFIG / LOOPBACK), FROM_FILE: "1", RANGE: "SYSTEM_DEFAULT"}
    root = ElementTree.parse(CONFIG / LOOPBACK).getroot()
    text = {element.tag.rpartition("}")[2]: element.text for element in root.iter()}
    assert text["type"] == "UDPv4" and text["useBuiltinTransports"] == "false" and text["address"] == "127.0.0.1"
    assert sum(element.tag.endswith("}transport_descriptor") for element in root.iter()) == 1
    for other in ({PEERS: "10.0.0.2"}, {ONLY_LOCAL: "1"}):
        environment = {RANGE: "LOCALHOST"} | other
        assert use_profiles(CONFIG, environment, tmp_path)
        assert environment[PROFILES[0]] == str(CONFIG / ANYWHERE) and environment[RANGE] == "LOCALHOST"


@pytest.mark.parametrize("name", [*PROFILES, FROM_FILE])
def test_the_profiles_of_a_user_come_first(name: str, tmp_path: Path) -> None:
    """Fails when a setting of the user is replaced or mixed with ours."""
    environment = {name: "theirs", RANGE: "LOCALHOST"}
    assert not use_profiles(CONFIG, environment, tmp_path)
    assert environment == {name: "theirs", RANGE: "LOCALHOST"}
    (tmp_path / IN_WORKING_FOLDER).touch()
    assert not use_profiles(CONFIG, {}, tmp_path)


@pytest.mark.parametrize("name", [ANYWHERE, LOOPBACK])
def test_the_profiles_name_both_kinds_of_endpoint(name: str) -> None:
    """Fails when a kind of endpoint is left to the defaults of Fast DDS, which refuse messages of unknown size."""
    policies = {
        element.tag.rpartition("}")[2]: policy.text
        for element in ElementTree.parse(CONFIG / name).getroot()[0]
        for policy in element
        if policy.tag.endswith("historyMemoryPolicy")
    }
    assert policies == {"data_writer": "PREALLOCATED_WITH_REALLOC", "data_reader": "DYNAMIC"}
    assert os.access(CONFIG / name, os.R_OK)
