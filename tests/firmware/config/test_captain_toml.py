"""captain.toml over a board file: what is taken, and that every mistake is named at once with its place."""

import re
from pathlib import Path

import pytest

from board.runtime.errors import ConfigurationError
from firmware.config import board_file, captain_toml
from firmware.config.tables import ConfiguredPosition, Span
from tests.firmware.written import TWO_UDP, loaded, mistake, mistakes
from tests.said import tells


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path


def test_an_empty_file_is_a_station_with_defaults(folder: Path) -> None:
    tables = loaded(folder, "").tables
    assert (tables.station.name, tables.station.profile, tables.station.position) == ("captain", "standard", None)
    ports = tables.endpoint
    assert (ports.from_users, ports.to_users, ports.pull, ports.report) == (5555, 5556, 5557, 5558)
    assert ports.address == "127.0.0.1"
    assert (tables.reception.unverified, tables.reception.gn_versions) == ("deliver", (1,))
    assert tables.reception.duplicate_window_s == 2.0


def test_no_file_at_all_is_the_board_with_defaults() -> None:
    read = captain_toml.load(None)
    assert read.board.name == "sim"
    assert [interface.name for interface in read.interfaces] == list(read.board.interfaces)
    assert read.board.neighbours is not None


@pytest.mark.parametrize("board", ["sim", "none"])
def test_each_board_of_the_project_is_read(board: str) -> None:
    assert captain_toml.load(None, (), board).board.name == board


def test_every_board_file_that_ships_is_read() -> None:
    for path in board_file.BOARDS.glob("*.toml"):
        assert captain_toml.load(None, (), path.stem).board.name == path.stem


def test_all_sections_are_read(folder: Path) -> None:
    text = """
[station]
name = "rsu"
profile = "legacy"
mac = "02:00:00:00:00:0b"
position = { latitude = 48.5, longitude = -11 }
[endpoint]
from_users = 0
to_users = 0
strict = true
[reception]
gn_versions = [0, 1]
[interfaces.g5]
driver = "udp"
listen = "127.0.0.1:0"
queue = 7
rate_per_s = 2
[[types]]
number = 200
name = "my_test2"
btp_port = 3000
[[policy]]
name = "near"
match = { type = ["my_test2"], size = { min = 7 }, link_up = ["g5"] }
interfaces = ["g5"]
"""
    read = loaded(folder, text)
    assert read.mac == bytes.fromhex("02000000000b")
    assert read.tables.station.position == ConfiguredPosition(48.5, -11.0)
    assert read.tables.reception.gn_versions == (0, 1)
    (interface,) = read.interfaces
    assert (interface.name, interface.queue.driver, interface.queue.queue) == ("g5", "udp", 7)
    assert interface.options.listen == "127.0.0.1:0"
    (row,) = read.tables.policy
    assert (row.match.type, row.match.size, row.interfaces) == (("my_test2",), Span(7, None), ("g5",))


def test_the_file_lies_over_the_board(folder: Path) -> None:
    text = '[interfaces.uplink]\ndriver = "udp"\nlisten = "127.0.0.1:0"\n'
    there = list(board_file.load("sim").interfaces)
    assert [entry.name for entry in loaded(folder, text, board="sim").interfaces] == [*there, "uplink"]
    text = text.replace("uplink", there[0])
    first, *_ = loaded(folder, text, board="sim").interfaces
    assert first.options.listen == "127.0.0.1:0"


def test_an_override_goes_before_the_file_and_the_board(folder: Path) -> None:
    read = loaded(folder, '[station]\nname = "a"\n', "station.name=b", "interfaces.g5.queue=9", board="sim")
    assert read.tables.station.name == "b"
    assert read.interfaces[0].queue.queue == 9


def test_an_override_of_one_load_is_not_seen_by_the_next() -> None:
    captain_toml.load(None, ["interfaces.g5.queue=9"])
    assert captain_toml.load(None).interfaces[0].queue.queue == 256


