"""What the launch files start, as plain data without importing launch: their arguments, and nodes with parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hand_robot.state_publisher import state_publisher
from hand_robot.urdf import Mount

CONFIG = "config/"
"""Beginning of a default that is a file of the package."""


def _three(text: str) -> tuple[float, ...]:
    numbers = tuple(float(part) for part in text.split())
    if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
        raise ValueError
    return numbers


_READERS: dict[type, Any] = {
    str: str,
    int: int,
    bool: lambda text: {"true": True, "1": True, "false": False, "0": False}[text.lower()],
    tuple: _three,
}
_EXPECTED = {int: "a whole number", bool: "true or false", tuple: "three numbers, such as 0 0 0.05"}


@dataclass(frozen=True, slots=True)
class LaunchArgument:
    """An argument of hand.launch.py. kind: type of its value; tuple: three numbers."""

    name: str
    default: str
    description: str
    kind: type = str

    def value(self, text: str) -> Any:
        """The value that a text stands for. Raises ValueError, one line."""
        try:
            return _READERS[self.kind](text)
        except (ValueError, KeyError):
            raise ValueError(f"{self.name} is {text!r}; it must be {_EXPECTED[self.kind]}") from None


BOARD = (
    LaunchArgument("transport", "serial", "connection to the board: serial or can"),
    LaunchArgument("serial_port", "/dev/ttyUSB0", "device of the serial port"),
    LaunchArgument("serial_baud", "1000000", "bit rate of the serial port [bit/s]", int),
    LaunchArgument("can_interface", "socketcan", "interface of python-can, for example socketcan"),
    LaunchArgument("can_channel", "can0", "channel of the CAN interface"),
    LaunchArgument("can_bitrate", "1000000", "bit rate of the CAN bus [bit/s]", int),
)
"""Parameters of the driver for its board."""
ARGUMENTS = (
    LaunchArgument("namespace", "hand", "namespace of all nodes"),
    LaunchArgument("simulated", "false", "start the simulation in place of the driver, and enable it", bool),
    LaunchArgument(
        "localhost_only",
        "true",
        "nodes of other machines can neither command nor listen; false: as the environment says",
        bool,
    ),
    LaunchArgument("hand_description", f"{CONFIG}hand.yaml", "path of the description of the hand, hand.yaml"),
    LaunchArgument(
        "joint_prefix", "", "beginning of the names of joints and frames, such as left_; empty: that of the file"
    ),
    LaunchArgument(
        "robot_state_publisher",
        "true",
        "publish robot_description and TF, by robot_state_publisher where it is installed, else by frame_publisher",
        bool,
    ),
    LaunchArgument("mount", "", "parent link of the hand in robot_description; empty: none"),
    LaunchArgument("mount_xyz", "0 0 0", "position of the hand in the frame of the mount [m]", tuple),
    LaunchArgument("mount_rpy", "0 0 0", "roll, pitch and yaw of the hand in the frame of the mount [rad]", tuple),
    LaunchArgument("parameter_file", f"{CONFIG}controller.yaml", "path of a parameter file of all nodes"),
    LaunchArgument("use_sim_time", "false", "use the time of /clock, which the simulation publishes", bool),
    LaunchArgument("log_level", "info", "debug, info, warn, error or fatal"),
    LaunchArgument("record", "false", "record every topic of the namespace", bool),
    LaunchArgument("recording", "", "new folder, or NAME.mcap, with record; empty: hand_DATE_TIME"),
    *BOARD,
)


def values_of(texts: Mapping[str, str]) -> dict[str, Any]:
    """Values of all arguments by name, from their texts. Raises ValueError, one line."""
    return {argument.name: argument.value(texts[argument.name]) for argument in ARGUMENTS}


def hand_nodes(values: Mapping[str, Any], publisher_installed: bool) -> list[dict[str, Any]]:
    """Arguments of the launch action Node for every node of a hand; the last entry of `parameters` is a dictionary.

    publisher_installed: whether robot_state_publisher is there.
    """
    described = {name: values[name] for name in ("hand_description", "joint_prefix")}
    common = {"use_sim_time": values["use_sim_time"], "exit_unconfigured": True}
    if values["simulated"]:
        clock = {"publish_clock": values["use_sim_time"], "exit_unconfigured": True}
        board = _node("simulation", values, described | clock)
        common["enabled_at_start"] = True  # nothing can be hurt; a real hand starts disabled
    else:
        board = _node("driver", values, described | {each.name: values[each.name] for each in BOARD} | common)
    nodes = [*_frames(values, publisher_installed), board, _node("controller", values, described | common)]
    if values["record"]:
        recording = {"use_sim_time": values["use_sim_time"], "out": values["recording"]}
        nodes.append(_node("recorder", values, recording))
    return nodes


def _node(executable: str, values: Mapping[str, Any], parameters: dict[str, Any]) -> dict[str, Any]:
    return {
        "package": "fluidic_hand",
        "executable": executable,
        "namespace": values["namespace"],
        "parameters": [values["parameter_file"], parameters],
        "ros_arguments": ["--log-level", values["log_level"]],
    }


def _frames(values: Mapping[str, Any], publisher_installed: bool) -> list[dict[str, Any]]:
    """The node that publishes robot_description and TF; none for a description that the other nodes refuse."""
    mount = Mount(values["mount"], values["mount_xyz"], values["mount_rpy"])
    names = ("hand_description", "namespace", "joint_prefix", "use_sim_time")
    node = state_publisher(**{name: values[name] for name in names}, mount=mount)
    if not values["robot_state_publisher"] or node is None:
        return []
    if publisher_installed:
        return [node | {"ros_arguments": ["--log-level", values["log_level"]]}]
    own = {name: values[name] for name in ("hand_description", "joint_prefix", "mount", "use_sim_time")}
    own |= {"mount_xyz_m": list(mount.xyz_m), "mount_rpy_rad": list(mount.rpy_rad), "exit_unconfigured": True}
    return [_node("frame_publisher", values, own)]
