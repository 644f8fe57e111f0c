"""Launch MoveIt for two hands on two arms: ros2 launch examples/two_hands/move_group.launch.py arm_prefix:=robot1_.

The hands run already, by two_hands.launch.py with the same arm_prefix. Another prefix needs files of its own, by
`hand urdf --format moveit --hands left,right`, in the folder `moveit`.
"""

from pathlib import Path

import yaml
from launch import Action, LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from moveit_configs_utils import MoveItConfigsBuilder

HERE = Path(__file__).resolve().parent
ROBOT = "two_hands"
ARGUMENTS = {
    "arm_prefix": ("robot1_", "beginning of all names of the robot"),
    "moveit": (str(HERE / "moveit"), "folder of hand urdf --format moveit --hands left,right --robot two_hands"),
    "localhost_only": (
        "true",
        "nodes of other machines can neither command nor listen; false: as the environment says",
    ),
    "use_sim_time": ("false", "use the time of /clock"),
}


def move_group(context: LaunchContext) -> list[Action]:
    """The node move_group with the URDF of the example and the files of a folder."""
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    folder = Path(given["moveit"]).resolve()
    check_prefix(folder, given["arm_prefix"])
    # The package of one hand stands for a package of this robot, which would have these files in its own config.
    builder = MoveItConfigsBuilder(ROBOT, package_name="fluidic_hand_moveit_config")
    builder.robot_description(file_path=str(HERE / f"{ROBOT}.urdf.xacro"), mappings={"arm_prefix": given["arm_prefix"]})
    builder.robot_description_semantic(file_path=str(folder / f"{ROBOT}.srdf"))
    builder.robot_description_kinematics(file_path=str(folder / "kinematics.yaml"))
    builder.joint_limits(file_path=str(folder / "joint_limits.yaml"))
    builder.trajectory_execution(file_path=str(folder / "moveit_controllers.yaml"))
    builder.planning_pipelines(pipelines=["ompl"])  # all others need files of their own
    parameters = builder.to_moveit_configs().to_dict()
    sim_time = {"use_sim_time": given["use_sim_time"].lower() in ("true", "1")}
    return [Node(package="moveit_ros_move_group", executable="move_group", parameters=[parameters, sim_time])]


def check_prefix(folder: Path, arm_prefix: str) -> None:
    """Raise ValueError, one line, where the files of a folder are those of a robot with another prefix."""
    joints = yaml.safe_load((folder / "joint_limits.yaml").read_text(encoding="utf-8"))["joint_limits"]
    other = next((joint for joint in joints if not joint.startswith((f"{arm_prefix}left_", f"{arm_prefix}right_"))), "")
    if other:
        prefix = f"--prefix {arm_prefix} " if arm_prefix else ""
        raise ValueError(
            f"arm_prefix is {arm_prefix!r}, but {folder} has the joint {other}; write its files with: hand urdf"
            f" --format moveit {prefix}--hands left,right --mount tool0 --robot {ROBOT} --out FOLDER"
        )


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=description)
                for name, (default, description) in ARGUMENTS.items()
            ),
            SetEnvironmentVariable(
                "ROS_AUTOMATIC_DISCOVERY_RANGE",
                "LOCALHOST",
                condition=IfCondition(LaunchConfiguration("localhost_only")),
            ),
            OpaqueFunction(function=move_group),
        ]
    )
