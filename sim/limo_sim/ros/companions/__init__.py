"""The packages beside rclpy that nodes import: cv_bridge, message_filters, tf2_ros, image_geometry."""
