"""Who is a second publisher, where it runs, and how long the hand holds."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from hand_ros.processes import processes
from hand_ros.publishers import HOLD_S, QUIET_S, SUMMED_S, Conflict, Processes, Publisher, SolePublishers, Verdict

MS = 1_000_000
HERE, THERE = b"\x11\x22", b"\x33\x44"


def publisher(node: str, process: int, host: bytes = HERE, endpoint: int = 3) -> Publisher:
    prefix = b"\x01\x0f" + host + (process & 0xFFFF).to_bytes(2, "little") + b"\xaa\xbb" + bytes(4)
    return Publisher(node, prefix + endpoint.to_bytes(4, "big"))


class Machine:
    """The processes that run, by number, with their start times."""

    def __init__(self, **running: int) -> None:
        self.running = {int(name[1:]): start for name, start in running.items()}

    def __call__(self, low_bits: int) -> Processes:
        found = {number: start for number, start in self.running.items() if number & 0xFFFF == low_bits}
        return {number: (start, f"program {number}") for number, start in found.items()}


OWN = publisher("/hand/controller", 100)
OTHER = publisher("/hand/controller", 70_000)  # the same name, another process


def of(machine: Machine) -> SolePublishers:
    sole = SolePublishers(machine)
    sole.own("valve_command", OWN)
    return sole


def test_alone_is_no_conflict() -> None:
    """Fails when the only publisher of a topic, our own or another's, is a second one."""
    sole = of(Machine(p100=1, p200=2))
    assert sole.line() == ""
    sole.update("valve_command", [OWN])
    sole.update("joint_states", [publisher("/hand/driver", 200)])
    sole.update("pressures", [])
    assert sole.line() == ""
    assert sole.host == "1122"


def test_a_second_one_is_named_with_its_process_also_under_our_name() -> None:
    """Fails when our own publisher is named, or the line lacks the topic, the node, the process or its program."""
    sole = of(Machine(p100=1, p70000=2))
    sole.update("valve_command", [OTHER, OWN])
    line = "valve_command from /hand/controller on this machine (process 70000: program 70000)"
    assert sole.line() == f"second publisher: {line}; stop it"


def test_the_first_one_found_keeps_its_place() -> None:
    """Fails when a newcomer takes the place of the source that was there, or keeps being named when it is alone."""
    sole = of(Machine(p100=1, p200=2, p300=3))
    first, second = publisher("/hand/driver", 200), publisher("/hand/simulation", 300)
    sole.update("joint_states", [first])
    sole.update("joint_states", [second, first])
    assert sole.accepted("joint_states") == first.gid
    assert "from /hand/simulation" in sole.line() and "driver" not in sole.line()
    sole.update("joint_states", [second])
    assert (sole.line(), sole.accepted("joint_states")) == ("", second.gid)


def test_of_two_that_were_there_before_us_both_are_named() -> None:
    """Fails when one of two unknown sources is believed."""
    sole = of(Machine(p100=1, p200=2, p300=3))
    sole.update("joint_states", [publisher("/a", 200), publisher("/b", 300)])
    assert "from /a on" in sole.line() and "from /b on" in sole.line()
    assert sole.accepted("joint_states") == b""


def test_topics_of_one_node_are_one_part_of_the_line() -> None:
    """Fails when a second simulation is named once for each of its topics."""
    sole = of(Machine(p100=1, p200=2, p300=3))
    for topic, endpoint in (("joint_states", 3), ("pressures", 7)):
        first = publisher("/hand/simulation", 200, endpoint=endpoint)
        sole.update(topic, [first])
        sole.update(topic, [first, publisher("/hand/simulation", 300, endpoint=endpoint)])
    assert sole.line().count("/hand/simulation") == 1
    assert "joint_states, pressures from /hand/simulation" in sole.line()


def test_another_machine_and_another_middleware_say_what_is_known() -> None:
    """Fails when a machine is claimed that DDS does not give."""
    sole = of(Machine(p100=1, p200=2))
    sole.update("valve_command", [OWN, publisher("/x", 200, THERE)])
    assert "from /x on another machine (DDS host 3344; DDS does not give its address)" in sole.line()
    sole.update("valve_command", [OWN, Publisher("/y", bytes(range(16)))])
    assert "from /y (DDS identifier 000102" in sole.line() and "does not give its machine" in sole.line()
    sole.update("valve_command", [OWN, publisher("/z", 999)])  # here, but not visible: in a container
    assert "from /z on this machine (process number modulo 65536: 999)" in sole.line()


def test_a_killed_process_is_no_publisher_but_an_unseen_one_is() -> None:
    """Fails when a controller that was killed blocks its successor, or a hidden or reused process number is ignored."""
    machine = Machine(p100=1, p200=2)
    sole = of(machine)
    first, second = publisher("/hand/driver", 200), publisher("/hand/driver", 300)
    sole.update("joint_states", [first])
    del machine.running[200]
    machine.running[300] = 5
    sole.update("joint_states", [first, second])
    assert (sole.line(), sole.accepted("joint_states")) == ("", second.gid)
    machine.running[300] = 6  # another process with the number of the second
    third = publisher("/hand/driver", 400)
    sole.update("joint_states", [second, third])
    assert sole.accepted("joint_states") == third.gid
    sole.update("joint_states", [third, publisher("/z", 999), publisher("/w", 200, THERE)])
    assert "/z" in sole.line() and "/w" in sole.line()


