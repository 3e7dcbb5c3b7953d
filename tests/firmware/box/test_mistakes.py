"""Each mistake that an owner makes on a card is named, with its file and line, and refuses the whole set."""

import pytest

from firmware.box.verdict import Verdict
from tests.firmware.box.conftest import KEY, Files, Look, mistakes, remarks

CAPTAIN = '[station]\nname = "rsu-7"\n'
BOX = 'host_name = "captain-7"\n'
WIFI = '[wifi]\ncountry = "DE"\nssid = "depot"\n'


def only(found: Verdict) -> str:
    (text,) = mistakes(found)
    assert not found.is_accepted
    return text


def test_a_sound_set_is_taken_whole(look: Look):
    found = look({"captain.toml": CAPTAIN, "box.toml": BOX + WIFI + 'password = "12345678"\n', "authorized_keys": KEY})
    assert (mistakes(found), remarks(found)) == ([], [])
    assert (found.options.host_name, found.keys) == ("captain-7", [KEY])
    assert found.options.wifi is not None
    assert found.options.wifi.ssid == "depot"


def test_a_card_without_files_is_taken_and_says_that_nobody_can_log_in(look: Look):
    found = look({})
    assert found.is_accepted
    assert remarks(found) == [
        "authorized_keys: there is no ssh key: nobody can log in by ssh; put the line of your .pub file into "
        "authorized_keys"
    ]


