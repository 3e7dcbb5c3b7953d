"""Carrier board: lines, worker, measurements, hot-plug and slots of the station."""

import logging
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from board import topology, usb
from board.board_worker import BoardWorker
from board.description import Hardware, SlotDescription
from board.health import Health
from board.line import Lines
from board.machine import Machine
from board.runtime.errors import InterfaceError, StationError
from board.runtime.loop import Loop
from board.slot import SlotSequencer
from board.uevent import Uevent, Uevents
from firmware.slots.supervisor import SlotSupervisor
from firmware.station.interface_supervisor import InterfaceSupervisor

Done = Callable[[StationError | None], None]

log = logging.getLogger("captain.board")


class Carrier:
    """Hardware that a board file declares: opens it, supervises it and reports its state.

    machine     roots of the kernel's files, real or simulated.
    interfaces  supervisors of the interfaces, by the slot of their module.
    note        receives the name of a slot and the text of each decision, for the time line.
    worker      name of the child process for blocking calls; a simulated board has another one.

    stop() and close() leave the power of modules on, so that modules keep running while the station restarts.
    """

    def __init__(
        self,
        loop: Loop,
        hardware: Hardware,
        machine: Machine,
        interfaces: Mapping[str, InterfaceSupervisor],
        note: Callable[[str, str], None],
        worker: str = "board",
    ) -> None:
        self.hardware = hardware
        self.machine = machine
        self.identity: Mapping[str, object] | None = None
        self.unidentified = ""  # reason why the identity cannot be read; empty otherwise
        self._may_identify_again = True  # once: a call that blocks the bus ends the board process each time
        self.deaf = ""  # reason why hot-plug events cannot be received; empty otherwise
        self.lines = Lines(hardware.lines, machine.dev)
        self.worker = BoardWorker(loop, hardware, machine, worker, self._board_process)
        self.health = Health(loop, self.worker, hardware)
        self._loop = loop
        self._uevents: Uevents | None = None
        self._sequencers: dict[str, SlotSequencer] = {}
        self.slots: dict[str, SlotSupervisor] = {}
        for name, described in hardware.slots.items():
            sequencer = SlotSequencer(
                loop, name, described, partial(self._switch, described), partial(self.look, name), self._changed
            )
            self._sequencers[name] = sequencer
            self.slots[name] = SlotSupervisor(loop, sequencer, interfaces.get(name), note)

    def start(self) -> None:
        """Start hot-plug first, so that no event is missed; then lines, worker, measurements and slots."""
        if self.slots:
            self._listen()
        self.lines.open()
        for fault in self.lines.faults.values():
            log.warning("%s", fault)
        self.worker.start()
        for name, line in self.hardware.lines.items():
            if line.expander and line.initial != "keep":
                self.set_line(name, line.initial == "active", self._said)
        if self.hardware.identity is not None:
            self._identify()
        self.health.start()
        for slot in self.slots.values():
            slot.start()

    def stop(self) -> None:
        """Stop the drivers of modules in slots, and the measurements; a second call has no effect."""
        for slot in self.slots.values():
            slot.stop()
        self.health.stop()

    def close(self) -> None:
        """Release all hardware without a change of its state; a second call has no effect."""
        self.stop()
        if self._uevents is not None:
            self._uevents.close()
        self.worker.finish()
        self.lines.close()

    def look(self, name: str) -> usb.UsbDevice | None:
        """Return the USB device in a slot; None if the slot is empty or has no USB place in the board file."""
        place = self.hardware.slots[name].usb
        return usb.find(self.machine, place) if place else None

    def listed(self) -> dict[str, dict[str, object]]:
        """Return the status of each slot, by name.

        number  number of the slot, counted from 1.
        """
        return {name: {"number": place, **slot.status()} for place, (name, slot) in enumerate(self.slots.items(), 1)}

    @property
    def is_measured(self) -> bool:
        """True once the identity and each measurement have a value or a fault."""
        readings = [one for table in ("rails", "temperatures") for one in self._measured(table).values()]
        readings += [self._measured("fan")] if self.hardware.fan else []
        is_identified = self.hardware.identity is None or self.identity is not None or bool(self.unidentified)
        return is_identified and all(one["fault"] or one["age_s"] is not None for one in readings)

    def _measured(self, table: str) -> Any:
        return self.health.status().get(table, {})

    def set_line(self, name: str, is_active: bool, done: Done) -> None:
        """Set a GPIO line at once, or a line of an expander through the worker."""
        if name in self.lines:
            try:
                self.lines.set(name, is_active)
            except InterfaceError as error:
                done(error)
            else:
                done(None)
        else:
            self.worker.ask("expander_set", {"line": name, "active": is_active}, partial(_pass_on, done))

    def status(self) -> dict[str, object]:
        """Return the part of the status about the board.

        name         name of the board.
        description  one line about the board.
        identity     identity of the board; null if unknown.
        slots        object of each slot, by name.
        rails        last values of each measured supply, by name; absent without any.
        temperatures  last values of each sensor, by name; absent without any.
        fan          last values of the fan; absent without one.
        complaints   faults and exceeded limits, in words.
        worker       process for blocking calls to the board.
        """
        return {
            "name": self.hardware.name,
            "description": self.hardware.description,
            "identity": self.identity,
            "slots": self.listed(),
            **self.health.status(),
            "complaints": [*self.complaints(), *self.health.complaints],
            "worker": self.worker.status(),
        }

    def complaints(self) -> list[str]:
        """Return the faults of lines and of hot-plug, in words."""
        return [*([self.deaf] if self.deaf else []), *(fault.message for fault in self.lines.faults.values())]

    def _switch(self, slot: SlotDescription, kind: str, on: bool, done: Done) -> None:
        """Switch power or reset of a slot (board.supply.Switch): by its line if it has one, else by its USB hub."""
        line = {"power": slot.power, "reset": slot.reset}.get(kind)
        if line:
            self.set_line(line, on, done)
        else:
            self.worker.ask(kind, {"usb": slot.usb, "on": on}, partial(_pass_on, done))

    def _changed(self, sequencer: SlotSequencer) -> None:
        self.slots[sequencer.name].sequencer_changed()

    def _listen(self) -> None:
        try:
            self._uevents = Uevents(self._loop, self.machine, self._plugged)
        except InterfaceError as error:
            self.deaf = error.message
            log.warning("%s", error)

    def _plugged(self, event: Uevent | None) -> None:
        """Pass a hot-plug event on to its slot. None: events were lost, so all slots check their devices."""
        if event is None:
            for sequencer in self._sequencers.values():
                sequencer.device_changed()
        elif event.properties.get("DEVTYPE") == "usb_device" and (place := topology.of_devpath(event.devpath)):
            name = topology.holder(place, {name: slot.usb for name, slot in self.hardware.slots.items()})
            if name is not None:
                self._sequencers[name].device_changed()

    def _board_process(self, is_up: bool, why: str) -> None:
        """Read the identity once more when the board process starts again after a failure, for example a late start."""
        if is_up and self.unidentified and self._may_identify_again:
            self._may_identify_again = False
            self._identify()

    def _identify(self) -> None:
        self.worker.ask("identity", {}, self._identified)

    def _identified(self, outcome: Any) -> None:
        if isinstance(outcome, InterfaceError):
            self.unidentified = outcome.message
            log.warning("identity: %s", outcome)
        else:
            self.identity, self.unidentified = outcome, ""

    def _said(self, error: StationError | None) -> None:
        if error is not None:
            log.warning("%s", error)


def _pass_on(done: Done, outcome: object) -> None:
    done(outcome if isinstance(outcome, StationError) else None)
