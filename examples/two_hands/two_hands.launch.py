"""Launch two hands on two arms: ros2 launch examples/two_hands/two_hands.launch.py arm_prefix:=robot1_.

Each hand has a namespace and a prefix of its own. One robot_state_publisher publishes the frames of the whole robot;
joint_state_publisher joins the angles of both hands for it.
"""

from pathlib import Path

import xacro
from launch import Action, LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

HERE = Path(__file__).resolve().parent
SIDES = ("left", "right")


def hands(context: LaunchContext) -> list[Action]:
    """Both hands, simulated or real, and the frames of the robot."""
    arm_prefix = LaunchConfiguration("arm_prefix").perform(context)
    simulated = LaunchConfiguration("simulated").perform(context).lower() in ("true", "1")
    file = "simulated_hand.launch.py" if simulated else "hand.launch.py"
    source = PathJoinSubstitution([FindPackageShare("fluidic_hand"), "launch", file])
    actions: list[Action] = []
    for side in SIDES:
        arguments = {
            "namespace": f"{arm_prefix}{side}_hand",
            "joint_prefix": f"{arm_prefix}{side}_",
            "robot_state_publisher": "false",
        }
        if not simulated:
            arguments["serial_port"] = LaunchConfiguration(f"{side}_serial_port").perform(context)
        included = PythonLaunchDescriptionSource(source)
        actions.append(IncludeLaunchDescription(included, launch_arguments=list(arguments.items())))
    mappings = {"arm_prefix": arm_prefix}
    urdf = xacro.process_file(str(HERE / "two_hands.urdf.xacro"), mappings=mappings).toxml()
    description = {"robot_description": ParameterValue(urdf, value_type=str)}
    sources = [f"/{arm_prefix}{side}_hand/joint_states" for side in SIDES]
    return [
        *actions,
        Node(
            package="joint_state_publisher",
            executable="joint_state_publisher",
            parameters=[description, {"source_list": sources, "rate": 50}],
        ),
        Node(package="robot_state_publisher", executable="robot_state_publisher", parameters=[description]),
    ]


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription(
        [
            DeclareLaunchArgument("arm_prefix", default_value="", description="beginning of all names of the robot"),
            DeclareLaunchArgument(
                "simulated", default_value="true", description="simulate both hands; false: start their drivers"
            ),
            DeclareLaunchArgument(
                "left_serial_port", default_value="/dev/ttyUSB0", description="board of the left hand"
            ),
            DeclareLaunchArgument(
                "right_serial_port", default_value="/dev/ttyUSB1", description="board of the right hand"
            ),
            OpaqueFunction(function=hands),
        ]
    )
