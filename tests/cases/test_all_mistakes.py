"""Mistakes of captain.toml: all are reported at once."""

import json
import time
from itertools import combinations

import pytest
from hypothesis import given
from hypothesis import strategies as some

from board.runtime.errors import ConfigurationError
from firmware import cli
from firmware.card.verdict import verdict
from firmware.config import captain_toml
from tests.firmware.card.conftest import KEY, mistakes, write

BASE = """
[station]
type = 5
[endpoint]
from_users = 5555
[time]
leap_list = ""
[recorder]
folder = ""
[[types]]
number = 200
name = "mytest"
[[types]]
number = 201
name = "other"
[[policy]]
match.type = ["denm", "mytest"]
interfaces = ["g5", "v2n"]
[[policy]]
match.type = ["cam"]
fallback = ["line"]
[[policy]]
match.link_up = ["g5"]
[interfaces.g5]
driver = "ethernet"
device = "wlan0"
[interfaces.v2n]
driver = "mqtt"
url = "mqtt://127.0.0.1:1883"
[interfaces.line]
driver = "uart"
device = "/dev/ttyS8"
[interfaces.second]
driver = "uart"
device = "/dev/ttyS9"
"""
# An override of BASE with a mistake = how the line about it begins.
MISTAKES = {
    "nosuch=3": "nosuch: is not a known key",
    'station.type="car"': 'station.type: "car" is text in quotes',
    'station.mac="zz"': 'station.mac: invalid MAC address of a station: "zz"',
    'endpoint.pull="x"': 'endpoint.pull: "x" is text in quotes',
    "endpoint.to_users=5555": "endpoint: port 5555 is given to two sockets",
    "endpoint.ipc_in=tcp://x": 'endpoint.ipc_in: invalid path "tcp://x"',
    "reception.gn_versions=[16]": "reception.gn_versions[0]: 16 is out of range",
    'time.receiver="gnsss"': "time.receiver: unknown interface 'gnsss'",
    'time.chrony="relative"': "time.chrony: 'relative': chronyd cannot",
    "recorder.folder=3": "recorder.folder: 3 is an integer",
    'types.0.name="MyTest"': 'types[0].name: invalid type name "MyTest"',
    "types.0.btp_port=70000": "types[0].btp_port: 70000 is out of range",
    "types.1.number=200": "types: number 200: given 2 times",
    'policy.0.match.type="denm"': 'policy[0].match.type: "denm" is text in quotes',
    'policy.0.interfaces=["nope"]': "policy[0].interfaces: unknown interface 'nope'",
    'policy.1.match.type=["denmm"]': "policy[1].match.type: unknown type 'denmm'",
    'policy.1.fallback=["nowhere"]': "policy[1].fallback: unknown interface 'nowhere'",
    "policy.1.match.size={min=3, max=1}": "policy[1].match.size: min 3 is more than max 1",
    "policy.1.priority=9": "policy[1].priority: 9 is out of range",
    'policy.2.match.link_up=["gone"]': "policy[2].match.link_up: unknown interface 'gone'",
    'policy.2.match.neighbours={interface="away", count=-1}': "policy[2].match.neighbours.count: -1 is out of range",
    'policy.2.match.payload=[{offset=2, value="zz"}]': "policy[2].match.payload[0]: value 'zz' and mask '' must be",
    "policy.2.lifetime=3": "policy[2].lifetime: is not a known key",
    "interfaces.g5.queue=0": "interfaces.g5: queue: 0 is out of range",
    "interfaces.g5.device=7": "interfaces.g5: device: 7 is an integer",
    'interfaces.g5.slot="nix"': "interfaces.g5.slot: the board has no slot 'nix'",
    'interfaces.v2n.url="http://x"': 'interfaces.v2n: url: neither mqtts:// nor mqtt://: "http://x"',
    'interfaces.v2n.bearer="none"': "interfaces.v2n.bearer: unknown interface 'none'",
    'interfaces.line.baud="x"': 'interfaces.line: baud: "x" is text',
    'interfaces.second.device="/dev/ttyS8"': 'interfaces.second.device: "/dev/ttyS8" is already used by line',
    "interfaces.odd=3": "interfaces.odd: 3 is an integer",
}
# What one override takes away from another: it has two mistakes, which are told together.
WITH = {
    'policy.2.match.neighbours={interface="away", count=-1}': [
        "policy[2].match.neighbours.interface: unknown interface 'away'"
    ]
}


