"""What a modem needs of the machine: programs, its network device, and what that has counted."""

import sys
from collections.abc import Callable
from ipaddress import IPv4Address
from pathlib import Path
from typing import NamedTuple

from board import usb
from board.errors import StationError
from board.loop import Loop
from board.machine import Machine
from board.tool import Tool
from drivers.modem_script import Ended, Program, Run, StepError

ANY = "00000000"  # address and mask of a default route in /proc/net/route, whose numbers are in the machine's order


class Counters(NamedTuple):
    """Packets of a network device since it exists."""

    received: int
    sent: int


class Route(NamedTuple):
    """A default route of version 4 through a network device."""

    gateway: str
    metric: int


class System:
    """The machine that the station runs on; tests have another."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self._kept: list[Tool] = []

    def run(
        self, loop: Loop, run: Run, done: Callable[[Ended | StationError], None], ended: Callable[[], None]
    ) -> Program:
        """Start a program. Raises InterfaceError where that cannot be.

        ended  is told when one that was kept has ended by itself.
        """

        def said(status: int | None, output: str) -> None:
            if status is None:
                self._kept.append(tool)
            elif run.keep:
                done(StepError(f"{run.argv[0]} ended with status {status} before it had an address"))
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
        """Whether a program runs that was kept."""
        return bool(self._kept)

    def stop_kept(self) -> None:
        """End every program that was kept; idempotent."""
        kept, self._kept = self._kept, []
        for tool in kept:
            tool.leave()

    def at_port(self, place: str, number: int) -> str:
        """Path of the tty at a USB place. Raises InterfaceError while there is none."""
        return usb.tty(self._machine, place, number)

    def product(self, place: str) -> str:
        """Vendor and product of the device at a place, `1e0e:9001`; empty while there is none."""
        device = usb.find(self._machine, place)
        return device.id if device else ""

    def network_device(self, place: str) -> str:
        """Raises InterfaceError while there is none."""
        return usb.network_device(self._machine, place)

    def control_device(self, place: str) -> str:
        """Raises InterfaceError while there is none."""
        return usb.control_device(self._machine, place)

    def raw_ip(self, device: str) -> Path:
        """Where qmi_wwan is told that a device, which must be down, speaks raw IP. It waits for the lock of all
        network devices: it is written to by a program."""
        return self._machine.sys / "class/net" / device / "qmi/raw_ip"

    def default_routes(self, device: str) -> list[Route]:
        """Of a device, those with a gateway."""
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
