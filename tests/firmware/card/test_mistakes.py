"""Mistakes and slips of an owner's files: each is named by its place, key and value."""

import sys
from pathlib import Path

import pytest

from firmware.card.verdict import verdict
from tests.firmware.card.conftest import KEY, Files, Look, mistakes, noted, refused, remarks

CAPTAIN = '[station]\nname = "rsu-7"\n'
BOX = 'host_name = "captain-7"\n'
WIFI = '[wifi]\ncountry = "DE"\nssid = "depot"\n'
STATIC = '[eth0]\naddress = "192.168.77.7/24"\n'
DEEP = ".".join(["a"] * 5000)
UDP = '[interfaces.a]\ndriver = "udp"\nlisten = "localhost:1"\npeers = ["x"]\n'
ETHERNET = '[interfaces.b]\ndriver = "ethernet"\nmac = "zz"\ndevice = "a/b"\n'
PRIVATE = "-----BEGIN {0} PRIVATE KEY-----\nc2VjcmV0c2VjcmV0\n-----END {0} PRIVATE KEY-----\n" + KEY


def text_of(name: str, *lines: str) -> Files:
    return {name: "".join(f"{line}\n" for line in lines)}


# What people call a file, by the file that they mean; what other systems read, by what to write here.
MEANT = {
    "authorized_keys": "authorised_keys authorized-keys id_ed25519.pub id_rsa.pub id_ecdsa.pub",
    "captain.toml": "captain.conf captain.txt captain",
    "box.toml": "box.txt box wifi.txt",
    "network-config": "network-config.yaml",
    "user-data": "user-data.yaml",
}
FOREIGN = {
    "user-data and network-config": "firstrun.sh",
    "box.toml": "custom.toml wpa_supplicant.conf",
    "authorized_keys": "ssh ssh.txt userconf userconf.txt",
}
# Files, the places and keys of their mistakes, and what all of these name between them.
MISTAKES: list[tuple[Files, list[str], list[str]]] = [
    # captain.toml
    ({"captain.toml": "[statoin]\nname = 'x'\n"}, ["captain.toml:1 statoin"], ["station"]),
    ({"captain.toml": '\n[interface.x]\ndriver = "udp"\n'}, ["captain.toml:2 interface"], ["interfaces"]),
    ({"captain.toml": "[endpoint]\nfrom_users = 66000\n"}, ["captain.toml:2 endpoint.from_users"], ["66000", "65535"]),
    ({"captain.toml": "[station]\nname = rsu\n"}, ["captain.toml:2"], ['key = "value"']),
    ({"captain.toml": '[interfaces.g5]\nqueue = 0\ndriver = "udp"\nlisten = "127.0.0.1:0"\n'}, ["captain.toml:2 interfaces.g5: queue"], ["0", "65536"]),
    ({"captain.toml": '[[policy]]\n[[policy]]\nrate_per_s = "x"\n'}, ["captain.toml:3 policy[1].rate_per_s"], ['"x"']),
    ({"captain.toml": '[interfaces.a]\ndriver = "upd"\n'}, ["captain.toml:2 interfaces.a.driver"], ["'upd'", "udp"]),
    ({"captain.toml": '[interfaces.g5]\ndriver = "udp"\ngroup = "239.1.1.1:9001"\ndevice = "a\\u0000"\n'}, ["captain.toml:4 interfaces.g5.device"], []),
    ({"captain.toml": '[recorder]\nfolder = "a\\u0000b"\n'}, ["captain.toml:2 recorder.folder"], []),
    ({"captain.toml": UDP + ETHERNET}, ["captain.toml:3 interfaces.a: listen", "captain.toml:4 interfaces.a: peers", "captain.toml:8 interfaces.b: device", "captain.toml:7 interfaces.b: mac"],
     ['"localhost:1"', '"x"', '"a/b"', '"zz"']),
    ({"captain.toml": '[interfaces."a\\nb"]\ndriver = "udp"\nlisten = "127.0.0.1:0"\n'}, ["captain.toml:1 interfaces"], ["64"]),
    ({"captain.toml": f'[interfaces.{65 * "a"}]\ndriver = "udp"\nlisten = "127.0.0.1:0"\n'}, ["captain.toml:1 interfaces"], ["64"]),
    # box.toml
    ({"box.toml": 'host_name = "rsu_7"\n'}, ["box.toml:1 host_name"], ['"rsu_7"', "rsu-7"]),
    ({"box.toml": 'host_name = "rsu-7.local"\n'}, ["box.toml:1 host_name"], ['"rsu-7.local"', "write rsu-7"]),
    ({"box.toml": 'host_name = "captain\\n"\n'}, ["box.toml:1 host_name"], [r'"captain\n"']),
    ({"box.toml": '\n[wifi]\ncountry = "UK"\nssid = "x"\n'}, ["box.toml:3 wifi.country"], ['"UK"', "GB"]),
    ({"box.toml": '[wifi]\ncountry = "uk"\nssid = "x"\n'}, ["box.toml:2 wifi.country"], ['"uk"', "GB"]),
    ({"box.toml": '[wifi]\ncountry = "xx"\nssid = "x"\n'}, ["box.toml:2 wifi.country"], ['"xx"', '"DE"']),
    ({"box.toml": '[wifi]\ncountry = "de"\nssid = "x"\n'}, ["box.toml:2 wifi.country"], ['"de"', "DE"]),
    ({"box.toml": '[wifi]\nssid = "x"\n'}, ["box.toml:1 wifi.country"], []),
    ({"box.toml": '[wifi]\ncountry = "DE"\nssid = ""\n'}, ["box.toml:3 wifi.ssid"], ["0", "32"]),
    ({"box.toml": f'[wifi]\ncountry = "DE"\nssid = "{33 * "x"}"\n'}, ["box.toml:3 wifi.ssid"], ["33", "32"]),
    ({"box.toml": WIFI + "password = 12345678\n"}, ["box.toml:4 wifi.password"], ['password = "..."']),
    ({"box.toml": WIFI + 'password = "secret"\n'}, ["box.toml:4 wifi.password"], ["6", "8 to 63"]),
    ({"box.toml": WIFI + f'password = "{64 * "x"}"\n'}, ["box.toml:4 wifi.password"], ["64", "8 to 63"]),
    ({"box.toml": WIFI + 'password = "geheim-é-geheim"\n'}, ["box.toml:4 wifi.password"], ["8", "ASCII"]),
    ({"box.toml": WIFI + f'password = "12345678"\npsk = "{64 * "a"}"\n'}, ["box.toml:5 wifi: psk"], ["password"]),
    ({"box.toml": WIFI + 'psk = "xyz"\n'}, ["box.toml:4 wifi.psk"], ["64", "password"]),
    ({"box.toml": WIFI + "psk = 3\n"}, ["box.toml:4 wifi.psk"], ["64"]),
    ({"box.toml": "[console]\nshell = 0\n"}, ["box.toml:2 console.shell"], ["0", "true", "false"]),
    ({"box.toml": 'time_zone = "Berlin"\n'}, ["box.toml:1 time_zone"], ['"Berlin"', '"Europe/Berlin"']),
    ({"box.toml": '[eth0]\naddress = "192.168.1.20"\n'}, ["box.toml:2 eth0.address"], ['"192.168.1.20"', '"192.168.1.20/24"']),
    ({"box.toml": '[eth0]\naddress = "192.168.1.0/24"\n'}, ["box.toml:2 eth0.address"], ['"192.168.1.0/24"']),
    ({"box.toml": '[eth0]\naddress = "10.0.0.2/24"\ngateway = "10.0.1.1"\n'}, ["box.toml:3 eth0: gateway"], ['"10.0.1.1"', "10.0.0.0/24"]),
    ({"box.toml": '[eth0]\naddress = "2001:db8::7"\n'}, ["box.toml:2 eth0.address"], ['"2001:db8::7"', '"2001:db8::7/64"']),
    ({"box.toml": '[eth0]\naddress = "mine"\n'}, ["box.toml:2 eth0.address"], ['"mine"', '"10.0.0.20/24"']),
    ({"box.toml": 'time_servers = ["a b", "ntp", "c d"]\n[eth0]\naddress = "10.0.0.5/24"\ngateway = "10.0.0.5"\ndns = ["a", "b"]\n'},
     ["box.toml:5 eth0.dns[0]", "box.toml:5 eth0.dns[1]", "box.toml:4 eth0: gateway", "box.toml:1 time_servers[0]", "box.toml:1 time_servers[2]"],
     ['"a"', '"b"', '"10.0.0.5"', '"a b"', '"c d"']),
    ({"box.toml": f"\nname = {5000 * '9'}\n"}, ["box.toml:2"], []),
    ({"captain.toml": f"\nname = {5000 * '9'}\n"}, ["captain.toml:2"], []),
    ({"box.toml": "hostname = 'x'\n"}, ["box.toml:1 hostname"], ["host_name"]),
    ({"box.toml": 'host_name = "a\n'}, ["box.toml:1"], []),
    *(
        (text_of(name, f"# {name}", line), [f"{name}:2"], ["64"])
        for name in ("box.toml", "captain.toml", "board.toml")
        for line in (f"{DEEP} = 1", f"[{DEEP}]\nx = 1", f"x = {{ {DEEP} = 1 }}", f"[[{DEEP}]]")
    ),
    # board.toml
    ({"board.toml": 'name = "mine"\n[identity]\nbus = "main"\naddress = 80\n'}, ["board.toml:3 identity.bus"], ["'main'", "[buses.main]"]),
    # authorized_keys
    *(({"authorized_keys": PRIVATE.format(name)}, ["authorized_keys:1"], []) for name in ("OPENSSH", "RSA", "EC", "ENCRYPTED")),
    # what is on the card
    ({"captain.tml": CAPTAIN}, ["captain.tml"], ["captain.toml"]),
    *(({name: "x"}, [name], [f"rename it to {meant}"]) for meant, names in MEANT.items() for name in names.split()),
    *(({name: "x"}, [name], [".pub"]) for name in ("id_ed25519", "id_rsa", "id_ecdsa", "id_ed25519_sk", "id_ecdsa_sk")),
    ({"captain.toml": CAPTAIN, "captain.toml.txt": "[station]\n"}, ["captain.toml"], ["captain.toml.txt"]),
    ({"Captain.toml.txt": "[station]\nnmae = 1\n"}, ["Captain.toml.txt:2 station.nmae"], ["name"]),
    ({"captain.toml/x": ""}, ["captain.toml"], []),
    ({"mqtt": "x"}, ["mqtt"], []),
    ({"lib": "x"}, ["lib"], []),
    ({"mqtt/new/ca.pem": ""}, ["mqtt/new"], ["mqtt/"]),
    ({"box.toml": BOX + "#" * 65_536}, ["box.toml"], ["65536"]),
    ({"mqtt/ca.pem": "#" * 262_145}, ["mqtt/ca.pem"], ["262144"]),
    ({f"mqtt/{number}.pem": "" for number in range(65)}, ["mqtt"], ["65", "64"]),
    ({"lib/x.so": bytes((16 << 20) + 1)}, ["lib/x.so"], ["16777216"]),
    ({f"lib/{number}.so": "" for number in range(9)}, ["lib"], ["9", "8"]),
    # what editors do
    ({"box.toml": "# Büro\n".encode("latin-1") + BOX.encode()}, ["box.toml:1"], ["0xfc", "UTF-8"]),
    ({"box.toml": BOX.encode("utf-16")}, ["box.toml:1"], ["0xff", "UTF-8"]),
    ({"authorized_keys": KEY.encode("utf-16")}, ["authorized_keys:1"], ["0xff", "UTF-8"]),
    ({"captain.toml": b"{\\rtf1\\ansi\n}"}, ["captain.toml:1"], []),
    ({"box.toml": bytes(4096)}, ["box.toml:1"], []),
    ({"box.toml": BOX.encode() + b"x\0"}, ["box.toml:2"], []),
]  # fmt: skip


