"""Timers by the steady clock, with a node and clocks that are played."""

import ast
import importlib
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

PACKAGE = "firmware.gateway.captain_gateway.captain_gateway"
FOLDER = Path(__file__).parents[3] / PACKAGE.replace(".", "/")


def test_a_timer_goes_by_the_steady_clock(monkeypatch):
    clocks = ModuleType("rclpy.clock")
    clocks.Clock = SimpleNamespace
    clocks.ClockType = SimpleNamespace(STEADY_TIME="steady", ROS_TIME="ros")
    monkeypatch.setitem(sys.modules, "rclpy", ModuleType("rclpy"))
    monkeypatch.setitem(sys.modules, "rclpy.clock", clocks)
    made = []
    node = SimpleNamespace(create_timer=lambda period_s, call, clock: made.append((period_s, call, clock.clock_type)))
    module = importlib.import_module(f"{PACKAGE}.timers")
    del sys.modules[module.__name__]
    module.every(node, 0.5, print)
    assert made == [(0.5, print, "steady")]


def test_no_timer_is_made_elsewhere():
    made_in = {
        path.name
        for path in FOLDER.rglob("*.py")
        for one in ast.walk(ast.parse(path.read_text()))
        if isinstance(one, ast.Attribute) and one.attr == "create_timer"
    }
    assert made_in == {"timers.py"}
