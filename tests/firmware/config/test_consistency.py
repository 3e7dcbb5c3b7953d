"""Consistency of tables in captain.toml, each mistake with its key."""

import os
from dataclasses import dataclass
from pathlib import Path

import pytest

import drivers
from board.runtime.errors import ConfigurationError
from firmware.config import captain_toml
from tests.firmware.written import TWO_UDP, loaded, mistake, mistakes
from tests.said import tells


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path


@pytest.mark.parametrize(
    ("row", "name"),
    [
        ('interfaces = ["g6"]', "g6"),
        ('fallback = ["g6"]', "g6"),
        ('match = { link_up = ["g6"] }', "g6"),
        ('match = { link_down = ["g6"] }', "g6"),
        ('match = { neighbours = { interface = "g6" } }', "g6"),
        ('match = { no_neighbours = { interface = "g6" } }', "g6"),
        ('interfaces = ["ipc"]', "ipc"),
        ('match = { link_up = ["*"] }', "*"),
        ('match = { link_down = ["*"] }', "*"),
        ('match = { neighbours = { interface = "*" } }', "*"),
    ],
)
def test_a_row_that_names_no_interface_is_a_mistake(folder: Path, row: str, name: str) -> None:
    said = mistake(folder, f"{TWO_UDP}[[policy]]\n[[policy]]\n{row}\n")
    assert said.startswith("policy[1].")
    assert f": unknown interface '{name}'" in said
    assert "g5, mqtt" in said


@pytest.mark.parametrize("row", ['interfaces = ["*"]', 'fallback = ["*", "mqtt"]', "interfaces = []"])
def test_a_row_may_name_all_interfaces_or_none(folder: Path, row: str) -> None:
    loaded(folder, f"{TWO_UDP}[[policy]]\n{row}\n")


def test_the_interface_processes_are_an_interface_where_they_are_on(folder: Path) -> None:
    ipc = f'[endpoint]\nipc_out = "ipc://{folder}/out"\n[[policy]]\ninterfaces = ["ipc"]\n'
    assert loaded(folder, ipc).tables.endpoint.ipc_out
    heard = f'[endpoint]\nipc_in = "ipc://{folder}/in"\n[[policy]]\nmatch = {{ link_up = ["ipc"] }}\n'
    assert loaded(folder, heard).tables.endpoint.ipc_in


def test_an_interface_of_the_name_that_the_interface_processes_have_is_a_mistake(folder: Path) -> None:
    text = f'[endpoint]\nipc_in = "ipc://{folder}/in"\n' + TWO_UDP.replace("g5", "ipc")
    assert mistake(folder, text).startswith("interfaces.ipc: ")
    loaded(folder, TWO_UDP.replace("g5", "ipc"))


@pytest.mark.parametrize("name", ["*", "", "from_users", "to_users", "pull", "report", "router", "from_brokers"])
def test_interface_of_a_reserved_name_is_a_mistake(folder: Path, name: str) -> None:
    text = TWO_UDP.replace("interfaces.g5", f'interfaces."{name}"')
    assert tells(mistake(folder, text), f"{name!r} ", "interface's name")


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "/tmp/v2x/in/0", "ipc://"])
@pytest.mark.parametrize("key", ["ipc_in", "ipc_out"])
def test_an_address_of_interface_processes_is_a_path(folder: Path, key: str, address: str) -> None:
    assert mistake(folder, f'[endpoint]\n{key} = "{address}"\n').startswith(f"endpoint.{key}: ")


def test_a_row_that_names_no_type_is_a_mistake(folder: Path) -> None:
    said = mistake(folder, '[[policy]]\nmatch = { type = ["denm", "camm"] }\n')
    assert said.startswith("policy[0].match.type: unknown type 'camm'")


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("", "policy[0].interfaces: invalid with match.implausible"),
        ('interfaces = ["g5"]', "policy[0].interfaces: invalid with match.implausible"),
        ("interfaces = []\nlifetime_s = 2.0", "policy[0].lifetime_s: not allowed with match.implausible"),
        ('interfaces = []\nfallback = ["g5"]', "policy[0].fallback: not allowed with match.implausible"),
    ],
)
def test_a_row_for_received_messages_says_whether_they_are_dropped_and_nothing_else(
    folder: Path, row: str, said: str
) -> None:
    assert mistake(folder, f'{TWO_UDP}[[policy]]\nmatch.implausible = ["any"]\n{row}\n').startswith(said)


