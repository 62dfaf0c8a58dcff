"""The small part of ROS 2's Python API that `limo-hog run` puts in front of a script; docs/ros2.md lists it."""