@pytest.mark.parametrize(
    ("files", "said"),
    [
        # captain.toml
        ({"captain.toml": "[statoin]\nname = 'x'\n"}, "captain.toml:1: statoin: is not a known key; did you mean station?"),
        ({"captain.toml": '\n[interface.x]\ndriver = "udp"\n'}, "captain.toml:2: interface: is not a known key; did you mean interfaces?"),
        ({"captain.toml": "[endpoint]\nfrom_users = 66000\n"}, "captain.toml:2: endpoint.from_users: 66000 is out of range; give at least 0 and at most 65535"),
        ({"captain.toml": "[station]\nname = rsu\n"}, "captain.toml:2: is not TOML: Invalid value; text stands in quotes: key = \"value\""),
        ({"captain.toml": '[interfaces.g5]\nqueue = 0\ndriver = "udp"\nlisten = "127.0.0.1:0"\n'}, "captain.toml:2: interfaces.g5: queue: 0 is out of range; give at least 1 and at most 65536"),
        ({"captain.toml": '[[policy]]\n[[policy]]\nrate_per_s = "x"\n'}, 'captain.toml:3: policy[1].rate_per_s: "x" is text in quotes; give a number'),
        ({"captain.toml": '[interfaces.a]\ndriver = "upd"\n'}, "captain.toml:2: interfaces.a.driver: unknown driver 'upd'; one of ethernet, morse, mqtt, sim8202g, som301e, uart, udp, zed_f9p"),
        # box.toml
        ({"box.toml": 'host_name = "rsu_7"\n'}, 'box.toml:1: host_name: "rsu_7" is no host name: letters, digits, and - between them; write rsu-7'),
        ({"box.toml": 'host_name = "rsu-7.local"\n'}, 'box.toml:1: host_name: "rsu-7.local" is no host name: letters, digits, and - between them; write rsu-7'),
        ({"box.toml": '\n[wifi]\ncountry = "UK"\nssid = "x"\n'}, 'box.toml:3: wifi.country: "UK" is no country; the United Kingdom is GB'),
        ({"box.toml": '[wifi]\ncountry = "uk"\nssid = "x"\n'}, 'box.toml:2: wifi.country: "uk" is no country; the United Kingdom is GB'),
        ({"box.toml": '[wifi]\ncountry = "xx"\nssid = "x"\n'}, 'box.toml:2: wifi.country: "xx" is no country; two capital letters of ISO 3166, such as "DE"'),
        ({"box.toml": '[wifi]\ncountry = "de"\nssid = "x"\n'}, 'box.toml:2: wifi.country: "de" is no country; write DE'),
        ({"box.toml": '[wifi]\nssid = "x"\n'}, "box.toml:1: wifi.country: is missing; give text in quotes"),
        ({"box.toml": WIFI + "password = 12345678\n"}, 'box.toml:4: wifi.password: is no text; write it in quotes: password = "..."'),
        ({"box.toml": WIFI + 'password = "secret"\n'}, "box.toml:4: wifi.password: has 6 characters; WPA wants 8 to 63; of an open network leave the password out"),
        ({"box.toml": WIFI + 'password = "geheim-é-geheim"\n'}, "box.toml:4: wifi.password: character 8 is none that WPA takes; only letters, digits and signs of ASCII"),
        ({"box.toml": WIFI + f'password = "12345678"\npsk = "{64 * "a"}"\n'}, "box.toml:5: wifi: psk: is given beside password; leave one out"),
        ({"box.toml": "[console]\nshell = 0\n"}, "box.toml:2: console.shell: 0 is an integer; give true or false"),
        ({"box.toml": 'time_zone = "Berlin"\n'}, 'box.toml:1: time_zone: "Berlin" is no time zone; write for example "Europe/Berlin", or leave it out for UTC'),
        ({"box.toml": '[eth0]\naddress = "192.168.1.20"\n'}, 'box.toml:2: eth0.address: "192.168.1.20" has no length of its network; write for example "192.168.1.20/24"'),
        ({"box.toml": '[eth0]\naddress = "192.168.1.0/24"\n'}, 'box.toml:2: eth0.address: "192.168.1.0/24" is the address of a whole network; give one of it to the box'),
        ({"box.toml": '[eth0]\naddress = "10.0.0.2/24"\ngateway = "10.0.1.1"\n'}, 'box.toml:3: eth0: gateway: "10.0.1.1" is not in the network 10.0.0.0/24 of the box; correct one'),
        ({"box.toml": '[eth0]\naddress = "2001:db8::7"\n'}, 'box.toml:2: eth0.address: "2001:db8::7" has no length of its network; write for example "2001:db8::7/64"'),
        ({"box.toml": '[eth0]\naddress = "mine"\n'}, 'box.toml:2: eth0.address: "mine" is no address; write for example "10.0.0.20/24"'),
        ({"box.toml": f"\nname = {5000 * '9'}\n"}, 'box.toml:2: is not TOML: a number has too many digits; text stands in quotes: key = "value"'),
        ({"captain.toml": f"\nname = {5000 * '9'}\n"}, 'captain.toml:2: is not TOML: a number has too many digits; text stands in quotes: key = "value"'),
        ({"box.toml": f"name = {2000 * '['}"}, "box.toml: is nested too deep; is it the right file?"),
        ({"box.toml": "hostname = 'x'\n"}, "box.toml:1: hostname: is not a known key; did you mean host_name?"),
        ({"box.toml": 'host_name = "a\n'}, "box.toml:1: is not TOML: Illegal character '\\n'; compare with the example in README"),
        # board.toml
        ({"board.toml": 'name = "mine"\n[identity]\nbus = "main"\naddress = 80\n'}, "board.toml:3: identity.bus: 'main' is not declared; add a table [buses.main]"),
        # what is on the card
        ({"captain.tml": CAPTAIN}, "captain.tml: is not read; rename it to captain.toml"),
        ({"authorised_keys": KEY}, "authorised_keys: is not read; rename it to authorized_keys"),
        ({"id_ed25519.pub": KEY}, "id_ed25519.pub: is not read; rename it to authorized_keys"),
        ({"captain.toml": CAPTAIN, "captain.toml.txt": "[station]\n"}, "captain.toml: is there beside captain.toml.txt, which says something else; remove the one that is not meant"),
        ({"captain.toml/x": ""}, "captain.toml: is no file; put a text file there"),
        ({"captain.txt": CAPTAIN}, "captain.txt: is not read; rename it to captain.toml"),
        ({"wifi.txt": BOX}, "wifi.txt: is not read; rename it to box.toml"),
        ({"mqtt": "x"}, "mqtt: is no folder; make a folder mqtt, and put the files into it"),
        ({"lib": "x"}, "lib: is no folder; make a folder lib, and put the files into it"),
        ({"id_ed25519": "x"}, "id_ed25519: is a private key, which belongs on your own computer only; put the file that ends in .pub here, and make a new pair"),
        ({"mqtt/new/ca.pem": ""}, "mqtt/new: is a folder; put the files into mqtt/ itself"),
        ({"box.toml": BOX + "#" * 65_536}, "box.toml: has more than 65536 octets; is it the right file?"),
        ({"mqtt/ca.pem": "#" * 262_145}, "mqtt/ca.pem: has more than 262144 octets; is it the right file?"),
        ({f"mqtt/{number}.pem": "" for number in range(65)}, "mqtt: has 65 files, and 64 at most are read; remove those that captain.toml does not name"),
        # what editors do
        ({"box.toml": "# Büro\n".encode("latin-1") + BOX.encode()}, "box.toml:1: octet 0xfc is not UTF-8; save it as UTF-8"),
        ({"captain.toml": b"{\\rtf1\\ansi\n}"}, "captain.toml: is rich text (RTF); in TextEdit choose Format, Make Plain Text, and save again"),
        ({"box.toml": bytes(4096)}, "box.toml: has 4096 octets of zero and nothing else; it was not written to its end: copy it again, and eject the card before you pull it"),
        ({"box.toml": BOX.encode() + b"x\0"}, "box.toml:2: has a zero octet: this is no text; save it as UTF-8"),
    ],
)  # fmt: skip
def test_it_is_named_with_its_place_and_what_to_do(look: Look, files: Files, said: str):
    assert only(look(files)) == said