def test_overrides_alone_can_make_an_interface() -> None:
    read = captain_toml.load(None, ["interfaces.air.driver=udp", "interfaces.air.listen=127.0.0.1:0"], "none")
    assert [interface.name for interface in read.interfaces] == ["air"]


def test_a_board_file_is_read_by_its_path(folder: Path) -> None:
    path = folder / "mine.toml"
    path.write_text('name = "mine"\n[interfaces.air]\ndriver = "udp"\nlisten = "127.0.0.1:0"\n')
    assert captain_toml.load(None, (), str(path)).interfaces[0].name == "air"


def test_an_unknown_board_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(ConfigurationError, match="'simm' is not known") as caught:
        captain_toml.load(None, (), "simm")
    known = ", ".join(sorted(path.stem for path in board_file.BOARDS.glob("*.toml")))
    assert f"one of {known}" in caught.value.hint


@pytest.mark.parametrize("board", ["", "no/such.toml", "nosuch.toml", "../../etc/passwd"])
def test_a_board_file_that_is_none_is_refused(board: str) -> None:
    with pytest.raises(ConfigurationError):
        captain_toml.load(None, (), board)


def test_board_file_with_a_mistake_is_named(folder: Path) -> None:
    path = folder / "mine.toml"
    path.write_text('nam = "mine"\n')
    with pytest.raises(ConfigurationError) as caught:
        captain_toml.load(None, (), str(path))
    assert tells(str(caught.value), f"{path}: nam: ", "not a known key; ", "name?")


def test_a_file_that_is_not_there_is_refused(folder: Path) -> None:
    with pytest.raises(ConfigurationError, match="cannot be read"):
        captain_toml.load(str(folder / "nowhere.toml"))


def test_a_file_that_is_not_toml_names_the_line(folder: Path) -> None:
    assert "line 2" in mistakes(folder, "[station]\nname = \n")[0]


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("[station]\nname = 5", "station.name"),
        ('[station]\nprofile = "legcy"', "station.profile"),
        ("[station]\nposition = { latitude = 91, longitude = 0 }", "station.position.latitude"),
        ("[station]\nposition = { latitude = 1 }", "station.position.longitude"),
        ("[endpoint]\npull = 65536", "endpoint.pull"),
        ("[endpoint]\npull = -1", "endpoint.pull"),
        ("[endpoint]\nstrict = 1", "endpoint.strict"),
        ("[reception]\ngn_versions = [16]", "reception.gn_versions[0]"),
        ("[reception]\ngn_versions = 1", "reception.gn_versions"),
        ('[reception]\nunverified = "maybe"', "reception.unverified"),
        ("[reception]\nduplicate_window_s = -1", "reception.duplicate_window_s"),
        ("[[types]]\nnumber = 256\nname = 'x'", "types[0].number"),
        ("[[types]]\nname = 'x'", "types[0].number"),
        ("[[types]]\nnumber = 1", "types[0].name"),
        ("[types]\nnumber = 1", "types"),
        ("[[policy]]\npriority = 8", "policy[0].priority"),
        ("[[policy]]\nrate_per_s = -1", "policy[0].rate_per_s"),
        ("[[policy]]\n[[policy]]\nmatch = { area = 'here' }", "policy[1].match.area"),
        ("[[policy]]\nmatch = { typ = ['cam'] }", "policy[0].match.typ"),
        ("[[policy]]\nmatch = { station = [-1] }", "policy[0].match.station[0]"),
        ("[[policy]]\nmatch = { station = [4294967296] }", "policy[0].match.station[0]"),
        ("[[policy]]\nmatch = { payload = [{ offset = 1500, value = '00' }] }", "policy[0].match.payload[0].offset"),
        ("[[policy]]\nmatch = { neighbours = { within_s = 5 } }", "policy[0].match.neighbours.interface"),
        ("interfaces = 5", "interfaces"),
        ("[interfaces]\ng5 = 5", "interfaces.g5"),
        ("[interfaces.g5]\nqueue = 5", "interfaces.g5"),
        ("[interfaces.g5]\ndriver = 'udpp'", "interfaces.g5.driver"),
        ("[interfaces.g5]\ndriver = 'udp'\nlisten = '127.0.0.1:0'\nqueue = 0", "interfaces.g5: queue"),
        ("[interfaces.g5]\ndriver = 'udp'\nlisten = '127.0.0.1:0'\nlistn = 1", "interfaces.g5: listn"),
        ("[stations]\nname = 'x'", "stations"),
    ],
)
def test_one_mistake_is_one_line_that_names_the_key(folder: Path, text: str, key: str) -> None:
    assert mistake(folder, text).startswith(f"{key}: ")


