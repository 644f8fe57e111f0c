"""The node frame_publisher: robot_description and TF where no robot_state_publisher is. The only rclpy module here.

It publishes the topics of robot_state_publisher with their names, types and QoS. Only one node may publish
robot_description in a namespace: while another one does, this node publishes nothing.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from hand_messages.health import Health, Level
from hand_model.description import load_hand
from hand_model.geometry import frame_prefix
from hand_robot.frames import Transform, transforms_of
from hand_robot.urdf import Mount, urdf_text
from hand_ros.node import RETAINED_QOS, SENSOR_QOS, HandNode, default_config, end, run
from hand_ros.parameters import NodeParameter, ParameterError

DESCRIPTION = "robot_description"
TF_QOS = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
SEARCH_S = 0.5
"""Period of the search for another publisher of robot_description."""
PARAMETERS = (
    NodeParameter("hand_description", "", "path of hand.yaml; if empty, the installed file"),
    NodeParameter("joint_prefix", "", "beginning of the names of joints and frames; if empty, that of hand.yaml"),
    NodeParameter("mount", "", "parent link of the hand in robot_description; empty: none"),
    NodeParameter("mount_xyz_m", [0.0, 0.0, 0.0], "position of the hand in the frame of the mount [m]"),
    NodeParameter("mount_rpy_rad", [0.0, 0.0, 0.0], "roll, pitch and yaw in the frame of the mount [rad]"),
    NodeParameter("frame_rate_hz", 30.0, "largest rate of /tf [Hz]", 1.0, 1000.0),
)


class FramePublisher(HandNode):
    """Publishes the description once, for late subscribers too, and the frames as joint_states move them."""

    def __init__(self) -> None:
        """Declare parameters."""
        super().__init__("frame_publisher", PARAMETERS)
        self._offered: list[Any] = []
        self._joints: Any = None
        self._raw = b""
        self._other = ""

    def configure(self, values: dict[str, Any]) -> None:
        """Write the URDF of the hand, from which the frames follow."""
        path = Path(values["hand_description"] or default_config("hand.yaml"))
        hand = load_hand(path, values["joint_prefix"])
        mount = Mount(values["mount"], _three(values, "mount_xyz_m"), _three(values, "mount_rpy_rad"))
        self.description = urdf_text(hand, mount, namespace=self.get_namespace().strip("/"))
        transforms = transforms_of(self.description, frame_prefix(hand, self.get_namespace()))
        self._fixed = [_message(transform) for transform in transforms if not transform.joint]
        self._moving = {
            transform.joint: (transform, _message(transform)) for transform in transforms if transform.joint
        }
        self._period_s = 1.0 / values["frame_rate_hz"]

    def described(self) -> str:
        """The node and how many joints it moves."""
        return f"{self.get_name()} of {len(self._moving)} joints"

    def start(self) -> None:
        """Publish, unless another node does."""
        self._joints = self.create_subscription(JointState, "joint_states", self._on_joints, SENSOR_QOS, raw=True)
        self._rounds = (
            self.create_timer(self._period_s, self._publish_frames),
            self.create_timer(SEARCH_S, self._search),
        )
        self._search()

    def stop(self) -> None:
        """Publish nothing any more."""
        for timer in self._rounds:
            self.destroy_timer(timer)
        self.destroy_subscription(self._joints)
        self._withdraw()

    def health(self) -> list[Health]:
        """Whether this node publishes, or which other one does."""
        if self._other:
            return [Health("frames", Level.OK, f"{self._other} publishes {DESCRIPTION}; this node publishes nothing")]
        return [Health("frames", Level.OK, f"{len(self._fixed) + len(self._moving)} frames")]

    def _search(self) -> None:
        """Withdraw while another node publishes the description; of two nodes of this kind one stays."""
        self._other = self.gives_way_to(DESCRIPTION)
        if self._other and self._offered:
            self.log_throttled(Level.OK, "other", f"{self._other} publishes {DESCRIPTION} too; this node withdraws")
            self._withdraw()
        elif not self._other and not self._offered:
            self._offer()

    def _offer(self) -> None:
        description = self.sole_publisher(String, DESCRIPTION, RETAINED_QOS)
        still = self.create_publisher(TFMessage, "/tf_static", RETAINED_QOS)
        self._offered = [description, still, self.create_publisher(TFMessage, "/tf", TF_QOS)]
        self.cycles = 0
        description.publish(String(data=self.description))
        stamp = self.get_clock().now().to_msg()
        for message in self._fixed:
            message.header.stamp = stamp
        still.publish(TFMessage(transforms=self._fixed))

    def _withdraw(self) -> None:
        if self._offered:
            description, *frames = self._offered
            self.destroy_sole_publisher(DESCRIPTION, description)
            for publisher in frames:
                self.destroy_publisher(publisher)
        self._offered = []
        self.cycles = None

    def _on_joints(self, raw: bytes) -> None:
        self._raw = raw

    def _publish_frames(self) -> None:
        raw, self._raw = self._raw, b""
        if not raw or not self._offered:
            return
        joints = deserialize_message(raw, JointState)
        moved = []
        for name, angle in zip(joints.name, joints.position, strict=False):
            if name not in self._moving:
                continue
            transform, message = self._moving[name]
            message.header.stamp = joints.header.stamp
            message.transform.rotation = _quaternion(transform, angle)
            moved.append(message)
        if moved:
            self._offered[2].publish(TFMessage(transforms=moved))
            self.cycles = (self.cycles or 0) + 1


def _three(values: dict[str, Any], name: str) -> tuple[float, float, float]:
    """Three finite numbers of a parameter. Raises ParameterError."""
    numbers = values[name]
    if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
        raise ParameterError(f"parameter {name} is {numbers}; it must be three numbers")
    return numbers[0], numbers[1], numbers[2]


def _message(transform: Transform) -> TransformStamped:
    message = TransformStamped(child_frame_id=transform.child)
    message.header.frame_id = transform.parent
    x, y, z = transform.xyz_m
    message.transform.translation = Vector3(x=x, y=y, z=z)
    message.transform.rotation = _quaternion(transform, 0.0)
    return message


def _quaternion(transform: Transform, angle_rad: float) -> Quaternion:
    x, y, z, w = transform.turned(angle_rad)
    return Quaternion(x=x, y=y, z=z, w=w)


def main() -> None:
    """Entry point of the executable `frame_publisher`."""
    end(run(FramePublisher))
