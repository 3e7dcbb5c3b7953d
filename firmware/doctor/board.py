"""Checks of the board file's hardware on this machine. They switch nothing."""

import os
from collections.abc import Iterator
from pathlib import Path

from board import topology, usb
from board.machine import REAL, Machine
from firmware.config.board_file import Board
from firmware.config.captain_toml import InterfaceConfig
from firmware.doctor.finding import Finding, Level

I2C = (
    "the device tree has to switch I2C on: of the box's card by image/image.toml, device_tree.i2c; on Raspberry Pi OS "
    "by `sudo captain box setup --write`, or dtparam=i2c_arm=on (i2c_vc=on for i2c-0) in config.txt; and load i2c-dev"
)
TREE = "`lsusb -t` shows the hubs; correct usb of the slots in the board file"


def board(board: Board, machine: Machine = REAL, is_service: bool = False) -> Iterator[Finding]:
    """Yield findings on the board as a whole, then on the kernel devices that it needs: buses, GPIO chips, hubs.

    is_service  the station runs as another user, who may have permissions that this user lacks.
    """
    tables = ("lines", "expanders", "rails", "temperatures", "slots")
    counts = ", ".join(f"{len(getattr(board, name))} {name}" for name in tables if getattr(board, name))
    yield Finding(Level.OK, "board", f"{board.name}: {counts or 'no hardware'}")
    if board.simulated:
        return
    for name, bus in board.buses.items():
        if not Path(bus.path).exists():
            yield Finding(Level.PROBLEM, f"bus {name}", f"{bus.path} does not exist", I2C)
    if any(line.chip or line.line for line in board.lines.values()) and not list(machine.dev.glob("gpiochip*")):
        yield Finding(
            Level.PROBLEM, "lines", f"{machine.dev} has no GPIO chip", "check that this is the right board file"
        )
    yield from _hubs(board, machine)
    if not is_service:
        yield from _ports(board)


def slot_of(one: InterfaceConfig, board: Board, machine: Machine = REAL) -> Iterator[Finding]:
    """Yield findings on the device in the slot of an interface."""
    described = board.slots[one.queue.slot]
    subject = f"slot {one.queue.slot}"
    if board.simulated:
        yield Finding(Level.OK, subject, f"{one.queue.driver}: simulated; `captain selftest` tries it")
        return
    found = usb.find(machine, described.usb) if described.usb else None
    if found is not None:
        yield Finding(Level.OK, subject, f"{found} at {described.usb}")
    elif described.usb:
        remedy = "the station gives the slot power and waits for it; check that the module is in the slot"
        yield Finding(Level.WARNING, subject, f"no USB device at {described.usb} now", remedy)


def _hubs(board: Board, machine: Machine) -> Iterator[Finding]:
    devices = machine.sys / "bus/usb/devices"
    hubs = {topology.parse(slot.usb).hub for slot in board.slots.values() if slot.usb}
    for hub in sorted(hubs):
        if not (devices / hub).exists():
            yield Finding(Level.WARNING, "slots", f"no USB hub is connected at {hub} now", TREE)


def _ports(board: Board) -> Iterator[Finding]:
    switched = [name for name, slot in board.slots.items() if slot.usb and not slot.power]
    if switched and os.geteuid() != 0:
        names = ", ".join(switched)
        remedy = "run the station as root, or let it be restarted by hand"
        yield Finding(Level.WARNING, "slots", f"{names}: only root may switch USB ports", remedy)
