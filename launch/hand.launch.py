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

from hand_robot.state_publisher import state_publisher

BOARD = {
    "transport": ("serial", str, "connection to the board: serial or can"),
    "serial_port": ("/dev/ttyUSB0", str, "device of the serial port"),
    "serial_baud": ("1000000", int, "bit rate of the serial port [bit/s]"),
    "can_interface": ("socketcan", str, "interface of python-can, for example socketcan"),
    "can_channel": ("can0", str, "channel of the CAN interface"),
    "can_bitrate": ("1000000", int, "bit rate of the CAN bus [bit/s]"),
}
"""Default, type and description of the driver's parameters for its board."""


def end_unconfigured(event: ProcessExited, _context: LaunchContext) -> list[Action]:
    """End the launch where a node was given something wrong; the node has logged what."""
    return [Shutdown(reason=f"{event.process_name} could not be configured")] if event.returncode == 2 else []


def publish_frames(context: LaunchContext) -> list[Action]:
    """robot_description and TF of the hand, by our own node where robot_state_publisher is not installed."""
    names = ("hand_description", "namespace", "joint_prefix", "mount")
    given = {name: LaunchConfiguration(name).perform(context) for name in names}
    wanted, sim_time = (
        LaunchConfiguration(name).perform(context).lower() in ("true", "1")
        for name in ("robot_state_publisher", "use_sim_time")
    )
    node = state_publisher(**given, use_sim_time=sim_time) if wanted else None
    if node is None:
        return []
    try:
        get_package_prefix(node["package"])
    except PackageNotFoundError:
        own = {key: given[key] for key in ("hand_description", "joint_prefix", "mount")} | {"use_sim_time": sim_time}
        node |= {"package": "fluidic_hand", "executable": "frame_publisher", "parameters": [own]}
    # Without a type, launch_ros reads text as YAML.
    parameters = [
        {name: ParameterValue(value, value_type=type(value)) for name, value in node["parameters"][0].items()}
    ]
    return [Node(**node | {"parameters": parameters})]


def generate_launch_description() -> LaunchDescription:
    config = PathJoinSubstitution([FindPackageShare("fluidic_hand"), "config"])
    namespace = LaunchConfiguration("namespace")
    description = {
        name: ParameterValue(LaunchConfiguration(name), value_type=str) for name in ("hand_description", "joint_prefix")
    }
    board = {name: ParameterValue(LaunchConfiguration(name), value_type=kind) for name, (_, kind, _) in BOARD.items()}
    common = {
        "use_sim_time": ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool),
        "exit_unconfigured": True,
    }
    recording = ParameterValue(LaunchConfiguration("recording"), value_type=str)
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
                "joint_prefix",
                default_value="",
                description="beginning of the names of joints and frames, such as left_; empty: that of the file",
            ),
            DeclareLaunchArgument(
                "robot_state_publisher",
                default_value="true",
                description="publish robot_description and TF, by robot_state_publisher where it is installed",
            ),
            DeclareLaunchArgument(
                "mount", default_value="", description="parent link of the hand in robot_description; empty: none"
            ),
            DeclareLaunchArgument(
                "parameter_file",
                default_value=PathJoinSubstitution([config, "controller.yaml"]),
                description="path of a parameter file of all nodes",
            ),
            DeclareLaunchArgument("use_sim_time", default_value="false", description="use the time of /clock"),
            DeclareLaunchArgument("log_level", default_value="info", description="debug, info, warn, error or fatal"),
            DeclareLaunchArgument("record", default_value="false", description="record every topic of the namespace"),
            DeclareLaunchArgument(
                "recording",
                default_value="",
                description="new folder, or NAME.mcap, with record; empty: hand_DATE_TIME",
            ),
            *(DeclareLaunchArgument(name, default_value=v, description=d) for name, (v, _, d) in BOARD.items()),
            OpaqueFunction(function=publish_frames),
            Node(
                package="fluidic_hand",
                executable="driver",
                namespace=namespace,
                parameters=[LaunchConfiguration("parameter_file"), description, board, common],
                ros_arguments=log_level,
                on_exit=end_unconfigured,
            ),
            Node(
                package="fluidic_hand",
                executable="controller",
                namespace=namespace,
                parameters=[LaunchConfiguration("parameter_file"), description, common],
                ros_arguments=log_level,
                on_exit=end_unconfigured,
            ),
            Node(
                package="fluidic_hand",
                executable="recorder",
                namespace=namespace,
                parameters=[
                    LaunchConfiguration("parameter_file"),
                    {"use_sim_time": common["use_sim_time"], "out": recording},
                ],
                ros_arguments=log_level,
                condition=IfCondition(LaunchConfiguration("record")),
            ),
        ]
    )