def test_each_address_of_an_interface_is_told_in_its_line(look: Look):
    udp = '[interfaces.a]\ndriver = "udp"\nlisten = "localhost:1"\npeers = ["x"]\n'
    ethernet = '[interfaces.b]\ndriver = "ethernet"\nmac = "zz"\ndevice = "a/b"\n'
    assert [text.partition(" is no ")[0] for text in mistakes(look({"captain.toml": udp + ethernet}))] == [
        'captain.toml:3: interfaces.a: listen: "localhost:1"',
        'captain.toml:4: interfaces.a: peers: "x"',
        'captain.toml:8: interfaces.b: device: "a/b"',
        'captain.toml:7: interfaces.b: mac: "zz"',
    ]


def test_each_of_several_addresses_is_told(look: Look):
    box = 'time_servers = ["a b", "ntp", "c d"]\n[eth0]\naddress = "10.0.0.5/24"\ngateway = "10.0.0.5"\ndns = ["a", "b"]\n'
    assert mistakes(look({"box.toml": box})) == [
        'box.toml:5: eth0.dns[0]: "a" is no address; write for example "10.0.0.1"',
        'box.toml:5: eth0.dns[1]: "b" is no address; write for example "10.0.0.1"',
        'box.toml:4: eth0: gateway: "10.0.0.5" is no other host of the network 10.0.0.0/24; correct it',
        'box.toml:1: time_servers[0]: "a b" is no host; write for example "ptbtime1.ptb.de"',
        'box.toml:1: time_servers[2]: "c d" is no host; write for example "ptbtime1.ptb.de"',
    ]


def test_every_mistake_of_every_file_is_told_at_once(look: Look):
    found = look({
        "captain.toml": "[station]\nnmae = 'x'\n[endpoint]\npull = -1\n",
        "box.toml": '[wifi]\ncountry = "UK"\n',
        "authorized_keys": "ssh-rsa\n",
        "board.toml": "nam = 3\n",
        "user-data": "hostname:\n\t- x\n",
    })  # fmt: skip
    places = {text.split(": ")[0] for text in mistakes(found)}
    assert places == {
        "captain.toml:2", "captain.toml:4", "box.toml:1", "box.toml:2", "authorized_keys:1", "board.toml", "board.toml:1",
        "user-data:2",
    }  # fmt: skip


def test_a_password_is_never_told(look: Look):
    for word in ("geheim7", "12345678é"):
        found = look({"box.toml": WIFI + f'password = "{word}"\n'})
        assert not any(word in note.text for note in found.notes)
    found = look({
        "box.toml": WIFI + "password = 87654321\n",
        "network-config": 'network:\n  wifis:\n    wlan0:\n      access-points:\n        "depot":\n          password: "kurz12"\n',
    })  # fmt: skip
    assert not any(word in note.text for note in found.notes for word in ("87654321", "kurz12"))


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-8"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_byte_order_marks_and_ends_of_lines_are_the_editors_own(look: Look, encoding: str, end: str):
    text = '# Büro\n[station]\nname = "rsu-7"\n'.replace("\n", end)
    found = look(
        {"captain.toml": text.encode(encoding), "authorized_keys": (KEY + "\n").replace("\n", end).encode(encoding)}
    )
    assert mistakes(found) == []
    assert found.files["captain.toml"].decode() == '# Büro\n[station]\nname = "rsu-7"\n'
    assert found.keys == [KEY]


