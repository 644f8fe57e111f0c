"""Launch driver and controller of a real hand: ros2 launch fluidic_hand hand.launch.py serial_port:=/dev/ttyUSB0."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

BOARD = {
    "transport": ("serial", str, "connection to the board: serial or can"),
    "serial_port": ("/dev/ttyUSB0", str, "device of the serial port"),
    "serial_baud": ("1000000", int, "bit rate of the serial port [bit/s]"),
    "can_interface": ("socketcan", str, "interface of python-can, for example socketcan"),
    "can_channel": ("can0", str, "channel of the CAN interface"),
    "can_bitrate": ("1000000", int, "bit rate of the CAN bus [bit/s]"),
}
"""Default, type and description of the driver's parameters for its board."""


def generate_launch_description() -> LaunchDescription:
    config = PathJoinSubstitution([FindPackageShare("fluidic_hand"), "config"])
    namespace = LaunchConfiguration("namespace")
    description = {"hand_description": ParameterValue(LaunchConfiguration("hand_description"), value_type=str)}
    board = {name: ParameterValue(LaunchConfiguration(name), value_type=kind) for name, (_, kind, _) in BOARD.items()}
    return LaunchDescription(
        [
            DeclareLaunchArgument("namespace", default_value="hand", description="namespace of all nodes"),
            DeclareLaunchArgument(
                "hand_description",
                default_value=PathJoinSubstitution([config, "hand.yaml"]),
                description="path of the description of the hand, hand.yaml",
            ),
            *(DeclareLaunchArgument(name, default_value=v, description=d) for name, (v, _, d) in BOARD.items()),
            Node(package="fluidic_hand", executable="driver", namespace=namespace, parameters=[description, board]),
            Node(
                package="fluidic_hand",
                executable="controller",
                namespace=namespace,
                parameters=[PathJoinSubstitution([config, "controller.yaml"]), description],
            ),
        ]
    )
