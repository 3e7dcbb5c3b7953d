"""Settings from Raspberry Pi Imager: user-data, network-config, and cmdline.txt's country.

Source: rpi-imager 2, src/customization_generator.cpp; cloud-init's cloud-config; netplan, version 2. Commands,
packages and passwords are reported and ignored.
"""

import re
from collections.abc import Callable
from typing import Any

from firmware.card.note import Note, at, mistake, remark
from firmware.card.ssh_keys import sound_keys
from firmware.card.yaml_file import FALSE, Entry, YamlFile

REGION = re.compile(r"\bcfg80211\.ieee80211_regdom=(\S+)")
# Keys that are ignored: they describe the file, or request what the box does by default.
GRANTED = {
    "manage_etc_hosts",
    "manage_resolv_conf",
    "enable_ssh",
    "lock_passwd",
    "optional",
    "version",
    "renderer",
    "shell",
    "dhcp4",
    "dhcp6",
}
COMMANDS = {"runcmd", "bootcmd", "write_files", "packages", "apt", "snap", "rpi"}
JOINED = ("none", "psk", "psk-sha256", "sae")  # netplan's names of supported key managements
PASSWORDS = {"passwd", "plain_text_passwd", "hashed_passwd", "password", "chpasswd", "ssh_pwauth"}
# Errors for tables that lack a required key, in the words of network-config.
LACKING = {
    "wifi.country": ("regulatory-domain: is missing", 'for example regulatory-domain: "DE"'),
    "eth0.address": ("addresses: is missing", "for example addresses: [10.0.0.20/24]"),
}

Table = dict[str, Any]


class Imager:
    """Settings of all of Imager's files, in the form of box.toml.

    table   keys of box.toml.
    places  by dotted key, the file and line that it comes from.
    keys    lines of authorized_keys.
    """

    def __init__(self) -> None:
        self.table: Table = {}
        self.places: dict[str, str] = {}
        self.keys: list[str] = []
        self._texts: list[tuple[int, str]] = []

    def read_user_data(self, name: str, text: str, notes: list[Note]) -> None:
        if text.startswith("#!"):
            notes.append(remark(name, "is a script, which the box does not run", "use #cloud-config"))
            return
        file = YamlFile(name, text, notes)
        acts: dict[str, Callable[[Entry], None]] = {
            "hostname": lambda entry: self._set(file, "host_name", entry),
            "timezone": lambda entry: self._set(file, "time_zone", entry),
            "ssh_authorized_keys": lambda entry: self._take_keys(file, entry),
            "users": lambda entry: self._take_users(file, entry, notes),
        }
        _each(file, file.entries(), acts, notes)
        self.keys = sound_keys(name, self._texts, notes)  # a single run of ssh-keygen for all users
        file.tell_left()

    def read_network_config(self, name: str, text: str, notes: list[Note]) -> None:
        file = YamlFile(name, text, notes)
        entries = file.entries()
        if len(entries) == 1 and entries[0].key == "network":
            entries = file.entries(entries[0])
        version = next((entry for entry in entries if entry.key == "version"), None)
        if version is not None and version.text != "2":
            what = f"version {version.text} is not read"
            notes.append(mistake(at(name, version.line), what, "use netplan's version: 2"))
            return
        _each(
            file,
            entries,
            {
                "wifis": lambda entry: self._take_wifis(file, entry, notes),
                "ethernets": lambda entry: self._take_ethernets(file, entry, notes),
            },
            notes,
        )
        file.tell_left()

    def read_command_line(self, name: str, text: str) -> None:
        """Read the country, which Imager writes there if no network is given; the rest is for another boot loader."""
        found = REGION.search(text)
        if found and "country" not in self.table.get("wifi", {"country": ""}):
            self._put("wifi.country", found[1], name)

    # -- accepted settings

    def _put(self, path: str, value: object, place: str) -> None:
        self.places[path] = place
        table, _, key = path.rpartition(".")
        (self.table.setdefault(table, {}) if table else self.table)[key] = value

    def _set(self, file: YamlFile, path: str, entry: Entry) -> None:
        if (text := file.text(entry)) is not None:
            self._put(path, text, at(file.name, entry.line))

    def _take_keys(self, file: YamlFile, entry: Entry) -> None:
        for item in file.items(entry):
            is_block = item.is_text and item.node.style == "|"  # the text of a block begins on the next line
            self._texts.append((item.line + is_block, file.text(item) or ""))

    def _take_users(self, file: YamlFile, entry: Entry, notes: list[Note]) -> None:
        for user in file.items(entry):
            if user.is_text:
                continue  # `default` means the distribution's own user
            found = len(self._texts)
            acts = dict.fromkeys(
                ("ssh_authorized_keys", "ssh-authorized-keys"), lambda each: self._take_keys(file, each)
            )
            entries = file.entries(user)
            _each(file, [each for each in entries if each.key not in ("name", "groups", "sudo")], acts, notes)
            name = next((each.text for each in entries if each.key == "name"), "")
            if name != "operator":
                whose = "; its ssh keys log in as operator" if len(self._texts) > found else ""
                what = f'user "{name}" is not created{whose}'
                notes.append(remark(at(file.name, user.line), what, "log in as operator"))

    def _take_wifis(self, file: YamlFile, entry: Entry, notes: list[Note]) -> None:
        for device in file.entries(entry):
            if device.key != "wlan0":
                file.leave(device)
                continue
            acts: dict[str, Callable[[Entry], None]] = {
                "regulatory-domain": lambda each: self._set(file, "wifi.country", each),
                "access-points": lambda each: self._take_network(file, each, notes),
            }
            entries = file.entries(device)
            _each(file, entries, acts, notes)
            _look_at_dhcp(file, entries, False, "wlan0 always gets its settings", notes)

    def _take_network(self, file: YamlFile, entry: Entry, notes: list[Note]) -> None:
        auth: dict[str, Callable[[Entry], None]] = {
            "password": lambda each: self._take_password(file, each, notes),
            "key-management": lambda each: _look_at_kind(file, each, notes),
        }
        acts: dict[str, Callable[[Entry], None]] = {
            "password": auth["password"],
            "hidden": lambda each: self._take_hidden(file, each),
            "auth": lambda each: _each(file, file.entries(each), auth, notes),
        }
        networks = file.entries(entry)
        for network in networks[1:]:
            what = f'a second network, "{network.meant}", is ignored'
            notes.append(remark(at(file.name, network.line), what, "the box joins one network"))
        for network in networks[:1]:
            self._put("wifi.ssid", network.meant, at(file.name, network.line))
            if network.meant != network.key:
                what = f'SSID read as "{network.meant}": Imager 2.0.10 escaped its UTF-8 octets'
                remedy = "if that is wrong, write the SSID without \\x"
                notes.append(remark(at(file.name, network.line), what, remedy))
            _each(file, file.entries(network), acts, notes)

    def _take_hidden(self, file: YamlFile, entry: Entry) -> None:
        if (is_hidden := file.flag(entry)) is not None:
            self._put("wifi.hidden", is_hidden, at(file.name, entry.line))

    def _take_password(self, file: YamlFile, entry: Entry, notes: list[Note]) -> None:
        """Take a password. Only an empty one, as Imager writes it, means an open network."""
        if text := file.text(entry):
            self._put("wifi.password", text, at(file.name, entry.line))
        elif entry.is_nothing:
            notes.append(mistake(at(file.name, entry.line), "password: is missing", 'an open network has password: ""'))

    def _take_ethernets(self, file: YamlFile, entry: Entry, notes: list[Note]) -> None:
        for device in file.entries(entry):
            if device.key != "eth0":
                file.leave(device)
                continue
            acts: dict[str, Callable[[Entry], None]] = {
                "addresses": lambda each: self._take_address(file, each),
                "gateway4": lambda each: self._set(file, "eth0.gateway", each),
                "routes": lambda each: self._take_routes(file, each),
                "nameservers": lambda each: self._take_names(file, each),
            }
            entries = file.entries(device)
            _each(file, entries, acts, notes)
            is_own = "address" in self.table.get("eth0", {})
            _look_at_dhcp(file, entries, is_own, "give addresses: [10.0.0.20/24]", notes)

    def _take_address(self, file: YamlFile, entry: Entry) -> None:
        for number, item in enumerate(file.items(entry)):
            if number:
                file.leave(item)
            else:
                self._set(file, "eth0.address", item)

    def _take_routes(self, file: YamlFile, entry: Entry) -> None:
        for route in file.items(entry):
            said = {each.key: each for each in file.entries(route)}
            target = said["to"].text if "to" in said else ""
            is_first = "eth0.gateway" not in self.places
            if target in ("default", "0.0.0.0/0") and "via" in said and is_first:
                self._set(file, "eth0.gateway", said["via"])
            else:
                file.leave(route)

    def _take_names(self, file: YamlFile, entry: Entry) -> None:
        for each in file.entries(entry):
            if each.key == "addresses":
                names = [item.text or "" for item in file.items(each)]
                self._put("eth0.dns", names, at(file.name, each.line))
            else:
                file.leave(each)