@pytest.fixture
def told(tmp_path):
    """The lines about BASE with overrides, without the name of the file."""
    path = tmp_path / "captain.toml"
    path.write_text(BASE)

    def lines(overrides):
        try:
            captain_toml.load(str(path), overrides, "none")
        except ConfigurationError as error:
            return [line.removeprefix(f"{path}: ") for line in str(error).split("\n")]
        return []

    return lines


def expected(overrides):
    return sorted(start for one in overrides for start in [MISTAKES[one], *WITH.get(one, [])])


def assert_told(lines, overrides):
    """Each mistake is told once, and nothing else is."""
    starts = expected(overrides)
    found = sorted(next((start for start in starts if line.startswith(start)), f"?? {line}") for line in lines)
    assert found == starts


def test_the_configuration_without_a_mistake_is_read(told):
    assert told([]) == []


@pytest.mark.parametrize("override", MISTAKES)
def test_a_mistake_alone_is_told_and_nothing_else(told, override):
    assert_told(told([override]), [override])


@pytest.mark.parametrize("override", MISTAKES)
def test_a_mistake_is_told_beside_each_other_mistake(told, override):
    for pair in combinations(MISTAKES, 2):
        if override == pair[0]:
            assert_told(told(pair), pair)


def test_all_mistakes_together_are_told_in_one_pass(told):
    assert_told(told(list(MISTAKES)), list(MISTAKES))


def test_a_policy_with_a_wrong_type_and_a_missing_interface_is_told_at_once(tmp_path, capsys):
    path = tmp_path / "captain.toml"
    path.write_text('[[policy]]\nmatch.type = "denm"\ninterfaces = ["g5"]\nfallback = ["backhaul"]\n')
    assert cli.main(["run", "--config", str(path)]) == 1
    assert capsys.readouterr().err.split("\n")[:3] == [
        f'captain: {path}: policy[0].match.type: "denm" is text in quotes; give an array',
        f"{path}: policy[0].interfaces: unknown interface 'g5'; one of none",
        f"{path}: policy[0].fallback: unknown interface 'backhaul'; one of none",
    ]


def test_a_name_that_another_mistake_stands_beside_is_still_known(told):
    """What is declared with a mistake is declared: rows that name it are right."""
    assert_told(told(["types.0.btp_port=70000"]), ["types.0.btp_port=70000"])
    assert [line.partition(":")[0] for line in told(["types.0.number=300"])] == ["types[0].number"]
    assert [line.partition(":")[0] for line in told(["interfaces.g5=3"])] == ["interfaces.g5"]
    assert [line.partition(":")[0] for line in told(["interfaces=3"])] == ["interfaces"]
    assert [line.partition(":")[0] for line in told(["types=3"])] == ["types"]
    assert [line.partition(":")[0] for line in told(["policy=3"])] == ["policy"]
    assert [line.partition(":")[0] for line in told(["policy.0=3"])] == ["policy[0]"]
    ipc = ["endpoint.ipc_out=/no/address", 'policy.0.interfaces=["ipc"]']
    assert [line.partition(":")[0] for line in told(ipc)] == ["endpoint.ipc_out"]


def test_overrides_that_cannot_be_read_are_told_together(told):
    lines = told(["station.type", "policy.9.name=x", 'station.mac="zz"'])
    assert [line.split(":")[0] for line in lines[:2]] == ["--set station.type", "--set policy.9.name"]
    assert lines[2].startswith("station.mac: ")


def test_mistakes_of_the_board_and_of_the_configuration_are_told_together(tmp_path):
    board, own = tmp_path / "board.toml", tmp_path / "captain.toml"
    board.write_text(
        'name = "mine"\n[slots.v2x]\nusb = 3\n[slots.gnss]\nusb = "1-1"\nids = 3\n'
        '[interfaces.g5]\ndriver = "udp"\nlisten = "127.0.0.1:0"\n'
    )
    own.write_text(
        '[station]\ntype = "car"\n[[policy]]\ninterfaces = ["g5", "nope"]\n'
        '[interfaces.gnss]\ndriver = "zed_f9p"\nslot = "gnss"\n[interfaces.radio]\ndriver = "som301e"\nlibrary = "x.so"\nslot = "v2x"\n'
    )
    with pytest.raises(ConfigurationError) as caught:
        captain_toml.load(str(own), (), str(board))
    assert [line.split("; ")[0] for line in caught.value.message.split("\n")] == [
        f"{board}: slots.v2x.usb: 3 is an integer",
        f"{board}: slots.gnss.ids: 3 is an integer",
        f'{own}: station.type: "car" is text in quotes',
        f"{own}: policy[0].interfaces: unknown interface 'nope'",
    ]