def test_mistakes_of_all_sections_are_named_at_once(folder: Path) -> None:
    text = """
[station]
profile = "legcy"
mac = "nonsense"
[endpoint]
pull = 70000
[interfaces.g5]
driver = "udp"
queue = 0
listn = "x"
[interfaces.mqtt]
driver = "mqqt"
[[types]]
number = 300
name = "A"
[[policy]]
interfaces = ["nobody"]
"""
    said = "\n".join(mistakes(folder, text))
    for key in ("profile", "endpoint.pull", "queue", "listn", "interfaces.mqtt.driver", "types[0].number", "'nobody'"):
        assert key in said, key


def test_a_mistake_in_one_section_does_not_hide_what_two_have_to_do_with_each_other(folder: Path) -> None:
    text = """
[station]
mac = "nonsense"
[endpoint]
strict = 5
[reception]
gn_versions = [99]
[[types]]
number = 200
name = "Wrong"
[[policy]]
interfaces = ["nobody"]
match = { type = ["camm"] }
"""
    said = mistakes(folder, text)
    assert len(said) == 6, said


@pytest.mark.parametrize(
    "mac",
    [
        "02:00:00:00:00",
        "02:00:00:00:00:00:01",
        "03:00:00:00:00:01",
        "ff:ff:ff:ff:ff:ff",
        "00:00:00:00:00:00",
        "02:00:00:00:00:100",
        "02:00:00:00:00:-1",
        "02-00-00-00-00-01",
        "g2:00:00:00:00:01",
        "nonsense",
        ":::::",
    ],
)
def test_what_is_no_address_of_a_station_is_a_mistake(folder: Path, mac: str) -> None:
    assert mistake(folder, f'[station]\nmac = "{mac}"\n').startswith("station.mac: ")


def test_an_address_that_nobody_gave_is_made_from_the_name() -> None:
    def mac(name: str) -> bytes:
        return captain_toml.load(None, [f"station.name={name}"], "none").mac

    macs = {mac(f"station{number}") for number in range(200)}
    assert len(macs) == 200
    assert mac("a") == mac("a")
    assert all(len(made) == 6 and made[0] == 0x02 for made in macs)


def test_a_written_configuration_gets_no_simulated_board_unless_it_asks(folder: Path) -> None:
    (folder / "captain.toml").write_text('[station]\nname = "a"\n')
    assert captain_toml.load(str(folder / "captain.toml")).board.name == "none"
    assert captain_toml.load(str(folder / "captain.toml"), board="sim").board.name == "sim"
    assert captain_toml.load(None).board.name == "sim"


def test_two_stations_of_one_name_on_one_host_have_addresses_of_their_own() -> None:
    one, other = (captain_toml.load(None, [f"endpoint.from_users={port}"], "none").mac for port in (5555, 5565))
    assert one != other


