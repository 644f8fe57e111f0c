"""Command lines of the nodes of a hand: driver or simulation, controller, and what viewers need."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from hand_recording.installed import default_model


@dataclass(frozen=True, slots=True)
class Link:
    """How a hand is reached; without a port and a channel it is simulated.

    serial: port of a serial board.  can: channel of a CAN board, and can_interface its python-can interface.
    enabled: whether the controller drives a real hand at once, as it does a simulated one.
    """

    serial: str = ""
    can: str = ""
    can_interface: str = "socketcan"
    enabled: bool = False


def node_commands(link: Link, namespace: str, joint_prefix: str, model: Path) -> tuple[list[str], list[str]]:
    """Name of the executable and arguments of the driver, or the simulation, and of the controller."""
    driver, enabled = ["simulation", "--ros-args"], True
    if link.can:
        driver = ["driver", "--ros-args", "-p", "transport:=can", "-p", f"can_channel:={link.can}"]
        driver += ["-p", f"can_interface:={link.can_interface}"]
        enabled = link.enabled
    elif link.serial:
        driver = ["driver", "--ros-args", "-p", "transport:=serial", "-p", f"serial_port:={link.serial}"]
        enabled = link.enabled
    common = _common(namespace, joint_prefix, model)
    settings = default_model().with_name("controller.yaml")
    drive = ["controller", "--ros-args", "--params-file", str(settings), "-p", f"enabled_at_start:={enabled}"]
    return [*driver, *common], [*drive, *common]


def frames_command(namespace: str, joint_prefix: str, model: Path) -> list[str]:
    """Name of the executable and arguments of the node that publishes robot_description and TF."""
    return ["frame_publisher", "--ros-args", *_common(namespace, joint_prefix, model)]


def _common(namespace: str, joint_prefix: str, model: Path) -> list[str]:
    """Arguments of every node."""
    common = ["-r", f"__ns:=/{namespace.strip('/')}", "-p", f"hand_description:={model.resolve()}"]
    common += ["-p", "exit_unconfigured:=true"]
    return common + (["-p", f"joint_prefix:={joint_prefix}"] if joint_prefix else [])
