"""Launch driver and controller of a real hand: ros2 launch fluidic_hand hand.launch.py serial_port:=/dev/ttyUSB0."""

from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from launch import Action, LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable, Shutdown
from launch.conditions import IfCondition
from launch.events.process import ProcessExited
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from hand_robot.launch_nodes import ARGUMENTS, CONFIG, LaunchArgument, hand_nodes, values_of
from hand_robot.state_publisher import PACKAGE


def end_unconfigured(event: ProcessExited, _context: LaunchContext) -> list[Action]:
    """End the launch where a node was given something wrong; the node has logged what."""
    return [Shutdown(reason=f"{event.process_name} could not be configured")] if event.returncode == 2 else []


def start(context: LaunchContext) -> list[Action]:
    """The nodes of the hand."""
    try:
        get_package_prefix(PACKAGE)
        installed = True
    except PackageNotFoundError:
        installed = False
    values = values_of({each.name: LaunchConfiguration(each.name).perform(context) for each in ARGUMENTS})
    actions = []
    for node in hand_nodes(values, installed):
        *files, given = node["parameters"]
        # Without a type, launch_ros reads text as YAML.
        typed = {name: ParameterValue(v, value_type=str) if isinstance(v, str) else v for name, v in given.items()}
        ends = {"on_exit": end_unconfigured} if "exit_unconfigured" in given else {}
        actions.append(Node(**node | {"parameters": [*files, typed]} | ends))
    return actions


def declared(argument: LaunchArgument) -> DeclareLaunchArgument:
    """The argument; a file of the package is found where it is installed."""
    default = argument.default
    if default.startswith(CONFIG):
        default = PathJoinSubstitution([FindPackageShare("fluidic_hand"), default])
    return DeclareLaunchArgument(argument.name, default_value=default, description=argument.description)


def generate_launch_description() -> LaunchDescription:
    only_here = IfCondition(LaunchConfiguration("localhost_only"))
    return LaunchDescription(
        [
            *map(declared, ARGUMENTS),
            SetEnvironmentVariable("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST", condition=only_here),
            OpaqueFunction(function=start),
        ]
    )
