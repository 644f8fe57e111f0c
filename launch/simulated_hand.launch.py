"""Launch the simulated hand and its controller: ros2 launch fluidic_hand simulated_hand.launch.py."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description() -> LaunchDescription:
    config = PathJoinSubstitution([FindPackageShare("fluidic_hand"), "config"])
    namespace = LaunchConfiguration("namespace")
    description = {"hand_description": ParameterValue(LaunchConfiguration("hand_description"), value_type=str)}
    return LaunchDescription(
        [
            DeclareLaunchArgument("namespace", default_value="hand", description="namespace of all nodes"),
            DeclareLaunchArgument(
                "hand_description",
                default_value=PathJoinSubstitution([config, "hand.yaml"]),
                description="path of the description of the hand, hand.yaml",
            ),
            DeclareLaunchArgument("record", default_value="false", description="record every topic of the namespace"),
            Node(package="fluidic_hand", executable="simulation", namespace=namespace, parameters=[description]),
            Node(
                package="fluidic_hand",
                executable="controller",
                namespace=namespace,
                parameters=[PathJoinSubstitution([config, "controller.yaml"]), description],
            ),
            Node(
                package="fluidic_hand",
                executable="recorder",
                namespace=namespace,
                condition=IfCondition(LaunchConfiguration("record")),
            ),
        ]
    )
