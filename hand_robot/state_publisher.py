"""The robot_state_publisher of a hand, for launch files: its arguments as plain data, without importing launch."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hand_model.description import DescriptionError, load_hand
from hand_model.geometry import frame_prefix
from hand_robot.urdf import Mount, urdf_text

PACKAGE = "robot_state_publisher"


def state_publisher(
    hand_description: str,
    namespace: str,
    joint_prefix: str = "",
    mount: Mount | None = None,
    use_sim_time: bool = False,
) -> dict[str, Any] | None:
    """Arguments of the launch action Node; None where the description has no geometry or cannot be read.

    hand_description: path of hand.yaml. The nodes of the hand report a description that cannot be read; a launch
    without its robot_state_publisher is otherwise complete.
    """
    try:
        hand = load_hand(Path(hand_description), joint_prefix)
        text = urdf_text(hand, mount, namespace=namespace)
    except (DescriptionError, ValueError, OSError):
        return None
    parameters = {
        "robot_description": text,
        "frame_prefix": frame_prefix(hand, namespace),
        "publish_frequency": 50.0,
        "use_sim_time": use_sim_time,
    }
    return {"package": PACKAGE, "executable": PACKAGE, "namespace": namespace, "parameters": [parameters]}
