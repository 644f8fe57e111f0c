"""A running hand as programs of a user meet it: its live state, checked requests, and a client over ROS 2."""
