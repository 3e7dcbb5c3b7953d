"""captain extcap: live capture from a station in Wireshark."""

import argparse
import os
import shlex
import subprocess
import sys
from pathlib import Path

from board.runtime.child import program
from board.runtime.errors import RequestError, StationError, UsageError
from firmware import VERSION
from firmware.client.arguments import add_station, address
from firmware.client.listening import ListenFilter
from firmware.recorder.session import record
from firmware.recorder.sinks import Pipe

DESCRIPTION = """\
Lets Wireshark and tshark capture from a station as from a network device, by
their interface for external programs, extcap. Run `captain extcap --install`
once. Then Wireshark lists the device "V2X station", and its options ask for the
station's address. Wireshark itself gives the other options.
"""
EPILOG = """\
examples:
  captain extcap --install                  for this user
  tshark -i captain                         the station of this machine
  tshark -i captain -o extcap.captain.station:192.168.1.7:5555
                                            a station elsewhere

exit codes:
  0    done, or Wireshark has closed the capture
  1    no station answers, or the file cannot be written
  2    wrong usage
"""
NAME = "captain"
DEFAULT = "127.0.0.1:5555"
INTERFACES = f"extcap {{version={VERSION}}}{{display=captain}}\ninterface {{value={NAME}}}{{display=V2X station}}"
LINKS = "dlt {number=1}{name=EN10MB}{display=Ethernet}"
OPTIONS = (
    "arg {number=0}{call=--station}{display=Station}{type=string}"
    f"{{default={DEFAULT}}}{{tooltip=host and first port of the station; reports come from the third port after it}}"
)


def arguments(parser: argparse.ArgumentParser) -> None:
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument(
        "--install",
        nargs="?",
        const="",
        metavar="FOLDER",
        help="install into FOLDER (default: the folder that Wireshark names)",
    )
    what.add_argument("--extcap-interfaces", action="store_true", help="list devices")
    what.add_argument("--extcap-dlts", action="store_true", help="print the link type")
    what.add_argument("--extcap-config", action="store_true", help="list options of the device")
    what.add_argument("--capture", action="store_true", help="start to capture")
    parser.add_argument("--extcap-interface", metavar="NAME", help="device")
    parser.add_argument("--extcap-version", metavar="N", help="version of Wireshark")
    parser.add_argument("--extcap-capture-filter", metavar="FILTER", help="refused: use a display filter")
    parser.add_argument("--fifo", metavar="PATH", type=Path, help="pipe that receives the frames")
    add_station(parser)


def main(arguments: argparse.Namespace) -> int:
    """Answer Wireshark, or install the script that it starts.

    Raises UsageError for another interface, a capture without --fifo, and a capture filter. Raises RequestError if the
    script or the pipe cannot be written.
    """
    if arguments.install is not None:
        return _install(arguments.install)
    if arguments.extcap_interface not in (None, NAME):
        raise UsageError(f"--extcap-interface: {arguments.extcap_interface}: unknown device", f"use {NAME}")
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
        raise UsageError("--capture: --fifo is missing", "run captain extcap --install; Wireshark gives both")
    if arguments.extcap_capture_filter:
        raise UsageError(
            f"--extcap-capture-filter: {arguments.extcap_capture_filter}: unsupported", "use a display filter instead"
        )
    try:
        # The pipe is opened before the station is asked: Wireshark waits for it, and only then shows errors.
        with arguments.fifo.open("wb") as pipe:
            return record(address(arguments), ListenFilter(), lambda: Pipe(pipe), "wireshark", _pass_over)
    except BrokenPipeError:
        return 0
    except OSError as error:
        raise RequestError(f"{arguments.fifo}: {error.strerror}") from error


def _pass_over(note: str) -> None:
    """Discard a note: Wireshark shows each line of standard error as an error."""


def _install(folder: str) -> int:
    place = Path(folder) if folder else _folder()
    path = place / NAME
    try:
        place.mkdir(parents=True, exist_ok=True)
        path.write_text(_script())
        path.chmod(0o755)
    except OSError as error:
        raise RequestError(f"{path}: {error.strerror}", "name another folder: --install FOLDER") from error
    print(f"captain: {path}: installed; restart Wireshark, or run tshark -i {NAME}")
    return 0


def _script() -> str:
    command = [*program(), "extcap"]
    if not getattr(sys, "frozen", False):
        command = ["env", f"PYTHONPATH={Path(__file__).parents[2]}", *command]
    return f'#!/bin/sh\nexec {shlex.join(command)} "$@"\n'


def _folder() -> Path:
    """Return Wireshark's folder for a user's extcap programs; Wireshark is asked, since it differs between versions.

    Raises StationError if neither tshark nor wireshark names it.
    """
    for asked in ("tshark", "wireshark"):
        try:
            told = subprocess.run([asked, "-G", "folders"], capture_output=True, text=True, check=True, timeout=20)
        except (OSError, subprocess.SubprocessError):
            continue
        found = dict(line.partition(":")[::2] for line in told.stdout.splitlines())
        if place := found.get("Personal Extcap path") or found.get("Extcap path"):
            return Path(os.path.expanduser(place.strip()))
    raise StationError("folder of extcap programs: unknown to tshark and wireshark", "name it: --install FOLDER")
