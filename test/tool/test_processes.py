"""The processes that a command starts: in which order they end, and which of them the others need."""

from __future__ import annotations

import stat
import time
from pathlib import Path

import pytest

from hand_tool.processes import ProcessError, Processes
from test.waiting import until

UNTIL_SIGINT = "trap 'echo $0 >> {ends}; exit 0' INT; echo ready; while :; do sleep 0.01; done"


@pytest.fixture
def nodes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A prefix with three executables that note their end, and one that ends by itself."""
    folder = tmp_path / "lib" / "fluidic_hand"
    folder.mkdir(parents=True)
    for name in ("driver", "controller", "viewer"):
        (folder / name).write_text(f"#!/bin/bash\n{UNTIL_SIGINT.format(ends=tmp_path / 'ends')}\n", encoding="utf-8")
    (folder / "broken").write_text("#!/bin/bash\necho no such thing\nexit 3\n", encoding="utf-8")
    for path in folder.iterdir():
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    return tmp_path


def test_the_controller_ends_first_and_what_is_optional_last(nodes: Path) -> None:
    """Fails when a viewer that hangs would delay the vent of the hand, or the driver ends before the controller."""
    with Processes(nodes / "logs") as processes:
        processes.start("driver", ["driver"])
        processes.start("controller", ["controller"])
        processes.start("viewer", ["viewer"], optional=True)
        until(lambda: all((nodes / "logs" / f"{n}.log").read_text("utf-8") for n in ("driver", "controller", "viewer")))
    ended = [Path(line).name for line in (nodes / "ends").read_text("utf-8").splitlines()]
    assert ended == ["controller", "driver", "viewer"]


def test_a_prepared_node_starts_with_go_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails when a real node that was prepared starts without `go`, not with it, or does not end with its program."""
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    command = ["frame_publisher", "--ros-args", "-p", "hand_description:=nowhere.yaml", "-p", "exit_unconfigured:=true"]
    with Processes(tmp_path / "never") as given_up:
        given_up.prepare("frame_publisher", command)
        time.sleep(3.0)  # twice as long as the node takes to print its line where nothing holds it
        given_up.check()
    assert (tmp_path / "never" / "frame_publisher.log").read_text("utf-8") == ""
    with Processes(tmp_path / "started") as ready:
        ready.prepare("frame_publisher", command)
        ready.go()
        ready.go()  # one that has started already is not disturbed
        until(lambda: "nowhere.yaml" in (tmp_path / "started" / "frame_publisher.log").read_text("utf-8"))


def test_only_a_needed_process_ends_the_others(nodes: Path) -> None:
    """Fails when the end of an optional process ends a hand, is not named once, or that of a needed one is not seen."""
    with Processes(nodes / "logs") as processes:
        processes.start("viewer", ["broken"], optional=True)
        line = ""

        def lost() -> bool:
            nonlocal line
            processes.check()
            line = line or processes.lost()
            return bool(line)

        until(lost)
        assert line == "viewer ended with code 3: no such thing" and processes.lost() == ""
        processes.start("driver", ["broken"])

        def ended() -> bool:
            try:
                processes.check()
            except ProcessError as error:
                assert str(error) == "driver ended with code 3: no such thing"
                return True
            return False

        until(ended)