@pytest.mark.parametrize("key", ["implausible", "type"])
def test_an_empty_list_of_a_match_is_a_mistake(folder: Path, key: str) -> None:
    said = mistake(folder, f"[[policy]]\nmatch.{key} = []\ninterfaces = []\n")
    assert said.startswith(f"policy[0].match.{key}: empty")


@pytest.mark.parametrize("interfaces", ['["*"]', "[]"])
def test_a_row_for_received_messages_may_drop_them_or_pass_them_on(folder: Path, interfaces: str) -> None:
    loaded(folder, f'[[policy]]\nmatch.implausible = ["time", "own-address"]\ninterfaces = {interfaces}\n')


def test_an_unknown_reason_to_doubt_a_message_is_a_mistake(folder: Path) -> None:
    said = mistake(folder, '[[policy]]\nmatch.implausible = ["speed"]\ninterfaces = []\n')
    assert said.startswith("policy[0].match.implausible[0]")
    assert "own-address" in said


def test_a_name_that_the_users_have_replaced_is_no_type_any_more(folder: Path) -> None:
    text = "[[types]]\nnumber = 2\nname = 'mycam'\n[[policy]]\nmatch = { type = ['cam'] }\n"
    assert "unknown type 'cam'" in mistake(folder, text)


def test_a_row_may_name_a_type_of_the_users(folder: Path) -> None:
    loaded(folder, "[[types]]\nnumber = 200\nname = 'mine'\n[[policy]]\nmatch = { type = ['mine', 'vam'] }\n")


@pytest.mark.parametrize(
    ("payload", "word"),
    [
        ('{ offset = 0, value = "0g" }', "hexadecimal"),
        ('{ offset = 0, value = "000" }', "hexadecimal"),
        ('{ offset = 0, value = "00", mask = "zz" }', "hexadecimal"),
        ('{ offset = 0, value = "" }', "empty"),
        ('{ offset = 0, value = "0000", mask = "ff" }', "mask has 1 octets and value 2"),
    ],
)
def test_payload_octets_that_cannot_be_compared_are_a_mistake(folder: Path, payload: str, word: str) -> None:
    said = mistake(folder, f"[[policy]]\nmatch = {{ payload = [{payload}] }}\n")
    assert said.startswith("policy[0].match.payload[0]: ")
    assert word in said


def test_two_types_of_one_number_are_a_mistake(folder: Path) -> None:
    row = "[[types]]\nnumber = 200\nname = 'x'\n"
    assert mistake(folder, row * 3).startswith("types: number 200: given 3 times")


@pytest.mark.parametrize("name", ["", "Cam", "my test", "my.test", "é", "_-"])
def test_a_types_name_that_no_envelope_can_carry_is_a_mistake(folder: Path, name: str) -> None:
    said = mistake(folder, f"[[types]]\nnumber = 200\nname = '{name}'\n")
    assert said.startswith(f'types[0].name: invalid type name "{name}"; use only a-z')


def test_sockets_on_one_port_are_a_mistake(folder: Path) -> None:
    assert tells(mistake(folder, "[endpoint]\npull = 5556\n"), "port 5556 ", "two sockets")


def test_port_0_is_any_free_one_and_may_be_given_to_all(folder: Path) -> None:
    loaded(folder, "[endpoint]\nfrom_users = 0\nto_users = 0\npull = 0\nreport = 0\n")


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ('[station]\nname = ""', "station.name"),
        ('[station]\nname = "a\\nb"', "station.name"),
        (f'[station]\nname = "{200_000 * "a"}"', "has 200000 letters; give at most 64"),
        ('[endpoint]\nipc_in = "ipc:///tmp/x"\nipc_out = "ipc:///tmp/x"', "endpoint: ipc_in and ipc_out"),
        ("[[policy]]\nmatch.size = { min = 300, max = 100 }", "policy[0].match.size"),
    ],
)
def test_what_can_never_be_meant_is_a_mistake(folder: Path, text: str, key: str) -> None:
    assert any(key in line for line in mistakes(folder, text + "\n"))