@pytest.mark.parametrize(("files", "places", "values"), MISTAKES)
def test_card_with_mistakes_names_each_place_key_and_value(
    look: Look, files: Files, places: list[str], values: list[str]
):
    found = look(files)
    assert (refused(found), found.is_accepted) == (places, False)
    assert [value for value in values if value not in "\n".join(mistakes(found))] == []


@pytest.mark.parametrize(
    ("line", "values"),
    [
        ('address = "192.168.77.8"', ['"192.168.77.8"', "eth0", "box.toml"]),
        ('address = "nonsense host"', ['"nonsense host"']),
        ('address = "eth0"', ['"eth0"']),
        ('address = ""', ['""']),
        ("from_users = 22", ["22", "5555 to 5558"]),
        ("report = 1023", ["1023", "5555 to 5558"]),
        ('control = "/run/x/y.sock"', ["/run/x", '"/run/captain/NAME"']),
        ('control = "/run/captain/../x.sock"', ["/run ", '"/run/captain/NAME"']),
        ('control = "here.sock"', ["/data/owner/current", '"/run/captain/NAME"']),
        ('control = "/run/captain"', ["/run ", '"/run/captain/NAME"']),
        (f'control = "/run/captain/{100 * "x"}"', ["113", "107"]),
        ('control = "/run/captain/a\\u0000b"', []),
    ],
)
def test_endpoint_that_no_station_of_a_box_can_have_is_refused(look: Look, line: str, values: list[str]):
    found = look({"captain.toml": f"[endpoint]\n{line}\n", "box.toml": STATIC})
    assert refused(found) == [f"captain.toml:2 endpoint.{line.partition(' ')[0]}"]
    assert [value for value in values if value not in mistakes(found)[0]] == []


