"""Interfaces of the station beside what a box has itself: its cable, console, firewall and the place to write in."""

import ipaddress
import os

from board.address import address
from board.toml import show
from drivers.ethernet import EthernetOptions
from drivers.som301e import Som301eOptions
from drivers.udp import UdpOptions
from firmware import config
from firmware.box.note import Note, mistake, remark
from firmware.box.station_given import OWN, STATE, StationFiles
from firmware.consistency import serial_option

CABLE, WIRELESS = "eth0", "wlan0"
CONSOLE = "/dev/ttyS1"  # console.device of the image
FIRST_PORT = "/dev/ttyUSB0 is the first by USB"
OTHER_PORTS = ("/dev/ttyS0", "/dev/ttyAMA0")  # of other systems' consoles, and of the Pi's Bluetooth


def look_at_devices(found: config.Config, given: StationFiles, notes: list[Note]) -> None:
    """Interfaces at what the box itself is reached by."""
    near = (CABLE, WIRELESS) if given.wifi else (CABLE,)
    for one in found.interfaces:
        where = f"interfaces.{one.name}"
        if isinstance(one.options, EthernetOptions) and one.options.device in near:
            device = one.options.device
            what = f"{where}.device: {device} is the network of ssh and of users: frames of V2X go to whoever is there"
            notes.append(remark(given.at(OWN, f"{where}.device"), what, "a radio's is another one"))
        if isinstance(one.options, Som301eOptions) and _is_hidden(one.options.ip, given.own):
            what = f"{where}.ip: {one.options.ip} is in the network of eth0, {given.own}: no way leads to the module"
            notes.append(mistake(given.at(OWN, f"{where}.ip"), what, "give eth0 another network in box.toml"))
        name = serial_option(found.tables.interfaces[one.name])
        text = getattr(one.options, name, "")
        path, place = os.path.normpath(text), given.at(OWN, f"{where}.{name}")
        if not text:
            continue
        if path == CONSOLE:
            what = f"{where}.{name}: {path} is the serial console, and would be none any more"
            notes.append(mistake(place, what, "take another port, such as /dev/ttyUSB0"))
        elif path in OTHER_PORTS:
            what = f"{where}.{name}: {path} is at no pin of the header of this box"
            notes.append(remark(place, what, FIRST_PORT))
        elif not path.startswith("/dev/"):
            notes.append(mistake(place, f"{where}.{name}: {show(text)} is no serial port of a box", FIRST_PORT))


def _is_hidden(ip: str, own: str) -> bool:
    """Whether the address of a module is one of the network that eth0 is given."""
    return bool(own) and ipaddress.ip_address(ip) in ipaddress.ip_interface(own).network


def look_at_datagrams(found: config.Config, given: StationFiles, notes: list[Note]) -> None:
    """The box's firewall lets in nothing of what an interface by UDP is there to hear."""
    for one in found.interfaces:
        for name in ("listen", "group") if isinstance(one.options, UdpOptions) else ():
            text = getattr(one.options, name)
            if text and not ipaddress.ip_address(address(text).host).is_loopback:
                where = f"interfaces.{one.name}.{name}"
                what = f"{where}: the box lets no datagrams in at {text}: nobody is heard there"
                notes.append(remark(given.at(OWN, where), what, "programs of the box itself reach 127.0.0.1"))


def look_at_folders(found: config.Config, given: StationFiles, notes: list[Note]) -> None:
    """The service lets the station write in one place, whatever that is called elsewhere."""
    folder = os.path.normpath(found.tables.recorder.folder)
    if folder.startswith(("/", "..")) and not folder.startswith(STATE):
        what = f"recorder.folder: the station cannot write {folder} on a box"
        notes.append(remark(given.at(OWN, "recorder.folder"), what, 'write folder = "ring": it is in /data/captain'))
    for one in found.interfaces:
        folder = os.path.normpath(getattr(one.options, "state_dir", STATE))
        if not f"{folder}/".startswith(STATE):
            where = f"interfaces.{one.name}.state_dir"
            what = f"{where}: the station cannot write {folder} on a box: no PIN is tried, and no network kept"
            notes.append(remark(given.at(OWN, where), what, "leave it out"))