def test_a_board_that_cannot_be_read_hides_no_mistake_of_the_tables(tmp_path):
    own = tmp_path / "captain.toml"
    own.write_text('[station]\ntype = "car"\n[[policy]]\ninterfaces = ["g5"]\n[[policy]]\npriority = 9\n')
    with pytest.raises(ConfigurationError) as caught:
        captain_toml.load(str(own), (), "quadd")
    assert [line.split(": ")[0:2][-1] for line in caught.value.message.split("\n")][1:] == [
        "station.type",
        "policy[1].priority",
    ]
    assert "board 'quadd' is not known" in caught.value.message


def test_a_card_tells_what_a_box_refuses_beside_mistakes_of_the_configuration(tmp_path):
    text = (
        '[station]\ntype = "car"\n[endpoint]\naddress = "eth0"\npull = "x"\n[recorder]\nfolder = "/media/usb"\n'
        '[interfaces.g5]\ndriver = "ethernet"\ndevice = "eth0"\n[interfaces.v2n]\ndriver = "mqtt"\nurl = "x"\nca = "mqtt/a.pem"\n'
        '[interfaces.b]\ndriver = "mqtt"\nurl = "mqtts://b:1"\nca = "mqtt/b.pem"\n'
    )
    card, scratch = tmp_path / "card", tmp_path / "scratch"
    scratch.mkdir()
    write(card, {"captain.toml": text, "authorized_keys": KEY, "mqtt/a.pem": "x"})
    found = verdict(card, scratch, "none", None, time.time())
    assert [note.text.split("; ")[0] for note in found.notes] == [
        'captain.toml:2: station.type: "car" is text in quotes',
        'captain.toml:5: endpoint.pull: "x" is text in quotes',
        'captain.toml:13: interfaces.v2n: url: neither mqtts:// nor mqtt://: "x"',
        'captain.toml:4: endpoint.address: invalid address: "eth0"',
        "captain.toml:10: interfaces.g5.device: eth0 is the network of ssh and users: V2X frames would reach all of its hosts",
        "captain.toml:7: recorder.folder: the station cannot write /media/usb on a box",
        "captain.toml:18: interfaces.b.ca: not found: mqtt/b.pem",
    ]
    assert len(mistakes(found)) == 5


WORDS = ["denm", "g5", "*", "", "ipc://x", "udp", "mqtt", "zed_f9p", "static", "127.0.0.1:1", "a\0b"]
KEYS = ["type", "interfaces", "match", "name", "number", "driver", "slot", "listen", "group", "url", "ipc_in", "size", "min",
        "link_up", "neighbours", "interface", "payload", "value", "usb", "port", "kind", "to_users", "receiver", "mac"]  # fmt: skip
VALUES = some.recursive(
    some.sampled_from(WORDS) | some.integers(-1, 6000) | some.booleans() | some.floats(allow_nan=True),
    lambda inner: some.lists(inner, max_size=3) | some.dictionaries(some.sampled_from(KEYS), inner, max_size=4),
    max_leaves=8,
)
TABLES = ["station", "endpoint", "reception", "time", "recorder", "interfaces", "interfaces.g5", "types", "policy"]


def toml(value):
    """A value as TOML writes it in one line."""
    match value:
        case dict():
            return "{" + ", ".join(f"{key} = {toml(one)}" for key, one in value.items()) + "}"
        case list():
            return "[" + ", ".join(map(toml, value)) + "]"
        case str() | bool() | int():
            return json.dumps(value)
    return repr(value)


@given(written=some.dictionaries(some.sampled_from(TABLES), VALUES, max_size=6))
def test_any_values_are_read_or_told_in_lines(written):
    overrides = [f"{key}={toml(value)}" for key, value in written.items()]
    found, errors = captain_toml.examine(None, overrides, "none")
    assert found is not None
    for line in "\n".join(error.message for error in errors).splitlines():
        assert line.startswith("--set")
