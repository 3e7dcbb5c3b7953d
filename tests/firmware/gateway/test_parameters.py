"""Parameters of a node, which is played as rclpy has them: of Humble, and of what came after it."""

import array
import importlib
import sys
from collections.abc import Iterator
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from firmware.gateway.captain_gateway.captain_gateway.errors import GatewayError

MODULE = "firmware.gateway.captain_gateway.captain_gateway.parameters"


class HumbleNode:
    """rclpy.node.Node, as far as parameters go: the callback that was added last is asked first, and one no ends it."""

    def __init__(self, **overrides: object) -> None:
        self.values: dict[str, object] = {}
        self.described: dict[str, Any] = {}
        self._overrides = overrides
        self._asked: list[Any] = []

    def declare_parameter(self, name: str, default: object, descriptor: Any) -> SimpleNamespace:
        self.described[name] = descriptor
        self.values[name] = self._overrides.get(name.replace(".", "__"), default)
        return SimpleNamespace(value=self.values[name])

    def add_on_set_parameters_callback(self, call: Any) -> None:
        self._asked.insert(0, call)

    def set(self, **values: object) -> SimpleNamespace:
        parameters = [SimpleNamespace(name=name.replace("__", "."), value=value) for name, value in values.items()]
        result = SimpleNamespace(successful=True, reason="")
        for call in self._asked:
            result = call(parameters)
            if not result.successful:
                return result
        self.values.update((one.name, one.value) for one in parameters)
        self.changed(parameters)
        return result

    def changed(self, parameters: list[Any]) -> None: ...


class LaterNode(HumbleNode):
    """Of Iron and later."""

    def __init__(self, **overrides: object) -> None:
        super().__init__(**overrides)
        self._told: list[Any] = []

    def add_post_set_parameters_callback(self, call: Any) -> None:
        self._told.append(call)

    def changed(self, parameters: list[Any]) -> None:
        for call in self._told:
            call(parameters)


@pytest.fixture
def module(monkeypatch) -> Iterator[ModuleType]:
    """It imports messages of ROS, which are no more than their fields here."""
    said = ModuleType("rcl_interfaces.msg")
    said.ParameterDescriptor = said.SetParametersResult = SimpleNamespace  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "rcl_interfaces", ModuleType("rcl_interfaces"))
    monkeypatch.setitem(sys.modules, "rcl_interfaces.msg", said)
    yield importlib.import_module(MODULE)
    del sys.modules[MODULE]


@pytest.fixture(params=[HumbleNode, LaterNode])
def node(request) -> HumbleNode:
    return request.param()


@pytest.fixture
def told(module, node) -> list[tuple[str, Any]]:
    found: list[tuple[str, Any]] = []
    parameters = module.Parameters(node)
    parameters.handler("cam")
    parameters.on_change(lambda name, value: found.append((name, value)))
    return found


def test_a_change_is_told_once_when_it_is_made(node, told):
    assert node.set(cam__transmit__rate_hz=5.0).successful
    assert told == [("cam.transmit.rate_hz", 5.0)]


def test_a_change_that_is_refused_is_never_told(node, told):
    refused = node.set(cam__transmit__depth=5, cam__transmit__rate_hz=-3.0)
    assert not refused.successful
    assert refused.reason == "cam.transmit.rate_hz: -3.0 is not a number from 0 to 1000"
    assert told == []
    assert node.values["cam.transmit.depth"] == 10


def test_parameters_of_others_are_neither_refused_nor_told(node, told):
    assert node.set(use_sim_time="whatever").successful
    assert told == []


def test_an_array_of_numbers_is_a_list(node, told):
    node.set(cam__receive__stations=array.array("q", [1, 2]))
    assert told == [("cam.receive.stations", [1, 2])]


def test_every_parameter_is_declared_with_its_meaning_and_whether_it_is_fixed(module, node):
    found = module.Parameters(node).gateway()
    assert found["station.host"] == "127.0.0.1"
    descriptor = node.described["station.host"]
    assert descriptor.description
    assert descriptor.read_only


def test_a_value_at_the_start_that_cannot_be_meant_is_refused_with_the_name(module):
    with pytest.raises(GatewayError, match=r"parameter station\.pull: 70000 is not a whole number from 0 "):
        module.Parameters(HumbleNode(station__pull=70000)).gateway()