# The firmware's and the boot loader's, and what computers leave on every card.
OTHERS = "x.elf x.dat x.bin x.dtb x.dtbo x.scr x.img x.uf2 Config.txt readme.txt issue.txt meta-data autorun.inf .x.toml ~x.toml"
EXPECTED = "config.toml me.pub x.pem x.crt x.key x.conf x.yaml x.yml x.sh"
NAMES = ["captain.toml", "box.toml", "authorized_keys", "board.toml", "user-data", "network-config", "mqtt/", "lib/"]
# Sets that are taken, the places and keys of what is told of them, and what is named there.
TOLD: list[tuple[Files, list[str], list[str]]] = [
    ({"captain.toml": CAPTAIN, "box.toml": BOX + WIFI + 'password = "12345678"\n', "authorized_keys": KEY}, [], []),
    ({"box.toml": WIFI + f'psk = "{64 * "A"}"\n', "authorized_keys": KEY}, [], []),
    ({"box.toml": WIFI + f'password = "{63 * "x"}"\n', "authorized_keys": KEY}, [], []),
    ({"box.toml": f'[wifi]\ncountry = "DE"\nssid = "{32 * "x"}"\n', "authorized_keys": KEY}, [], []),
    ({}, ["authorized_keys"], [".pub"]),
    ({"CAPTAIN.TOML": CAPTAIN, "authorized_keys.txt": KEY}, ["authorized_keys.txt"], ["authorized_keys"]),
    ({"authorized_keys": KEY, "._authorized_keys": b"\0\5\x16\7", ".DS_Store": b"", "System Volume Information/x": b"",
      "start4.elf": b"\x7fELF", "config.txt": "arm_64bit=1\n", "README.txt": "", "photo.jpg": b"\xff\xd8"}, [], []),
    *(({name: "x", "authorized_keys": KEY}, [name], [hint]) for hint, names in FOREIGN.items() for name in names.split()),
    ({"authorized_keys": KEY, "firstrun.sh": "reboot", "wpa_supplicant.conf": "network={}", "ssh": ""},
     ["firstrun.sh", "ssh", "wpa_supplicant.conf"], ["user-data", "box.toml", "[wifi]", "authorized_keys"]),
    ({"mqtt/ca.pem": "#" * 262_144, "box.toml": "#" * 65_536, "authorized_keys": KEY}, ["mqtt/ca.pem"], ["captain.toml"]),
    ({"captain.toml": CAPTAIN, "captain.toml.bak": "x", "authorized_keys": KEY}, ["captain.toml.bak"], ["captain.toml"]),
    *(({name: "x", "authorized_keys": KEY}, [name], NAMES) for name in EXPECTED.split()),
    *(({name: "x", "authorized_keys": KEY}, [], []) for name in OTHERS.split()),
    ({"captain.toml": '[endpoint]\naddress = "127.0.0.1"\nfrom_users = 6000\n', "authorized_keys": KEY},
     ["captain.toml:3 endpoint.from_users", "captain.toml:2 endpoint.address"], ["6000", "5555 to 5558", '"127.0.0.1"']),
    ({"captain.toml": '[endpoint]\nfrom_users = 0\nreport = 1024\n', "authorized_keys": KEY},
     ["captain.toml:2 endpoint.from_users", "captain.toml:3 endpoint.report"], ["1024"]),
    ({"captain.toml": '[endpoint]\naddress = "192.168.77.7"\n', "box.toml": STATIC, "authorized_keys": KEY},
     ["captain.toml:2 endpoint.address"], ["eth0", '"192.168.77.7"']),
    *(
        ({"captain.toml": '[endpoint]\naddress = "fd00::5"\n', "box.toml": f'[eth0]\naddress = "{written}/64"\ngateway = "fe80::1"\n', "authorized_keys": KEY},
         ["captain.toml:2 endpoint.address"], ["eth0"])
        for written in ("fd00::5", "FD00:0::5")
    ),
    *(
        ({"captain.toml": f'[endpoint]\n{key} = "{path}"\n', "authorized_keys": KEY}, [f"captain.toml:2 endpoint.{key}"] if is_told else [], [path] if is_told else [])
        for key, path, is_told in (
            ("control", "/run/captain/mine.sock", False), ("control", "/var/lib/captain/mine.sock", False), ("control", "", False),
            ("address", "0.0.0.0", False), ("address", "::", False), ("address", "*", False),
            ("ipc_in", "ipc:///tmp/v2x/in/0", True), ("ipc_out", "ipc:///tmp/v2x/in/0", True),
        )
    ),
    *(
        ({"captain.toml": f'[recorder]\nfolder = "{folder}"\n', "authorized_keys": KEY}, ["captain.toml:2 recorder.folder"] if is_told else [], [])
        for folder, is_told in (
            ("/data/captain/ring", True), ("/media/usb", True), ("../ring", True), ("/var/lib/captain/../x", True),
            ("ring", False), ("rings/one", False), ("/var/lib/captain/ring", False), ("", False),
        )
    ),
]  # fmt: skip