def test_hold_then_vent_and_a_short_visit_is_a_hold() -> None:
    """Fails when a conflict vents at once, never vents, or lasts after the second publisher has left."""
    conflict = Conflict()
    assert conflict.update(0, "") is Verdict.ALONE
    assert conflict.update(10 * MS, "second") is Verdict.HOLD
    assert conflict.update(10 * MS + round(HOLD_S * 1e9) - 1, "second") is Verdict.HOLD
    assert conflict.update(10 * MS + round(HOLD_S * 1e9), "second") is Verdict.VENT
    gone_ns = 1000 * MS
    conflict.update(gone_ns, "second")
    assert conflict.update(gone_ns + round(QUIET_S * 1e9), "") is Verdict.VENT
    assert conflict.line == "second"
    assert conflict.update(gone_ns + round(QUIET_S * 1e9) + 1, "") is Verdict.ALONE
    assert conflict.line == ""
    assert conflict.update(5000 * MS, "third") is Verdict.HOLD
    assert conflict.update(5000 * MS + round(QUIET_S * 1e9) + 1, "") is Verdict.ALONE


def flapping(on_ms: int, off_ms: int, seconds: float, period_ms: int = 5) -> list[tuple[int, Verdict]]:
    """Time [ms] and verdict of each update while a second publisher comes and goes."""
    conflict, found = Conflict(), []
    for ms in range(0, round(seconds * 1e3), period_ms):
        present = ms % (on_ms + off_ms) < on_ms
        found.append((ms, conflict.update(ms * MS, "second" if present else "")))
    return found


@pytest.mark.parametrize(("on_ms", "off_ms", "period_ms"), [(380, 120, 5), (380, 120, 20), (5, 120, 5), (100, 900, 5)])
def test_a_second_publisher_that_comes_and_goes_vents(on_ms: int, off_ms: int, period_ms: int) -> None:
    """Fails when visits that are short each hold the hand for more than HOLD_S within SUMMED_S, or for ever."""
    found = flapping(on_ms, off_ms, 60.0, period_ms)
    vent_ms = next(ms for ms, verdict in found if verdict is Verdict.VENT)
    held_ms = period_ms * sum(verdict is Verdict.HOLD for ms, verdict in found if ms < vent_ms)
    assert held_ms <= 1e3 * HOLD_S + 2 * period_ms
    assert vent_ms < 1e3 * SUMMED_S


def test_rare_visits_are_holds() -> None:
    """Fails when visits of more than SUMMED_S ago count, or those of 2.5 s ago that are short enough together."""
    assert not any(verdict is Verdict.VENT for _, verdict in flapping(380, 5000, 60.0))
    assert not any(verdict is Verdict.VENT for _, verdict in flapping(100, 2400, 60.0))


def test_after_a_vent_the_sum_begins_again() -> None:
    """Fails when the next visit vents at once although the vent was latched and reset."""
    conflict = Conflict()
    assert [conflict.update(ms * MS, "second") for ms in (0, 600)] == [Verdict.HOLD, Verdict.VENT]
    assert conflict.update(800 * MS, "") is Verdict.ALONE
    assert conflict.update(900 * MS, "second") is Verdict.HOLD


def test_our_own_process_is_found_in_proc(tmp_path: Path) -> None:
    """Fails when a live process is not found by its low bits, or a damaged entry ends the search."""
    found = processes(os.getpid() & 0xFFFF)
    start, command = found[os.getpid()]
    assert start > 0 and "python" in command and len(command) <= 80
    (tmp_path / "sys/kernel").mkdir(parents=True)
    (tmp_path / "sys/kernel/pid_max").write_text("200000\n", encoding="ascii")
    for number, stat in ((7, "7 (a) b) R " + " ".join(str(k) for k in range(4, 40))), (65543, "65543 (x) S 1")):
        (tmp_path / str(number)).mkdir()
        (tmp_path / str(number) / "stat").write_text(stat, encoding="ascii")
        (tmp_path / str(number) / "cmdline").write_bytes(b"")
    assert processes(7, tmp_path) == {7: (22, "no command line")}
    assert processes(8, tmp_path) == {}


def test_a_node_gives_way_to_another_of_the_same_topic() -> None:
    """Fails when two nodes publish one description, both of one name withdraw, or one that was killed still counts."""
    machine = Machine(p100=1, p200=2, p300=3)
    sole, topic, name = of(machine), "robot_description", "/hand/frame_publisher"
    own, twin = publisher(name, 300), publisher(name, 200)
    assert own.gid < twin.gid
    foreign = publisher("/hand/robot_state_publisher", 100)
    assert sole.gives_way_to(topic, [], name) is None
    assert sole.gives_way_to(topic, [twin], name) == twin
    sole.own(topic, own)
    assert sole.gives_way_to(topic, [own, twin], name) is None
    assert sole.gives_way_to(topic, [own, foreign], name) == foreign
    del machine.running[100]
    assert sole.gives_way_to(topic, [own, foreign], name) is None
    sole.disown(topic)
    sole.own(topic, twin)
    assert sole.gives_way_to(topic, [own, twin], name) == own
