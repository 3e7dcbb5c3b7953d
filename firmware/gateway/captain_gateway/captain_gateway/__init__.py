"""captain_gateway: a ROS 2 node between a V2X station's endpoint and ROS topics."""

VERSION = "0.1.0"
