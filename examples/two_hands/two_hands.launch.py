"""Launch two hands on two arms: ros2 launch examples/two_hands/two_hands.launch.py arm_prefix:=robot1_.

Each hand has a namespace and a prefix of its own. One robot_state_publisher publishes the frames of the whole robot.
The angles of both hands come to it by joint_state_publisher, or by the broadcasters of ros2_control.
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

from hand_robot.launch_nodes import ARGUMENTS, CONFIG
from hand_robot.ros2_control import controller_names

HERE = Path(__file__).resolve().parent
SIDES = ("left", "right")
OWN = {
    "arm_prefix": ("", "beginning of all names of the robot"),
    "simulated": ("true", "simulate both hands; false: start their drivers"),
    "left_serial_port": ("/dev/ttyUSB0", "board of the left hand"),
    "right_serial_port": ("/dev/ttyUSB1", "board of the right hand"),
    "controllers": ("", "folder with left.yaml, right.yaml of hand urdf --format controllers; empty: no ros2_control"),
    "record": ("false", "record the topics of both hands"),
}
SAME = ("hand_description", "parameter_file", "use_sim_time", "log_level", "recording")
"""Arguments of hand.launch.py that are those of both hands."""


def both_hands(context: LaunchContext) -> list[Action]:
    """Both hands, simulated or real, the frames of the robot, and where asked for ros2_control and a recorder."""
    given = {name: LaunchConfiguration(name).perform(context) for name in (*OWN, *SAME)}
    simulated, sim_time, record = (
        given[name].lower() in ("true", "1") for name in ("simulated", "use_sim_time", "record")
    )
    if simulated and sim_time:
        raise ValueError("use_sim_time is true; two simulated hands would both publish /clock")
    spaces = {side: f"{given['arm_prefix']}{side}_hand" for side in SIDES}
    actions: list[Action] = [_hand(side, spaces[side], given) for side in SIDES]
    mappings = {"arm_prefix": given["arm_prefix"], "ros2_control": "topic_based" if given["controllers"] else "none"}
    urdf = xacro.process_file(str(HERE / "two_hands.urdf.xacro"), mappings=mappings).toxml()
    description = {"robot_description": ParameterValue(urdf, value_type=str), "use_sim_time": sim_time}
    level = ["--log-level", given["log_level"]]
    publisher = "robot_state_publisher"
    actions.append(Node(package=publisher, executable=publisher, parameters=[description], ros_arguments=level))
    if given["controllers"]:
        actions += _controllers(given, sim_time)
    else:
        joined = {"source_list": [f"/{space}/joint_states" for space in spaces.values()], "rate": 50}
        publisher = "joint_state_publisher"
        actions.append(
            Node(package=publisher, executable=publisher, parameters=[description, joined], ros_arguments=level)
        )
    if record:
        out = ParameterValue(given["recording"], value_type=str)
        recorded = {"namespaces": [f"/{space}" for space in spaces.values()], "out": out, "use_sim_time": sim_time}
        actions.append(Node(package="fluidic_hand", executable="recorder", parameters=[recorded], ros_arguments=level))
    return actions


def _hand(side: str, namespace: str, given: dict[str, str]) -> Action:
    """One hand, without frames and recorder, which the whole robot has."""
    arguments = {name: given[name] for name in (*SAME, "simulated")} | {
        "namespace": namespace,
        "joint_prefix": f"{given['arm_prefix']}{side}_",
        "robot_state_publisher": "false",
        "record": "false",
        "serial_port": given[f"{side}_serial_port"],
    }
    source = PathJoinSubstitution([FindPackageShare("fluidic_hand"), "launch", "hand.launch.py"])
    return IncludeLaunchDescription(PythonLaunchDescriptionSource(source), launch_arguments=list(arguments.items()))


def _controllers(given: dict[str, str], sim_time: bool) -> list[Action]:
    """One controller manager for both hands, and the spawner of their controllers."""
    files = [str(Path(given["controllers"]) / f"{side}.yaml") for side in SIDES]
    names = [name for side in SIDES for name in controller_names(f"{given['arm_prefix']}{side}_")]
    manager = Node(
        package="controller_manager",
        executable="ros2_control_node",
        parameters=[*files, {"use_sim_time": sim_time}],
        remappings=[("~/robot_description", "/robot_description")],
        ros_arguments=["--log-level", given["log_level"]],
    )
    return [manager, Node(package="controller_manager", executable="spawner", arguments=names)]


def generate_launch_description() -> LaunchDescription:
    same = {each.name: (each.default, each.description) for each in ARGUMENTS if each.name in SAME}
    share = FindPackageShare("fluidic_hand")
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(
                    name,
                    default_value=PathJoinSubstitution([share, default]) if default.startswith(CONFIG) else default,
                    description=description,
                )
                for name, (default, description) in (OWN | same).items()
            ),
            OpaqueFunction(function=both_hands),
        ]
    )
