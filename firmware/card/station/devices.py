"""Compares the station's interfaces with the box: cable, console, firewall, writable folder."""

import ipaddress
import os

from board.runtime.address import address
from board.runtime.toml import show
from drivers.ethernet import EthernetOptions
from drivers.som301e.options import Som301eOptions
from drivers.udp.driver import UdpOptions
from firmware.card.note import Note, mistake, remark
from firmware.card.station.given import OWN, STATE, StationFiles
from firmware.config import captain_toml
from firmware.config.board_file import serial_option

CABLE, WIRELESS = "eth0", "wlan0"
CONSOLE = "/dev/ttyS1"  # console.device in image.toml
FIRST_PORT = "/dev/ttyUSB0 is the first by USB"
OTHER_PORTS = ("/dev/ttyS0", "/dev/ttyAMA0")  # consoles of other systems, and the port of the Pi's Bluetooth


def look_at_devices(found: captain_toml.Config, given: StationFiles, notes: list[Note]) -> None:
    """Report interfaces whose device or port the box itself uses: network, console, or a port that it does not have."""
    near = (CABLE, WIRELESS) if given.wifi else (CABLE,)
    for one in found.interfaces:
        where = f"interfaces.{one.name}"
        if isinstance(one.options, EthernetOptions) and one.options.device in near:
            device = one.options.device
            what = f"{where}.device: {device} is the network of ssh and users: V2X frames would reach all of its hosts"
            notes.append(remark(given.at(OWN, f"{where}.device"), what, "name the radio's device"))
        if isinstance(one.options, Som301eOptions) and _is_hidden(one.options.ip, given.own):
            what = f"{where}.ip: {one.options.ip} is in the network of eth0, {given.own}: the module is unreachable"
            notes.append(mistake(given.at(OWN, f"{where}.ip"), what, "give eth0 another network in box.toml"))
        name = serial_option(found.tables.interfaces[one.name])
        text = getattr(one.options, name, "")
        path, place = os.path.normpath(text), given.at(OWN, f"{where}.{name}")
        if not text:
            continue
        if path == CONSOLE:
            what = f"{where}.{name}: {path} is the serial console, which would stop working"
            notes.append(mistake(place, what, "take another port, such as /dev/ttyUSB0"))
        elif path in OTHER_PORTS:
            what = f"{where}.{name}: {path} is not on this box's header"
            notes.append(remark(place, what, FIRST_PORT))
        elif not path.startswith("/dev/"):
            notes.append(mistake(place, f"{where}.{name}: unknown serial port: {show(text)}", FIRST_PORT))


def _is_hidden(ip: str, own: str) -> bool:
    """Return whether the address of a module lies in the network of eth0."""
    return bool(own) and ipaddress.ip_address(ip) in ipaddress.ip_interface(own).network


def look_at_datagrams(found: captain_toml.Config, given: StationFiles, notes: list[Note]) -> None:
    """Report UDP interfaces that listen on addresses that the box's firewall blocks."""
    for one in found.interfaces:
        for name in ("listen", "group") if isinstance(one.options, UdpOptions) else ():
            text = getattr(one.options, name)
            if text and not ipaddress.ip_address(address(text).host).is_loopback:
                where = f"interfaces.{one.name}.{name}"
                what = f"{where}: the firewall blocks datagrams to {text}"
                notes.append(remark(given.at(OWN, where), what, "only programs of the box reach 127.0.0.1"))


def look_at_folders(found: captain_toml.Config, given: StationFiles, notes: list[Note]) -> None:
    """Report folders that the service does not let the station write."""
    folder = os.path.normpath(found.tables.recorder.folder)
    if folder.startswith(("/", "..")) and not folder.startswith(STATE):
        what = f"recorder.folder: the station cannot write {folder} on a box"
        notes.append(remark(given.at(OWN, "recorder.folder"), what, 'write folder = "ring": it is in /data/captain'))
    for one in found.interfaces:
        folder = os.path.normpath(getattr(one.options, "state_dir", STATE))
        if not f"{folder}/".startswith(STATE):
            where = f"interfaces.{one.name}.state_dir"
            what = f"{where}: the station cannot write {folder} on a box, so it would try no PIN and keep no network"
            notes.append(remark(given.at(OWN, where), what, "leave it out"))