@pytest.mark.parametrize(("files", "places", "values"), TOLD)
def test_card_without_mistakes_is_taken_and_told_what_may_surprise(
    look: Look, files: Files, places: list[str], values: list[str]
):
    found = look(files)
    assert (mistakes(found), noted(found)) == ([], places)
    assert [value for value in values if value not in "\n".join(remarks(found))] == []


def test_note_of_a_card_is_a_line_of_place_mistake_and_remedy(look: Look):
    (line,) = mistakes(look({"box.toml": '\n[wifi]\ncountry = "UK"\nssid = "x"\n'}))
    assert line == 'box.toml:3: wifi.country: unknown country: "UK"; the United Kingdom is GB'


def test_sound_card_is_read_into_options_and_keys(look: Look):
    found = look({"CAPTAIN.TOML": CAPTAIN, "box.toml": BOX + WIFI, "authorized_keys.txt": KEY})
    assert (found.options.host_name, found.keys) == ("captain-7", [KEY])
    assert found.options.wifi is not None
    assert found.options.wifi.ssid == "depot"
    assert found.names == ["authorized_keys", "box.toml", "captain.toml"]
    assert found.files == {"captain.toml": CAPTAIN.encode()}


def test_files_with_mistakes_are_all_told_at_once(look: Look):
    found = look({
        "captain.toml": "[station]\nnmae = 'x'\n[endpoint]\npull = -1\n",
        "box.toml": '[wifi]\ncountry = "UK"\n',
        "authorized_keys": "ssh-rsa\n",
        "board.toml": "nam = 3\n",
        "user-data": "hostname:\n\t- x\n",
    })  # fmt: skip
    assert {text.split()[0] for text in refused(found)} == {
        "captain.toml:2", "captain.toml:4", "box.toml:1", "box.toml:2", "authorized_keys:1", "board.toml", "board.toml:1",
        "user-data:2",
    }  # fmt: skip