def test_upper_case_names_and_the_hidden_end_of_a_name_are_taken(look: Look):
    found = look({"CAPTAIN.TOML": CAPTAIN, "authorized_keys.txt": KEY})
    assert found.is_accepted
    assert found.keys == [KEY]
    assert remarks(found) == [
        "authorized_keys.txt: is taken as authorized_keys; better rename it; Windows hides the end of names"
    ]


def test_a_mistake_is_told_by_the_name_that_the_file_has(look: Look):
    assert only(look({"Captain.toml.txt": "[station]\nnmae = 1\n"})).startswith("Captain.toml.txt:2: station.nmae: ")


def test_what_computers_leave_on_a_card_is_nothing(look: Look):
    found = look({
        "authorized_keys": KEY, "._authorized_keys": b"\0\5\x16\7", ".DS_Store": b"", "System Volume Information/x": b"",
        "start4.elf": b"\x7fELF", "config.txt": "arm_64bit=1\n", "README.txt": "", "photo.jpg": b"\xff\xd8",
    })  # fmt: skip
    assert [note.text for note in found.notes] == []


def test_programs_and_files_of_other_systems_are_named_and_not_read(look: Look):
    found = look({"authorized_keys": KEY, "firstrun.sh": "reboot", "wpa_supplicant.conf": "network={}", "ssh": ""})
    assert found.is_accepted
    assert [text.split(": ")[0] for text in remarks(found)] == ["firstrun.sh", "ssh", "wpa_supplicant.conf"]
    assert "nothing here is ever run" in remarks(found)[0]


def test_a_file_for_brokers_may_be_longer_than_one_that_a_person_writes(look: Look):
    assert look({"mqtt/ca.pem": "#" * 262_144, "box.toml": "#" * 65_536}).is_accepted


def test_a_copy_beside_the_file_is_only_told(look: Look):
    found = look({"captain.toml": CAPTAIN, "captain.toml.bak": "x", "authorized_keys": KEY})
    assert found.is_accepted
    assert remarks(found) == ["captain.toml.bak: is not read: captain.toml is"]


@pytest.mark.parametrize("name", ["config.toml", "me.pub", "broker.crt", "setup.sh"])
def test_a_file_of_which_something_is_expected_is_told_not_to_be_read(look: Look, name: str):
    found = look({name: "x", "authorized_keys": KEY})
    assert found.is_accepted
    assert remarks(found) == [
        f"{name}: is not read; what is: captain.toml, box.toml, authorized_keys, board.toml, user-data, network-config, mqtt/, lib/"
    ]


def test_an_endpoint_that_nobody_can_reach_is_told_though_it_is_no_mistake(look: Look):
    found = look({"captain.toml": '[endpoint]\naddress = "127.0.0.1"\nfrom_users = 6000\n', "authorized_keys": KEY})
    assert found.is_accepted
    assert remarks(found) == [
        "captain.toml:3: endpoint.from_users: the box lets nobody in at port 6000; 5555 to 5558 are open",
        'captain.toml:2: endpoint.address: "127.0.0.1" is reached from this box only; leave it out for all addresses',
    ]


STATIC = '[eth0]\naddress = "192.168.77.7/24"\n'


