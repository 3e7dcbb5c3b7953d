"""C code that converts UPER to serialised ROS 2 messages and back.

Face: library.
"""