@pytest.mark.parametrize("name", ["box.toml", "captain.toml", "user-data"])
def test_file_that_is_nested_too_deep_is_named(look: Look, name: str):
    limit = sys.getrecursionlimit()
    sys.setrecursionlimit(1000)  # as a program begins with; libraries of tests raise it
    try:
        found = look({name: f"name {':' if name == 'user-data' else '='} {1_000 * '['}"})
    finally:
        sys.setrecursionlimit(limit)
    assert refused(found) == [name]


def test_file_that_cannot_be_read_is_named(look: Look, tmp_path: Path):
    card = tmp_path / "broken"
    card.mkdir()
    (card / "box.toml").symlink_to("none")
    found = verdict(card, tmp_path, "none", None, 0.0)
    assert refused(found) == ["box.toml"]
    assert "No such file" in mistakes(found)[0]


WLAN = 'network:\n  wifis:\n    wlan0:\n      access-points:\n        "depot":\n          password: "kurz12"\n'
PLACED = "version: 2\nwifis:\n  wlan0:\n    regulatory-domain: DE\n    access-points:\n      depot: "


@pytest.mark.parametrize(
    ("files", "secret"),
    [
        ({"box.toml": WIFI + 'password = "geheim7"\n'}, "geheim7"),
        ({"box.toml": WIFI + 'password = "12345678é"\n'}, "12345678é"),
        ({"box.toml": WIFI + "password = 87654321\n"}, "87654321"),
        ({"network-config": WLAN}, "kurz12"),
        ({"network-config": PLACED + "{auth: geheim77}"}, "geheim77"),
        ({"network-config": PLACED + "geheim77"}, "geheim77"),
        ({"network-config": PLACED + "{password: [geheim77]}"}, "geheim77"),
        ({"authorized_keys": PRIVATE.format("OPENSSH")}, "c2VjcmV0"),
    ],
)
def test_secret_in_a_file_with_a_mistake_is_never_told(look: Look, files: Files, secret: str):
    found = look(files)
    assert mistakes(found)
    assert not any(secret in note.text for note in found.notes)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-8"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_text_of_any_editor_is_read_with_its_own_ends_of_lines(look: Look, encoding: str, end: str):
    text = '# Büro\n[station]\nname = "rsu-7"\n'.replace("\n", end)
    found = look({"captain.toml": text.encode(encoding), "authorized_keys": (KEY + end).encode(encoding)})
    assert mistakes(found) == []
    assert found.files["captain.toml"].decode() == '# Büro\n[station]\nname = "rsu-7"\n'
    assert found.keys == [KEY]


@pytest.mark.parametrize("name", ["box.toml", "captain.toml"])
def test_file_with_thousands_of_mistakes_gives_fifty_and_their_count(look: Look, name: str):
    found = look({name: "".join(f"key{number} = 1\n" for number in range(5_000))})
    assert refused(found)[:50] == [f"{name}:{number + 1} key{number}" for number in range(50)]
    assert refused(found)[50:] == [name]
    assert "4950" in mistakes(found)[-1]