def _look_at_dhcp(file: YamlFile, entries: list[Entry], is_own: bool, remedy: str, notes: list[Note]) -> None:
    """Report dhcp4 if it contradicts the box, which uses DHCP exactly where it has no fixed address."""
    entry = next((each for each in entries if each.key == "dhcp4"), None)
    if entry is None or file.flag(entry) is not is_own:
        return
    if is_own:
        what, remedy = "dhcp4: true is ignored: the box has a fixed address", "leave one out"
    else:
        what = "dhcp4: false is ignored: without a fixed address the box uses DHCP"
    notes.append(remark(at(file.name, entry.line), what, remedy))


def _look_at_kind(file: YamlFile, entry: Entry, notes: list[Note]) -> None:
    """Report an unsupported key-management; a supported one needs no setting, as the password determines it."""
    if (text := file.text(entry)) is not None and text not in JOINED:
        what = f'key-management: "{text}" is not supported'
        notes.append(mistake(at(file.name, entry.line), what, f"one of {', '.join(JOINED)}"))


def _each(file: YamlFile, entries: list[Entry], acts: dict[str, Callable[[Entry], None]], notes: list[Note]) -> None:
    """Call the action of each YAML key; report keys that have no action."""
    for entry in entries:
        if entry.key in acts:
            acts[entry.key](entry)
        elif entry.key in PASSWORDS:
            if entry.key != "ssh_pwauth" or entry.text.lower() not in FALSE:
                what = f"{entry.key} is refused: the box has no passwords"
                notes.append(remark(at(file.name, entry.line), what, "give an ssh key"))
        elif entry.key in COMMANDS:
            notes.append(
                remark(at(file.name, entry.line), f"{entry.key} is ignored: the box runs and installs nothing")
            )
        elif entry.key not in GRANTED:
            file.leave(entry)