def test_a_mistake_is_looked_for_in_the_file_that_has_it(folder: Path) -> None:
    board = folder / "miss.toml"
    board.write_text('name = "miss"\n[interfaces.air]\ndriver = "nosuch"\n')
    (of_board,) = mistakes(folder, "", board=str(board))
    assert of_board.startswith(f"{board}: interfaces.air.driver: unknown driver 'nosuch'")
    (of_file,) = mistakes(folder, '[interfaces.air]\ndriver = "other"\n', board=str(board))
    assert of_file.startswith(f"{folder}/captain.toml: interfaces.air.driver: unknown driver 'other'")
    (given,) = mistakes(folder, "", "interfaces.air.driver=third", board=str(board))
    assert given.startswith(f"{folder}/captain.toml: interfaces.air.driver: unknown driver 'third'")


def test_a_bearer_that_is_none_is_told_with_the_other_mistakes(folder: Path) -> None:
    text = (
        TWO_UDP
        + """
[interfaces.v2n]
driver = "mqtt"
url = "mqtt://localhost"
bearer = "celular"
qos = 7
[interfaces.v3n]
driver = "mqtt"
url = "mqtt://localhost"
client_id = "third"
bearer = "g5"
[station]
name = ""
"""
    )
    told = [line.removeprefix(f"{folder}/captain.toml: ") for line in mistakes(folder, text)]
    assert [line.partition(";")[0].partition(" carries ")[0] for line in told if "bearer" in line] == [
        "interfaces.v2n.bearer: unknown interface 'celular'",
        "interfaces.v3n.bearer: 'g5'",
    ]
    assert any("qos" in line for line in told)
    assert any("station.name" in line for line in told)


def test_the_key_of_a_policy_that_names_no_interface_is_told(folder: Path) -> None:
    text = (
        TWO_UDP
        + """
[[policy]]
interfaces = ["radio"]
fallback = ["g6"]
match.link_up = ["g7"]
match.link_down = ["*"]
match.neighbours = { interface = "g8" }
match.no_neighbours = { interface = "g9" }
"""
    )
    told = [line.removeprefix(f"{folder}/captain.toml: ").partition(";")[0] for line in mistakes(folder, text)]
    assert told == [
        "policy[0].interfaces: unknown interface 'radio'",
        "policy[0].fallback: unknown interface 'g6'",
        "policy[0].match.link_up: unknown interface 'g7'",
        "policy[0].match.link_down: unknown interface '*'",
        "policy[0].match.neighbours.interface: unknown interface 'g8'",
        "policy[0].match.no_neighbours.interface: unknown interface 'g9'",
    ]


def test_without_a_file_a_mistake_is_told_of_what_was_set() -> None:
    with pytest.raises(ConfigurationError) as caught:
        captain_toml.load(None, ["interfaces.v2n={driver='mqtt', url='mqtt://localhost', depths=14}", "station.nam=1"])
    assert [line.partition("; ")[0] for line in str(caught.value).splitlines()] == [
        "--set: station.nam: is not a known key",
        "--set: interfaces.v2n: depths: 14 is an integer",
    ]


def test_mistake_without_a_file_and_options_is_of_the_board(tmp_path: Path) -> None:
    board = tmp_path / "mine.toml"
    board.write_text('name = "mine"\n[interfaces.air]\ndriver = "udp"\nlisten = "127.0.0.1:0"\nslot = "a"\n')
    with pytest.raises(ConfigurationError) as caught:
        captain_toml.load(None, [], str(board))
    assert tells(str(caught.value), f"{board}: interfaces.air.slot: ", "no slot 'a'")


def test_all_mistakes_of_an_interface_at_a_broker_are_told_at_once(folder: Path) -> None:
    text = """[interfaces.v2n]
driver = "mqtt"
url = "localhost"
profile = "vcaptian"
client_id = "a+"
host = "("
prefix = "a/#"
qos = 9
keep_alive_s = 1
device = "a/b"
certificate = "own.pem"
username = "me"
depths = [3]
bearer = "celular"
"""
    told = [line.removeprefix(f"{folder}/captain.toml: interfaces.v2n") for line in mistakes(folder, text)]
    assert [re.match(r"\W*(\w+)", line)[1] for line in told] == [  # type: ignore[index]
        *("keep_alive_s", "qos", "url", "profile", "client_id", "host", "prefix", "certificate", "username"),
        *("device", "depths", "bearer"),
    ]