SLOTS = 'name = "mine"\n[slots.v2x]\nusb = "1-1.3"\n[slots.cellular]\nusb = "1-1.4"\n'


@pytest.fixture
def slots(folder: Path) -> str:
    path = folder / "mine.toml"
    path.write_text(SLOTS)
    return str(path)


def test_an_interface_may_sit_in_a_slot_of_the_board(folder: Path, slots: str) -> None:
    read = loaded(folder, TWO_UDP, "interfaces.g5.slot=v2x", board=slots)
    assert [entry.queue.slot for entry in read.interfaces] == ["v2x", ""]


def test_slot_that_the_board_lacks_is_a_mistake_with_the_nearest_one(folder: Path, slots: str) -> None:
    (said,) = mistakes(folder, TWO_UDP, "interfaces.g5.slot=v2", board=slots)
    assert tells(said, "interfaces.g5.slot: ", "no slot 'v2'; ", "v2x?")
    (said,) = mistakes(folder, TWO_UDP, "interfaces.g5.slot=v2x")
    assert tells(said, "interfaces.g5.slot: ", "no slot 'v2x'; ", "known: none")


def test_interfaces_in_one_slot_are_a_mistake(folder: Path, slots: str) -> None:
    said = mistakes(folder, TWO_UDP, "interfaces.g5.slot=v2x", "interfaces.mqtt.slot=v2x", board=slots)
    assert tells(said[0], "interfaces.mqtt.slot: 'v2x' ", "g5 already; ", "slot")


LISTENING = """
[interfaces.near]
driver = "udp"
{near}
[interfaces.far]
driver = "udp"
{far}
"""
GROUP = "239.118.122.97:8947"


@pytest.mark.parametrize(
    ("near", "far", "said"),
    [
        ('listen = "127.0.0.1:8947"', 'listen = "127.0.0.1:8947"', 'far.listen: "127.0.0.1:8947" is that of near already; give each its own'),
        ('listen = "0.0.0.0:8947"', 'listen = "127.0.0.1:8947"', 'far.listen: "127.0.0.1:8947" is that of near already, 0.0.0.0:8947; give each its own'),
        ('listen = "127.0.0.2:8947"', 'listen = "0.0.0.0:8947"', 'far.listen: "0.0.0.0:8947" is that of near already, 127.0.0.2:8947; give each its own'),
        (f'group = "{GROUP}"', 'listen = "0.0.0.0:8947"', f'far.listen: "0.0.0.0:8947" is that of near already, {GROUP}; give each its own'),
        ('listen = "0.0.0.0:8947"', f'group = "{GROUP}"', f'far.group: "{GROUP}" is that of near already, 0.0.0.0:8947; give each its own'),
    ],
)  # fmt: skip
def test_two_interfaces_at_one_address_are_a_mistake(folder: Path, near: str, far: str, said: str) -> None:
    (told,) = mistakes(folder, LISTENING.format(near=near, far=far))
    assert told.endswith(f"interfaces.{said}")


@pytest.mark.parametrize(
    ("near", "far"),
    [
        ('listen = "127.0.0.1:8947"', 'listen = "127.0.0.1:8948"'),
        ('listen = "127.0.0.1:8947"', 'listen = "127.0.0.2:8947"'),
        ('listen = "127.0.0.1:8947"', f'group = "{GROUP}"'),
        (f'group = "{GROUP}"', f'group = "{GROUP}"'),
        ('listen = "0.0.0.0:0"', 'listen = "0.0.0.0:0"'),  # the kernel chooses
    ],
)
def test_two_interfaces_whose_addresses_do_not_meet_are_none(folder: Path, near: str, far: str) -> None:
    assert len(loaded(folder, LISTENING.format(near=near, far=far)).interfaces) == 2


