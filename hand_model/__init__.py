"""The physics of the hand as pure functions of arrays. No ROS, no files but YAML, no clocks."""
