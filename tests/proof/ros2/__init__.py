"""The ROS 2 messages in a real ROS 2: `make ros2`."""