MODEM = '[interfaces.cell]\ndriver = "sim8202g"\nport = "ttyUSB0"\nbearer = "none"\n'


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ('driver = "zed_f9p"\nport = "gnss"', '.port: "gnss" is already used by cell; a port can have one interface'),
        ('driver = "uart"\ndevice = "./ttyUSB0"', '.device: "./ttyUSB0" is already used by cell; a port can have one interface'),
        ('driver = "zed_f9p"\nkind = "static"\nlatitude = 1.0\nlongitude = 1.0\nport = "gnss"', ""),
        ('driver = "uart"\ndevice = "ttyUSB1"', ""),
        ('driver = "uart"\ndevice = "tty\\u0000"', f".device: {captain_toml.ZERO}"),
    ],
)  # fmt: skip
def test_two_interfaces_at_one_serial_port_are_a_mistake_by_whatever_names(
    folder: Path, monkeypatch: pytest.MonkeyPatch, other: str, said: str
) -> None:
    monkeypatch.chdir(folder)
    (folder / "ttyUSB0").touch()
    (folder / "gnss").symlink_to("ttyUSB0")
    text = f"{MODEM}[interfaces.other]\n{other}\n"
    if said:
        assert [line for line in mistakes(folder, text) if line.endswith(f"interfaces.other{said}")]
    else:
        assert len(loaded(folder, text).interfaces) == 2


def test_interfaces_at_one_module_are_a_mistake(folder: Path) -> None:
    text = '[interfaces.cell]\ndriver = "sim8202g"\nusb = "1-1.4"\n[interfaces.gnss]\ndriver = "zed_f9p"\nusb = "{}"\n'
    said = mistake(folder, text.format("1-1.4"))
    assert tells(said, 'interfaces.gnss.usb: "1-1.4" ', "cell already; ", "module")
    assert len(loaded(folder, text.format("1-1.3")).interfaces) == 2


@pytest.mark.parametrize("slot", ["5", "true", "[]"])
def test_a_slot_that_is_no_name_is_a_mistake(folder: Path, slots: str, slot: str) -> None:
    (said,) = mistakes(folder, TWO_UDP, f"interfaces.g5.slot={slot}", board=slots)
    assert "interfaces.g5: slot: " in said


@dataclass(frozen=True)
class _UsbOptions:
    """Of a driver whose module sits on USB, or at a port."""

    usb: str = ""
    port: str = ""

    def __post_init__(self) -> None:
        if bool(self.usb) == bool(self.port):
            raise ConfigurationError("one of usb and port")


class _UsbDriver:
    Options = _UsbOptions


@pytest.mark.parametrize(("given", "usb"), [("", "1-1.4"), ('usb = "2-1"', "2-1"), ('port = "/dev/ttyS0"', "")])
def test_a_driver_looks_where_its_slot_is_unless_it_is_told_to_look_elsewhere(
    folder: Path, slots: str, monkeypatch: pytest.MonkeyPatch, given: str, usb: str
) -> None:
    monkeypatch.setitem(drivers.LOADERS, "usb", lambda: _UsbDriver)
    text = f"[interfaces.modem]\ndriver = 'usb'\nslot = 'cellular'\n{given}\n"
    (modem,) = loaded(folder, text, board=slots).interfaces
    assert modem.options.usb == usb


TWO_CLIENTS = """
[interfaces.near]
driver = "mqtt"
url = "mqtts://broker.example"
[interfaces.far]
driver = "mqtt"
url = "{url}"
client_id = "{client}"
"""


@pytest.mark.parametrize(
    ("url", "client"),
    [
        ("mqtts://broker.example", ""),
        ("mqtts://broker.example:8883/", ""),
        ("MQTTS://Broker.Example", os.uname().nodename),
        ("mqtts://broker.example.", ""),
    ],
)
def test_clients_of_one_name_at_one_broker_are_a_mistake(folder: Path, url: str, client: str) -> None:
    (said,) = mistakes(folder, TWO_CLIENTS.format(url=url, client=client))
    name = os.uname().nodename
    assert tells(said, f"interfaces.far.client_id: {name!r} ", "near", "same broker; ")


@pytest.mark.parametrize(
    ("url", "client"),
    [("mqtts://broker.example", "vm-2"), ("mqtts://other.example", ""), ("mqtts://broker.example:8884", "")],
)
def test_two_clients_of_two_names_or_at_two_brokers_are_none(folder: Path, url: str, client: str) -> None:
    assert len(loaded(folder, TWO_CLIENTS.format(url=url, client=client)).interfaces) == 2
