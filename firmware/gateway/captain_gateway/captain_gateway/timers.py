"""Timers of a node that no clock of a simulation or of a recording stops."""

from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock, ClockType


def every(node: Any, period_s: float, call: Callable[[], None]) -> Any:
    """A timer by the machine's own steady clock, whatever use_sim_time says: a station is real, and so is its air."""
    return node.create_timer(period_s, call, clock=Clock(clock_type=ClockType.STEADY_TIME))