def test_an_address_that_the_box_was_given_may_be_the_endpoint_s(look: Look):
    found = look({"captain.toml": '[endpoint]\naddress = "192.168.77.7"\n', "box.toml": STATIC, "authorized_keys": KEY})
    assert found.is_accepted
    assert remarks(found) == [
        'captain.toml:2: endpoint.address: no station starts while eth0 does not have "192.168.77.7": without a cable; '
        "leave it out for all addresses"
    ]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('address = "192.168.77.8"', 'endpoint.address: the box is given no "192.168.77.8"; leave it out for all addresses, or give it to eth0 in box.toml'),
        ('address = "nonsense host"', 'endpoint.address: "nonsense host" is no address; leave it out for all addresses'),
        ('address = "eth0"', 'endpoint.address: "eth0" is no address; leave it out for all addresses'),
        ('address = ""', 'endpoint.address: "" is no address; leave it out for all addresses'),
        ("from_users = 22", "endpoint.from_users: port 22 is one of the system's, which the station may not take; 5555 to 5558 are open"),
        ("report = 1023", "endpoint.report: port 1023 is one of the system's, which the station may not take; 5555 to 5558 are open"),
        ('control = "/run/x/y.sock"', 'endpoint.control: the station cannot write /run/x on a box; leave it out, or write "/run/captain/NAME"'),
        ('control = "/run/captain/../x.sock"', 'endpoint.control: the station cannot write /run on a box; leave it out, or write "/run/captain/NAME"'),
        ('control = "here.sock"', 'endpoint.control: the station cannot write /data/owner/current on a box; leave it out, or write "/run/captain/NAME"'),
        (f'control = "/run/captain/{100 * "x"}"', 'endpoint.control: socket path too long: 113 octets: "/run/captain/xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx...; use at most 107'),
        ('control = "/run/captain/a\\u0000b"', 'endpoint.control: has a zero, which no name of a file or a device has; leave it out'),
        ('control = "/run/captain"', 'endpoint.control: the station cannot write /run on a box; leave it out, or write "/run/captain/NAME"'),
    ],
)  # fmt: skip
def test_an_endpoint_that_no_station_of_a_box_can_have_is_refused(look: Look, line: str, said: str):
    assert only(look({"captain.toml": f"[endpoint]\n{line}\n", "box.toml": STATIC})) == f"captain.toml:2: {said}"


@pytest.mark.parametrize("written", ["fd00::5", "FD00:0::5"])
def test_an_address_of_the_box_is_known_however_it_is_written(look: Look, written: str):
    box = f'[eth0]\naddress = "{written}/64"\ngateway = "fe80::1"\n'
    assert look({"captain.toml": '[endpoint]\naddress = "fd00::5"\n', "box.toml": box}).is_accepted


@pytest.mark.parametrize(
    ("text", "place"),
    [
        (
            '[interfaces.g5]\ndriver = "udp"\ngroup = "239.1.1.1:9001"\ndevice = "a\\u0000"\n',
            "captain.toml:4: interfaces.g5.device",
        ),
        ('[recorder]\nfolder = "a\\u0000b"\n', "captain.toml:2: recorder.folder"),
    ],
)
def test_a_zero_in_a_name_is_refused_wherever_it_is(look: Look, text: str, place: str):
    assert (
        only(look({"captain.toml": text}))
        == f"{place}: has a zero, which no name of a file or a device has; leave it out"
    )


@pytest.mark.parametrize("name", ["a\\nb", 65 * "a"])
def test_an_interface_has_a_name_that_can_be_shown(look: Look, name: str):
    said = only(look({"captain.toml": f'[interfaces."{name}"]\ndriver = "udp"\nlisten = "127.0.0.1:0"\n'}))
    assert "cannot be an interface's name: at most 64 letters that print" in said


def test_a_value_with_an_end_of_line_is_told_in_one_line(look: Look):
    said = only(look({"box.toml": 'host_name = "captain\\n"\n'}))
    assert said.startswith(r'box.toml:1: host_name: "captain\n" is no host name')


def test_a_control_socket_where_the_station_may_write_is_taken(look: Look):
    for path in ("/run/captain/mine.sock", "/var/lib/captain/mine.sock"):
        assert look({"captain.toml": f'[endpoint]\ncontrol = "{path}"\n'}).is_accepted


DEEP = ".".join(["a"] * 5000)


@pytest.mark.parametrize("text", [f"{DEEP} = 1\n", f"[{DEEP}]\nx = 1\n", f"x = {{ {DEEP} = 1 }}\n", f"[[{DEEP}]]\n"])
@pytest.mark.parametrize("name", ["box.toml", "captain.toml", "board.toml"])
def test_a_key_of_thousands_of_parts_is_named_before_anybody_follows_it(look: Look, name: str, text: str):
    assert only(look({name: f"# {name}\n{text}"})).startswith(f"{name}:2: is not TOML: a key has more than 64 parts")


@pytest.mark.parametrize("name", ["box.toml", "captain.toml"])
def test_of_thousands_of_mistakes_the_first_are_told_and_how_many_more_there_are(look: Look, name: str):
    told = mistakes(look({name: "".join(f"key{number} = 1\n" for number in range(5_000))}))
    assert told[0].startswith(f"{name}:1: key0: is not a known key")
    assert told[-1] == f"{name}: further mistakes, not told here: 4950; is it the right file?"
    assert len(told) == 51
