"""What is recorded, in which order it is written, and what is reported about it: the recorder without ROS."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hand_recording.bag_contents import Contents
from hand_recording.bag_writer import STEP_NS, Arrival, Arrivals
from hand_recording.message_types import UnknownType, definition, same_definition
from hand_recording.record_options import RecordOptions, Selection


@dataclass
class _Bag:
    """Keeps what is written."""

    log_ns: list[int] = field(default_factory=list)
    raws: list[bytes] = field(default_factory=list)
    contents: Contents = field(default_factory=Contents)

    def add_topic(self, topic: object) -> None:
        raise NotImplementedError

    def write(self, topic: str, raw: bytes, log_ns: int, publish_ns: int, sequence: int = 0) -> None:
        self.log_ns.append(log_ns)
        self.raws.append(raw)

    def tick(self, now_ns: int) -> None:
        raise NotImplementedError

    def close(self) -> None:
        raise NotImplementedError


@given(st.lists(st.lists(st.integers(0, STEP_NS // 2), max_size=9), max_size=9), st.integers(0, STEP_NS // 2))
def test_messages_are_written_once_and_in_order_of_receipt(rounds: list[list[int]], until_ns: int) -> None:
    """Breaks when log times run backwards in the file, or a message is lost or doubled between rounds."""
    bag = _Bag()
    arrivals = Arrivals(bag)
    expected = []
    for number, batch in enumerate(rounds):
        for index, log_ns in enumerate(batch):
            expected.append(b"%d %d" % (number, index))
            arrivals.add(Arrival(log_ns, f"/{index % 2}", expected[-1], 0, 0), True)
        arrivals.write(until_ns)
    arrivals.write(sys.maxsize)
    assert sorted(bag.raws) == sorted(expected)
    assert bag.log_ns == sorted(bag.log_ns)


def test_what_comes_later_waits_for_its_turn() -> None:
    """Breaks when a message received during a round is written before older ones of another topic."""
    bag = _Bag()
    arrivals = Arrivals(bag)
    arrivals.add(Arrival(11, "/a", b"late", 0, 1), True)
    arrivals.write(10)
    assert not bag.raws
    arrivals.add(Arrival(9, "/b", b"early", 0, 1), True)
    arrivals.write(20)
    assert bag.raws == [b"early", b"late"]


def test_a_clock_set_back_is_believed() -> None:
    """Breaks when after a step of the system clock all messages get the same log time."""
    bag = _Bag()
    arrivals = Arrivals(bag)
    for log_ns in (5 * STEP_NS, 1 * STEP_NS, 1 * STEP_NS + 5, 1 * STEP_NS + 3):
        arrivals.add(Arrival(log_ns, "/a", b"", 0, 0), True)
        arrivals.write(sys.maxsize)
    assert bag.log_ns == [5 * STEP_NS, STEP_NS, STEP_NS + 5, STEP_NS + 5]


def test_gaps_in_the_sequence_are_counted() -> None:
    """Breaks when a loss is not reported, or a new publisher or several of them look like one."""
    arrivals = Arrivals(_Bag())
    for sequence in (7, 8, 11, 12, 1, 2):
        arrivals.add(Arrival(0, "/a", b"", 0, sequence), True)
        arrivals.add(Arrival(0, "/b", b"", 0, sequence), False)
        arrivals.add(Arrival(0, "/c", b"", 0, 0), True)
    assert arrivals.missed == {"/a": 2}


def test_the_hand_and_what_belongs_to_it_is_recorded() -> None:
    """Breaks when a topic of the hand is missing in a recording, or the whole machine gets into it."""
    choice = Selection()
    assert all(map(choice.wants, ("/hand/adc", "/hand/a/b", "/diagnostics", "/clock", "/tf", "/tf_static")))
    assert not any(map(choice.wants, ("/hand", "/handy/adc", "/rosout", "/hand/grasp/_action/status", "/x")))
    assert Selection(rosout=True).wants("/rosout")
    assert Selection(("left",)).wants("/left/adc")
    assert Selection(("/",)).wants("/x/y")
    named = Selection(topics=("hand/adc", "/hand/grasp/_action/status"))
    assert [t for t in ("/hand/adc", "/diagnostics", "/hand/grasp/_action/status") if named.wants(t)] == [
        "/hand/adc",
        "/hand/grasp/_action/status",
    ]


@pytest.mark.parametrize("duration_s", [0.0, -1.0, float("nan"), float("inf")])
def test_durations_that_are_not_valid_are_refused(duration_s: float) -> None:
    """Breaks when a recording that can never end or start is begun."""
    with pytest.raises(ValueError, match="duration"):
        RecordOptions(Path("x"), duration_s=duration_s)


def test_definitions_come_from_the_sourced_workspace_first(tmp_path: Path) -> None:
    """Breaks when a type that only the workspace has, or one that it refers to, cannot be recorded."""
    (tmp_path / "my_msgs" / "msg").mkdir(parents=True)
    (tmp_path / "my_msgs" / "msg" / "Outer.msg").write_text("my_msgs/Inner[] parts\nstd_msgs/Header header\n")
    (tmp_path / "my_msgs" / "msg" / "Inner.msg").write_text("float64 x\n")
    found = definition("my_msgs/msg/Outer", [tmp_path])
    assert "MSG: my_msgs/Inner\nfloat64 x" in found.text
    assert found.type_hash.startswith("RIHS01_")
    with pytest.raises(UnknownType, match="source the workspace that has no_msgs"):
        definition("no_msgs/msg/Outer", [tmp_path])
    (tmp_path / "my_msgs" / "msg" / "Bad.msg").write_text("float64 = = x")
    with pytest.raises(UnknownType, match="cannot be read"):
        definition("my_msgs/msg/Bad", [tmp_path])


def test_another_definition_of_a_type_is_noticed() -> None:
    """Breaks when a recording made with another version of a message is decoded as this one."""
    text = definition("hand_msgs/msg/JointPressures").text
    assert same_definition("hand_msgs/msg/JointPressures", text)
    assert not same_definition("hand_msgs/msg/JointPressures", text.replace("float64[] pressure", "float32[] pressure"))
    assert not same_definition("hand_msgs/msg/JointPressures", text.replace("int32 sec", "uint32 sec"))
    assert not same_definition("hand_msgs/msg/JointPressures", "?")
