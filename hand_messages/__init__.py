"""The hand's messages as bytes and records, and the health of a node, without rclpy."""
