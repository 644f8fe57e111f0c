"""The driver on real bytes: serial through a pty, CAN through slcan, an unplugged cable, bad ports."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hand_msgs.msg import BoardState, ValveCommand

if TYPE_CHECKING:
    from collections.abc import Callable

    from test.nodes.stack import Client, Stack


@pytest.mark.parametrize("link", ["serial", pytest.param("can", marks=pytest.mark.long)])
def test_the_studio_starts_the_hand_at_a_board_and_leaves_it_vented(stack: Stack, client: Client, link: str) -> None:
    """Fails when `hand studio` with a board needs more than its port, drives it unasked, or leaves a node."""
    path = str(stack.folder / "board")
    board = stack.start("hand", "emulate-board", f"--{link}", path)
    client.until(lambda: "ready" in stack.log("hand"))
    interface = ("--can-interface", "slcan") if link == "can" else ()
    words = ("studio", f"--{link}", path, *interface, "--no-browser", "--json", "--out", str(stack.folder))
    studio = stack.start("hand", *words)
    client.until(lambda: '"shown": "/hand"' in stack.log("hand"), 60.0)
    client.until_said("driver", "link", "connected")
    client.until_said("controller", "safety", "vented: not enabled")
    client.until(lambda: client.valves and len(client.joints) > 100)
    nodes = Path(f"/proc/{studio.pid}/task/{studio.pid}/children").read_text(encoding="utf-8").split()
    assert len(nodes) >= 2 and max(client.valves[-1].pressure) == 0.0
    assert stack.stop(studio) == 0 and stack.log("hand").endswith("hand studio: vented, nodes ended\n")
    assert not any(Path(f"/proc/{pid}").exists() for pid in nodes)
    assert board.poll() is None


@pytest.mark.parametrize("link", ["serial", "can"])
def test_the_same_controller_on_real_bytes(stack: Stack, client: Client, link: str) -> None:
    """Fails when the controller needs anything else to drive a board that speaks bytes."""
    path = str(stack.folder / "board")
    stack.start("hand", "emulate-board", f"--{link}", path)
    client.until(lambda: "ready" in stack.log("hand"))
    where = {"serial_port": path} if link == "serial" else {"can_interface": "slcan", "can_channel": path}
    stack.node("driver", transport=link, **where)
    stack.node("controller")
    client.controlling()
    client.heard()  # a command is lost on a controller that has not heard of this client
    client.command(index_proximal=0.7)
    client.until(lambda: abs(client.angle("index_proximal") - 0.7) < 0.02)
    assert client.level("driver", "link") == 0


def test_a_pulled_cable_vents_reconnects_and_repeats_no_stamp(stack: Stack, client: Client) -> None:
    """Fails when a stale value is published as new, the driver does not come back, or the hand re-arms by itself."""
    path = str(stack.folder / "board")
    board = stack.start("hand", "emulate-board", "--serial", path)
    client.until(lambda: "ready" in stack.log("hand"))
    stack.node("driver", serial_port=path)
    stack.node("controller")
    client.controlling()
    board.send_signal(signal.SIGUSR1)
    client.until(lambda: client.level("driver", "link") == 2)
    client.until(lambda: client.said("controller", "safety", "no usable sensor data"))
    before = len(client.joints)
    client.until(lambda: client.said("driver", "link", "connected") and client.level("driver", "link") == 0)
    client.until(lambda: len(client.joints) > before + 100)
    stamps = [(m.header.stamp.sec, m.header.stamp.nanosec) for m in client.joints]
    assert stamps == sorted(set(stamps))
    assert client.said("controller", "safety", "call reset")
    client.until(lambda: client.said("driver", "board", "vented") or max(client.valves[-1].pressure) == 0.0)


def test_an_unknown_port_is_named_and_retried(stack: Stack, client: Client) -> None:
    """Fails when a port that does not exist kills the driver or is not named."""
    driver = stack.node("driver", serial_port="/dev/nothing_here")
    client.until(lambda: client.said("driver", "link", "/dev/nothing_here"))
    assert client.level("driver", "link") == 2
    assert driver.poll() is None
    assert "Traceback" not in stack.log("driver")


def test_a_stuck_channel_is_named(stack: Stack, client: Client) -> None:
    """Fails when a broken wire is not named, or its joint is driven all the same."""
    path = str(stack.folder / "board")
    stack.start("hand", "emulate-board", "--serial", path, "--stuck", "3=65535")
    client.until(lambda: "ready" in stack.log("hand"))
    stack.node("driver", serial_port=path)
    stack.node("controller")
    client.until(lambda: client.said("driver", "channels", "index_proximal angle"))
    client.spin(1.0)
    assert not client.said("controller", "safety", "controlling")
    assert all(max(valve.pressure) == 0.0 for valve in client.valves)
    answer = client.enable(True)
    assert not answer.success
    assert "index_proximal angle (channel 3): at the rail, 65535 of" in answer.message


def driving(client: Client) -> Callable[[], None]:
    """A function that commands 50 kPa on every valve, as a node other than the controller would."""

    def drive() -> None:
        command = ValveCommand(name=client.joints[-1].name, pressure=[5e4] * len(client.joints[-1].name))
        command.header.stamp = client.node.get_clock().now().to_msg()
        command.lifetime.nanosec = 200_000_000
        client.valve_publisher.publish(command)

    return drive


def test_a_board_that_restarts_is_vented_until_a_reset(stack: Stack, client: Client) -> None:
    """Fails when the driver goes on with a board that was restarted, or drives it again without being asked."""
    path = str(stack.folder / "board")
    states: list[BoardState] = []
    client.node.create_subscription(BoardState, "board_state", states.append, 10)
    board = stack.start("hand", "emulate-board", "--serial", path)
    client.until(lambda: "ready" in stack.log("hand"))
    stack.node("driver", serial_port=path)
    client.until(lambda: client.joints and states and states[-1].protocol == 2)

    drive = driving(client)
    client.sending(drive, lambda: states[-1].fault == "" and max(states[-1].set_point, default=0.0) == 5e4)
    board.send_signal(signal.SIGUSR2)
    client.sending(drive, lambda: "the board was restarted" in states[-1].fault)
    client.until_said("driver", "safety", "call reset_driver")
    client.sending(drive, lambda: states[-1].protocol == 2 and max(states[-1].set_point, default=1.0) == 0.0)
    assert client.trigger("reset_driver").success
    before = len(states)
    client.sending(drive, lambda: len(states) > before + 3 and max(states[-1].set_point, default=0.0) == 5e4)


def test_a_board_that_sends_no_frames_is_vented_until_a_reset(stack: Stack, client: Client) -> None:
    """Fails when a board that hears but falls silent is driven on by a node other than the controller."""
    path = str(stack.folder / "board")
    states: list[BoardState] = []
    client.node.create_subscription(BoardState, "board_state", states.append, 10)
    board = stack.module("validation.faults.faulty_board", path, "mute")
    client.until(lambda: "ready" in stack.log("faulty_board"))
    stack.node("driver", serial_port=path)
    client.until(lambda: client.joints and states and states[-1].protocol == 2)
    drive = driving(client)
    client.sending(drive, lambda: states[-1].fault == "" and max(states[-1].set_point, default=0.0) == 5e4)
    board.send_signal(signal.SIGUSR1)
    client.sending(drive, lambda: "no measurement for 0.1 s" in states[-1].fault)
    client.until_said("driver", "safety", "call reset_driver")
    board.send_signal(signal.SIGUSR2)
    client.sending(drive, lambda: max(states[-1].set_point, default=1.0) == 0.0)
    client.until_said("driver", "commands", "a fault is latched (no measurement for 0.1 s")
    assert client.trigger("reset_driver").success
    client.sending(drive, lambda: max(states[-1].set_point, default=0.0) == 5e4)
