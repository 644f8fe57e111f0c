"""The hand as other programs read it: URDF, xacro, SRDF, MJCF and settings of ros2_control and MoveIt. Texts only."""
