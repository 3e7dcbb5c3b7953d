"""Machine side of a modem: programs, network device, and the device's counters."""

import sys
from collections.abc import Callable
from ipaddress import IPv4Address
from pathlib import Path
from typing import NamedTuple

from board import usb
from board.machine import Machine
from board.runtime.errors import StationError
from board.runtime.loop import Loop
from board.runtime.tool import Tool
from drivers.sim8202g.script import Ended, Program, Run, StepError

ANY = "00000000"  # address and mask of a default route in /proc/net/route; addresses there have the host's byte order


class Counters(NamedTuple):
    """Packets of a network device since its creation."""

    received: int
    sent: int


class Route(NamedTuple):
    """A default route of IPv4 through a network device."""

    gateway: str
    metric: int


class System:
    """The machine that the station runs on; tests use a simulated one."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self._kept: list[Tool] = []

    def run(
        self, loop: Loop, run: Run, done: Callable[[Ended | StationError], None], ended: Callable[[], None]
    ) -> Program:
        """Start a program. Raises InterfaceError if it cannot be started.

        run    command line, time limit, and pattern of the output after which the program is kept.
        done   called once with the result, or with an error.
        ended  called when a kept program has ended by itself.
        """

        def said(status: int | None, output: str) -> None:
            if status is None:
                self._kept.append(tool)
            elif run.keep:
                done(StepError(f"{run.argv[0]} ended with status {status} before the network had assigned an address"))
                return
            done(Ended(status, output))

        def gone() -> None:
            if tool in self._kept:
                self._kept.remove(tool)
                ended()

        tool = Tool(loop, run.argv, run.limit_s, said, keep=run.keep, ended=gone)
        return tool

    @property
    def is_keeping(self) -> bool:
        """Whether a kept program runs."""
        return bool(self._kept)

    def stop_kept(self) -> None:
        """End all kept programs; idempotent."""
        kept, self._kept = self._kept, []
        for tool in kept:
            tool.leave()

    def at_port(self, place: str, number: int) -> str:
        """Return the path of the tty of a USB interface. Raises InterfaceError if it does not exist.

        place   topology path of the USB device.
        number  number of its interface.
        """
        return usb.tty(self._machine, place, number)

    def product(self, place: str) -> str:
        """Return vendor and product ID of the USB device at a place, such as `1e0e:9001`; empty without a device."""
        device = usb.find(self._machine, place)
        return device.id if device else ""

    def network_device(self, place: str) -> str:
        """Return the name of the network device at a USB place. Raises InterfaceError if it does not exist."""
        return usb.network_device(self._machine, place)

    def control_device(self, place: str) -> str:
        """Return the path of the control device at a USB place. Raises InterfaceError if it does not exist."""
        return usb.control_device(self._machine, place)

    def raw_ip(self, device: str) -> Path:
        """Return the path of the file that switches a network device of qmi_wwan to raw IP; the device must be down.

        A program must write it, not the loop: the write waits for the kernel's lock of all network devices.
        """
        return self._machine.sys / "class/net" / device / "qmi/raw_ip"

    def default_routes(self, device: str) -> list[Route]:
        """Return the IPv4 default routes of a network device that have a gateway."""
        try:
            rows = [line.split() for line in (self._machine.proc / "net/route").read_text().splitlines()[1:]]
            return [
                Route(str(IPv4Address(int(row[2], 16).to_bytes(4, sys.byteorder))), int(row[6]))
                for row in rows
                if row[0] == device and (row[1], row[7]) == (ANY, ANY) and row[2] != ANY
            ]
        except (OSError, ValueError, IndexError):
            return []

    def counters(self, device: str) -> Counters | None:
        folder = self._machine.sys / "class/net" / device / "statistics"
        try:
            return Counters(*(int((folder / f"{way}_packets").read_text()) for way in ("rx", "tx")))
        except (OSError, ValueError):
            return None