GNSS = """
[interfaces.gnss]
driver = "zed_f9p"
port = "/dev/ttyAMA0"
"""


MORE = """
[interfaces.second]
driver = "zed_f9p"
port = "/dev/ttyUSB1"
"""


@pytest.fixture
def pulsed(folder: Path) -> str:
    """A board with the input of a pulse."""
    board = folder / "pulsed.toml"
    board.write_text('name = "pulsed"\n[pulse]\ndevice = "/dev/pps0"\n')
    return str(board)


def test_the_only_receiver_drives_the_pulse_without_being_named(folder: Path, pulsed: str) -> None:
    assert loaded(folder, GNSS, board=pulsed).board.pulse is not None


def test_receivers_of_pulses_without_time_receiver_are_a_mistake_that_names_them(folder: Path, pulsed: str) -> None:
    (told,) = mistakes(folder, GNSS + MORE, board=pulsed)
    assert tells(told, "time.receiver: gnss and second ", "pulses; ", "board's input")
    assert loaded(folder, '[time]\nreceiver = "second"\n' + GNSS + MORE, board=pulsed).tables.time.receiver == "second"


@pytest.mark.parametrize("path", ["chrony.sock", "/run/a b", "/run/a:b"])
def test_a_socket_that_chronyd_cannot_make_is_a_mistake(folder: Path, path: str) -> None:
    told = mistake(folder, f'[time]\nchrony = "{path}"\n')
    assert told.startswith(f"time.chrony: {path!r}: chronyd cannot make a socket there; ")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("gns", "time.receiver: unknown interface 'gns'; did you mean gnss?"),
        ("g5", "time.receiver: 'g5' announces no pulses; known: gnss"),
    ],
)
def test_who_announces_no_pulses_drives_none(folder: Path, name: str, said: str) -> None:
    assert mistake(folder, f'[time]\nreceiver = "{name}"\n' + GNSS + TWO_UDP) == said


def test_a_file_may_be_laid_over_the_boxs_own(folder: Path) -> None:
    box, own = folder / "box.toml", folder / "captain.toml"
    box.write_text('[station]\nname = "captain"\n[endpoint]\naddress = "0.0.0.0"\n[time]\ntracking = true\n')
    own.write_text('[station]\nname = "rsu"\n[endpoint]\nstrict = true\n')
    tables = captain_toml.load(str(own), board="none", defaults=str(box)).tables
    assert (tables.station.name, tables.endpoint.address, tables.endpoint.strict) == ("rsu", "0.0.0.0", True)
    assert tables.time.tracking is True


def test_what_the_owners_file_has_wrong_is_told_over_defaults_too(folder: Path) -> None:
    box, own = folder / "box.toml", folder / "captain.toml"
    box.write_text('[endpoint]\naddress = "0.0.0.0"\n')
    own.write_text("endpoint = 3\n")
    with pytest.raises(ConfigurationError, match="endpoint: 3 is an integer; give a table"):
        captain_toml.load(str(own), board="none", defaults=str(box))


def test_the_same_configuration_has_the_same_digest_and_another_one_another() -> None:
    assert captain_toml.load(None, ["station.name=a"]).digest == captain_toml.load(None, ["station.name=a"]).digest
    assert captain_toml.load(None, ["station.name=a"]).digest != captain_toml.load(None, ["station.name=b"]).digest
    assert len(captain_toml.load(None).digest) == 16


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[policy]\nname = "a"\n', 'policy: {name = "a"} is a table; write [[policy]]'),
        ('[types]\nname = "a"\n', 'types: {name = "a"} is a table; write [[types]]'),
        ("[[endpoint]]\nsub = 5555\n", "endpoint: [{sub = 5555}] is an array; write [endpoint]"),
    ],
)
def test_wrong_brackets_are_told_with_those_to_write(folder, text, said) -> None:
    assert mistake(folder, text) == said
