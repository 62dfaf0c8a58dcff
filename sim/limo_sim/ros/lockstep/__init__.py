"""An rclpy script in lock step with the arena: time passes only while the script waits."""
