"""Launch the simulated hand and its controller: ros2 launch fluidic_hand simulated_hand.launch.py."""

from launch import Action, LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, SetEnvironmentVariable, Shutdown
from launch.conditions import IfCondition
from launch.events.process import ProcessExited
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def end_unconfigured(event: ProcessExited, _context: LaunchContext) -> list[Action]:
    """End the launch where a node was given something wrong; the node has logged what."""
    return [Shutdown(reason=f"{event.process_name} could not be configured")] if event.returncode == 2 else []


def generate_launch_description() -> LaunchDescription:
    config = PathJoinSubstitution([FindPackageShare("fluidic_hand"), "config"])
    namespace = LaunchConfiguration("namespace")
    description = {"hand_description": ParameterValue(LaunchConfiguration("hand_description"), value_type=str)}
    use_sim_time = ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool)
    common = {"use_sim_time": use_sim_time, "exit_unconfigured": True}
    log_level = ["--log-level", LaunchConfiguration("log_level")]
    return LaunchDescription(
        [
            DeclareLaunchArgument("namespace", default_value="hand", description="namespace of all nodes"),
            DeclareLaunchArgument(
                "localhost_only",
                default_value="true",
                description="nodes of other machines can neither command nor listen; false: as the environment says",
            ),
            SetEnvironmentVariable(
                "ROS_AUTOMATIC_DISCOVERY_RANGE",
                "LOCALHOST",
                condition=IfCondition(LaunchConfiguration("localhost_only")),
            ),
            DeclareLaunchArgument(
                "hand_description",
                default_value=PathJoinSubstitution([config, "hand.yaml"]),
                description="path of the description of the hand, hand.yaml",
            ),
            DeclareLaunchArgument(
                "parameter_file",
                default_value=PathJoinSubstitution([config, "controller.yaml"]),
                description="path of a parameter file of the controller",
            ),
            DeclareLaunchArgument(
                "use_sim_time",
                default_value="false",
                description="the simulation publishes /clock, and all nodes use it",
            ),
            DeclareLaunchArgument("log_level", default_value="info", description="debug, info, warn, error or fatal"),
            DeclareLaunchArgument("record", default_value="false", description="record every topic of the namespace"),
            Node(
                package="fluidic_hand",
                executable="simulation",
                namespace=namespace,
                parameters=[description, {"publish_clock": use_sim_time, "exit_unconfigured": True}],
                ros_arguments=log_level,
                on_exit=end_unconfigured,
            ),
            Node(
                package="fluidic_hand",
                executable="controller",
                namespace=namespace,
                # Nothing can be hurt here. A real hand starts disabled.
                parameters=[LaunchConfiguration("parameter_file"), description, common, {"enabled_at_start": True}],
                ros_arguments=log_level,
                on_exit=end_unconfigured,
            ),
            Node(
                package="fluidic_hand",
                executable="recorder",
                namespace=namespace,
                parameters=[{"use_sim_time": use_sim_time}],
                ros_arguments=log_level,
                condition=IfCondition(LaunchConfiguration("record")),
            ),
        ]
    )
