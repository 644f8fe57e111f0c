"""Launch the simulated hand and its controller: ros2 launch fluidic_hand simulated_hand.launch.py.

It is hand.launch.py with simulated:=true and has the same arguments; those of a board have no effect.
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource


def generate_launch_description() -> LaunchDescription:
    source = PythonLaunchDescriptionSource(str(Path(__file__).with_name("hand.launch.py")))
    return LaunchDescription([IncludeLaunchDescription(source, launch_arguments=[("simulated", "true")])])
