"""captain extcap: what Wireshark calls to capture from a station as from a network device."""

import argparse
import os
import shlex
import subprocess
import sys
from pathlib import Path

from board.child import program
from board.errors import RequestError, StationError, UsageError
from firmware import VERSION
from firmware.recorder.session import record
from firmware.recorder.sinks import Pipe
from firmware.user.arguments import add_station, address
from firmware.user.listening import Wish

DESCRIPTION = """\
Lets Wireshark and tshark capture from a station as from a network device, by
their interface for such programs, extcap. `captain extcap --install` once; then
"V2X station" stands in Wireshark's list of devices, and its options ask for the
station's address. Wireshark itself gives the other options.
"""
EPILOG = """\
examples:
  captain extcap --install                  for this user
  tshark -i captain                         the station of this machine
  tshark -i captain -o extcap.captain.station:192.168.1.7:5555
                                            one elsewhere

exit codes:
  0    done, or nobody reads any more
  1    no station answers, or the file cannot be written
  2    wrong usage
"""
NAME = "captain"
DEFAULT = "127.0.0.1:5555"
INTERFACES = f"extcap {{version={VERSION}}}{{display=captain}}\ninterface {{value={NAME}}}{{display=V2X station}}"
LINKS = "dlt {number=1}{name=EN10MB}{display=Ethernet}"
OPTIONS = (
    "arg {number=0}{call=--station}{display=Station}{type=string}"
    f"{{default={DEFAULT}}}{{tooltip=its host and first port; the port of reports is the third after it}}"
)


def arguments(parser: argparse.ArgumentParser) -> None:
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--install", nargs="?", const="", metavar="FOLDER", help="into Wireshark's folder for them")
    what.add_argument("--extcap-interfaces", action="store_true", help="which devices there are")
    what.add_argument("--extcap-dlts", action="store_true", help="what their frames are")
    what.add_argument("--extcap-config", action="store_true", help="what may be asked of them")
    what.add_argument("--capture", action="store_true", help="begin")
    parser.add_argument("--extcap-interface", metavar="NAME", help="which one")
    parser.add_argument("--extcap-version", metavar="N", help="of Wireshark")
    parser.add_argument("--extcap-capture-filter", metavar="FILTER", help="not known here: none is taken")
    parser.add_argument("--fifo", metavar="PATH", type=Path, help="where the frames go")
    add_station(parser)


def main(arguments: argparse.Namespace) -> int:
    if arguments.install is not None:
        return _install(arguments.install)
    if arguments.extcap_interface not in (None, NAME):
        raise UsageError(f"--extcap-interface: there is no {arguments.extcap_interface}", f"it is called {NAME}")
    if arguments.extcap_interfaces:
        print(INTERFACES)
    elif arguments.extcap_dlts:
        print(LINKS)
    elif arguments.extcap_config:
        print(OPTIONS)
    else:
        return _capture(arguments)
    return 0


def _capture(arguments: argparse.Namespace) -> int:
    if arguments.fifo is None:
        raise UsageError("--capture: --fifo is missing", "Wireshark gives both: captain extcap --install")
    if arguments.extcap_capture_filter:
        raise UsageError("a capture filter is not known here", "take a display filter")
    try:
        # Opened before the station is asked: Wireshark waits for it, and shows what is said then.
        with arguments.fifo.open("wb") as pipe:
            return record(address(arguments), Wish(), lambda: Pipe(pipe), "wireshark", _pass_over)
    except BrokenPipeError:
        return 0
    except OSError as error:
        raise RequestError(f"{arguments.fifo}: {error.strerror}") from error


def _pass_over(note: str) -> None:
    """Suppress notes: Wireshark shows each line of standard error as an error."""


def _install(folder: str) -> int:
    place = Path(folder) if folder else _folder()
    path = place / NAME
    try:
        place.mkdir(parents=True, exist_ok=True)
        path.write_text(_script())
        path.chmod(0o755)
    except OSError as error:
        raise RequestError(f"{path}: {error.strerror}", "name another folder: --install FOLDER") from error
    print(f"captain: {path}: Wireshark finds it when it starts, tshark as -i {NAME}")
    return 0


def _script() -> str:
    command = [*program(), "extcap"]
    if not getattr(sys, "frozen", False):
        command = ["env", f"PYTHONPATH={Path(__file__).parents[2]}", *command]
    return f'#!/bin/sh\nexec {shlex.join(command)} "$@"\n'


def _folder() -> Path:
    """Where Wireshark looks for a user's own: it has moved between its versions, so it is asked."""
    for asked in ("tshark", "wireshark"):
        try:
            told = subprocess.run([asked, "-G", "folders"], capture_output=True, text=True, check=True, timeout=20)
        except (OSError, subprocess.SubprocessError):
            continue
        found = dict(line.partition(":")[::2] for line in told.stdout.splitlines())
        if place := found.get("Personal Extcap path") or found.get("Extcap path"):
            return Path(os.path.expanduser(place.strip()))
    raise StationError("neither tshark nor wireshark says where they look", "name the folder: --install FOLDER")
