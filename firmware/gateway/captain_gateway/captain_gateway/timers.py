"""Timers of a node that run in real time, whatever ROS's simulated clock does."""

from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock, ClockType


def every(node: Any, period_s: float, call: Callable[[], None]) -> Any:
    """Create a timer of the machine's steady clock, even with use_sim_time: a station works in real time."""
    return node.create_timer(period_s, call, clock=Clock(clock_type=ClockType.STEADY_TIME))
