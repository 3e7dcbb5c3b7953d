"""Installed ROS packages: finds their messages and services."""

import importlib
from typing import Any


def message(ros_type: str) -> Any:
    """Return the message class of rclpy for "package/msg/Name"; None if it is not installed."""
    package, _, name = ros_type.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError):
        return None


def interfaces() -> Any:
    """Import captain_gateway_msgs; None if it is not installed."""
    try:
        import captain_gateway_msgs.msg
        import captain_gateway_msgs.srv
    except ImportError:
        return None
    return captain_gateway_msgs
