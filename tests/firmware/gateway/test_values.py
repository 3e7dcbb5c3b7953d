"""Values of parameters: what is taken, and in what words the rest is refused."""

import json
import re

import pytest
import zmq

from firmware.gateway.captain_gateway.captain_gateway import settings, values
from firmware.gateway.captain_gateway.captain_gateway.endpoint import Address
from firmware.gateway.captain_gateway.captain_gateway.settings import GATEWAY, HANDLER
from firmware.gateway.captain_gateway.captain_gateway.values import Circle
from firmware.routing.options import parse

DEFAULTS = {name: option.default for name, option in HANDLER.items()}


@pytest.mark.parametrize(("table", "name"), [(table, name) for table in (GATEWAY, HANDLER) for name in table])
def test_every_default_may_be_what_it_is(table, name):
    table[name].read(table[name].default)
    assert table[name].meaning


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("receive.active", 1, "1 is neither true nor false"),
        ("receive.stations", [1, -1], "-1 is not a stationID"),
        ("receive.stations", ["1337"], "'1337' is not a stationID"),
        ("receive.stations", "1337", "'1337' is not a list"),
        ("receive.area", [1.0, 2.0], "neither [radius_m] nor"),
        ("receive.area", [0.0], "neither [radius_m] nor"),
        ("receive.area", [91.0, 0.0, 5.0], "91, 0 is out of range; latitude"),
        ("receive.area", [float("nan")], "nan is not a number"),
        ("receive.max_age_s", -1.0, "-1.0 is not a number from 0 to 86400"),
        ("receive.max_age_s", True, "True is not a number"),
        ("transmit.rate_hz", 1e9, "is not a number from 0 to 1000"),
        ("transmit.buffer", "newest", "'newest' is not one of latest, all"),
        ("transmit.depth", 0, "0 is not a whole number from 1 to 10000"),
        ("transmit.priority", 8, "8 is not a whole number from -1 to 7"),
        ("transmit.area", "circle 1 2", "neither `circle LATITUDE LONGITUDE RADIUS`"),
        ("transmit.area", "square 1 2 3 4", "neither"),
        ("transmit.area", "circle 1 200 3", "1, 200 is out of range; latitude"),
        ("transmit.interfaces", [1], "is not a list of texts"),
    ],
)
def test_a_value_that_cannot_be_meant_is_refused_in_words(name, value, words):
    with pytest.raises(ValueError, match=r".+") as refused:
        HANDLER[name].read(value)
    assert words in str(refused.value)


def test_an_unknown_handler_is_refused_with_those_that_there_are():
    with pytest.raises(ValueError, match=r"'can' is not a handler; choose from cam, cam_ts, denm"):
        GATEWAY["handlers"].read(["cam", "can"])


HOSTS = ["127.0.0.1", "::1", "fe80::1%eth0", "captain-7", "captain_7.local", "a.example"]
NO_HOSTS = [
    "",
    " ",
    "a b",
    "a:b",
    "tcp://a",
    "10.0.0.7:5556",
    "[::1]",
    "::1::",
    "a/b",
    "*",
    "-",
    "\u00fc.example",
    "a" * 254,
]


@pytest.mark.parametrize("host", HOSTS)
def test_a_host_is_a_name_or_an_address(host):
    assert GATEWAY["station.host"].read(host) == host
    with zmq.Context() as context, context.socket(zmq.SUB) as socket:
        socket.set(zmq.IPV6, 1)
        socket.connect(Address(host, 5556, 0, 5555, 0).url(5556))


@pytest.mark.parametrize("host", NO_HOSTS)
def test_what_is_no_host_is_refused_in_words(host):
    with pytest.raises(ValueError, match="is neither a name nor an address of a host"):
        GATEWAY["station.host"].read(host)


@pytest.mark.parametrize("name", ["station.to_users", "station.from_users"])
def test_ports_that_every_box_has_are_not_0(name):
    with pytest.raises(ValueError, match=r"0 is not a whole number from 1 to 65535"):
        GATEWAY[name].read(0)


@pytest.mark.parametrize("name", ["station.pull", "station.report"])
def test_a_port_that_a_box_may_lack_is_0(name):
    assert GATEWAY[name].read(0) == 0


@pytest.mark.parametrize(
    ("area", "said"),
    [
        ("circle 48 11 -100", "distance_a: -100 is out of range; 1 to 65535"),
        ("circle 48 11 0.4", "distance_a: 0.4 is out of range; 1 to 65535"),
        ("ellipse 48 11 300 70000 45", "distance_b: 70000 is out of range; 1 to 65535"),
        ("rectangle 48 11 300 100 361", "angle: 361 is out of range; 0 to 360"),
        ("circle 91 11 100", "91, 11 is out of range"),
    ],
)
def test_an_area_that_nobody_can_be_in_is_refused_in_words(area, said):
    with pytest.raises(ValueError, match=re.escape(said)):
        values.area(area)


@pytest.mark.parametrize("none", [[], [""]])
def test_a_gateway_has_a_handler(none):
    with pytest.raises(ValueError, match="the list is empty; choose from cam, "):
        GATEWAY["handlers"].read(none)


def test_a_handler_is_named_once():
    with pytest.raises(ValueError, match="'cam' is named twice"):
        GATEWAY["handlers"].read(["cam", "denm", "cam"])


def test_topics_of_handlers_have_to_differ():
    with pytest.raises(ValueError, match=r"has no \{type\}"):
        GATEWAY["topics.received"].read("received")


@pytest.mark.parametrize("empty", [[], [""], "", None])
def test_an_empty_list_may_be_written_as_a_parameter_file_can(empty):
    assert HANDLER["receive.stations"].read(empty) == frozenset()
    assert HANDLER["receive.area"].read(empty) is None


def test_areas_are_around_own_position_or_a_place():
    assert values.circle([300]) == Circle(300.0)
    assert values.circle([47.0, 15.0, 300.0]) == Circle(300.0, 47.0, 15.0)


def test_what_parameters_ask_of_the_station_are_the_options_of_its_endpoint():
    chosen = DEFAULTS | {
        "transmit.interfaces": ["g5"], "transmit.btp_port": 2001, "transmit.traffic_class": 3, "transmit.priority": 0,
        "transmit.lifetime_s": 2.5, "transmit.hop_limit": 4, "transmit.area": "ellipse 47 15 300 100 45",
    }  # fmt: skip
    asked = settings.transmit(chosen).options()
    read = parse(json.dumps(asked).encode()).options
    assert (read.interfaces, read.btp_port, read.traffic_class, read.priority) == (("g5",), 2001, 3, 0)
    assert (read.lifetime_s, read.hop_limit) == (2.5, 4)
    assert read.area is not None
    assert (read.area.shape, read.area.distance_a, read.area.distance_b, read.area.angle) == ("ellipse", 300, 100, 45)


def test_nothing_is_asked_by_default():
    assert settings.transmit(DEFAULTS).options() == {}


def test_a_hop_limit_without_an_area_is_not_asked():
    # The station refuses it: a single hop has none.
    assert settings.transmit(DEFAULTS | {"transmit.hop_limit": 4}).options() == {}
