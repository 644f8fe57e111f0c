"""A real hand and its controller: ros2 launch fluidic_hand hand.launch.py serial_port:=/dev/ttyUSB0"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

BOARD = {
    "transport": ("serial", str),
    "serial_port": ("/dev/ttyUSB0", str),
    "serial_baud": ("1000000", int),
    "can_interface": ("socketcan", str),
    "can_channel": ("can0", str),
    "can_bitrate": ("1000000", int),
}


def generate_launch_description() -> LaunchDescription:
    config = PathJoinSubstitution([FindPackageShare("fluidic_hand"), "config"])
    namespace = LaunchConfiguration("namespace")
    description = {"hand_description": ParameterValue(LaunchConfiguration("hand_description"), value_type=str)}
    board = {name: ParameterValue(LaunchConfiguration(name), value_type=kind) for name, (_, kind) in BOARD.items()}
    return LaunchDescription(
        [
            DeclareLaunchArgument("namespace", default_value="hand"),
            DeclareLaunchArgument(
                "hand_description",
                default_value=PathJoinSubstitution([config, "hand.yaml"]),
                description="path of hand.yaml",
            ),
            *(DeclareLaunchArgument(name, default_value=default) for name, (default, _) in BOARD.items()),
            Node(package="fluidic_hand", executable="driver", namespace=namespace, parameters=[description, board]),
            Node(
                package="fluidic_hand",
                executable="controller",
                namespace=namespace,
                parameters=[PathJoinSubstitution([config, "controller.yaml"]), description],
            ),
        ]
    )
