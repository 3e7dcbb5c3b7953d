"""What of ROS packages is installed beside the gateway."""

import importlib
from typing import Any


def message(ros_type: str) -> Any:
    """A message class of rclpy by its name, None where its package is not installed."""
    package, _, name = ros_type.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError):
        return None


def interfaces() -> Any:
    """captain_gateway_msgs, None where it is not installed."""
    try:
        import captain_gateway_msgs.msg
        import captain_gateway_msgs.srv
    except ImportError:
        return None
    return captain_gateway_msgs
