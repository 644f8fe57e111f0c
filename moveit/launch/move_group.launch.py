"""Launch MoveIt for one hand: ros2 launch fluidic_hand_moveit_config move_group.launch.py."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, SetEnvironmentVariable
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from moveit_configs_utils import MoveItConfigsBuilder


def generate_launch_description() -> LaunchDescription:
    # URDF, SRDF, limits, kinematics and controllers are found by their names in config.
    builder = MoveItConfigsBuilder("fluidic_hand", package_name="fluidic_hand_moveit_config")
    builder.planning_pipelines(pipelines=["ompl"])  # the default loads all, and Pilz needs a file of its own
    configuration = builder.to_moveit_configs()
    use_sim_time = ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool)
    return LaunchDescription(
        [
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
            DeclareLaunchArgument("use_sim_time", default_value="false", description="use the time of /clock"),
            DeclareLaunchArgument(
                "joint_states",
                default_value="/hand/joint_states",
                description="topic of the measured angles; of a whole robot: of all its joints",
            ),
            Node(
                package="moveit_ros_move_group",
                executable="move_group",
                parameters=[configuration.to_dict(), {"use_sim_time": use_sim_time}],
                remappings=[("joint_states", LaunchConfiguration("joint_states"))],
            ),
        ]
    )
