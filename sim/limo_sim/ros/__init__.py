"""The arena on ROS 2 topics: on the network, or in lock step with a script."""
