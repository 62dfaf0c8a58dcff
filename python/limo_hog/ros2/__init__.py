"""What limo-hog says to ROS 2: messages, topics over DDS, bags (extras "ros2" and "record")."""
