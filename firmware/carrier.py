"""The board under the station: its lines, its worker, what it measures, who is plugged in, and its slots."""

import logging
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from board import topology, usb
from board.description import Hardware, SlotDescription
from board.errors import InterfaceError, StationError
from board.health import Health
from board.line import Lines
from board.loop import Loop
from board.machine import Machine
from board.remote import Remote
from board.slot import Slot as Sequencer
from board.uevent import Uevent, Uevents
from firmware.slots import Slot
from firmware.supervisor import Supervised

Done = Callable[[StationError | None], None]

log = logging.getLogger("captain.board")


class Carrier:
    """What a board file declares, brought up.

    interfaces  by the slot that they sit in.
    noted       told of every decision of a slot.
    worker      name of the program that does what blocks: another one plays the chips of a simulated board.

    Nothing here is made to lose its power by stop() or close(): modules outlive a restart of the station.
    """

    def __init__(
        self,
        loop: Loop,
        hardware: Hardware,
        machine: Machine,
        interfaces: Mapping[str, Supervised],
        noted: Callable[[str, str], None],
        worker: str = "board",
    ) -> None:
        self.hardware = hardware
        self.machine = machine
        self.identity: Mapping[str, object] | None = None
        self.unidentified = ""  # why that is
        self.deaf = ""  # why hot-plug is not heard
        self.lines = Lines(hardware.lines, machine.dev)
        self.remote = Remote(loop, hardware, machine, worker)
        self.health = Health(loop, self.remote, hardware)
        self._loop = loop
        self._uevents: Uevents | None = None
        self._sequencers: dict[str, Sequencer] = {}
        self.slots: dict[str, Slot] = {}
        for name, described in hardware.slots.items():
            sequencer = Sequencer(
                loop, name, described, partial(self._switch, described), partial(self.look, name), self._changed
            )
            self._sequencers[name] = sequencer
            self.slots[name] = Slot(loop, sequencer, interfaces.get(name), noted)

    def start(self) -> None:
        """Listen for hot-plug before anything can be plugged, then the lines, then the slots."""
        if self.slots:
            self._listen()
        self.lines.open()
        for fault in self.lines.faults.values():
            log.warning("%s", fault)
        self.remote.start()
        for name, line in self.hardware.lines.items():
            if line.expander and line.initial != "keep":
                self.set_line(name, line.initial == "active", self._said)
        if self.hardware.identity is not None:
            self.remote.ask("identity", {}, self._identified)
        self.health.start()
        for slot in self.slots.values():
            slot.start()

    def stop(self) -> None:
        """Stop the drivers in slots; idempotent."""
        for slot in self.slots.values():
            slot.stop()
        self.health.stop()

    def close(self) -> None:
        """Let go of everything, and leave it as it is; idempotent."""
        self.stop()
        if self._uevents is not None:
            self._uevents.close()
        self.remote.finish()
        self.lines.close()

    def look(self, name: str) -> usb.Device | None:
        """What is plugged into a slot now; None also where the board file does not say where to look."""
        place = self.hardware.slots[name].usb
        return usb.find(self.machine, place) if place else None

    def listed(self) -> dict[str, dict[str, object]]:
        """The status of each slot, with its number from 1 on."""
        return {name: {"number": place, **slot.status()} for place, (name, slot) in enumerate(self.slots.items(), 1)}

    @property
    def is_measured(self) -> bool:
        """Whether everything that is read was read once, or could not be."""
        readings = [one for table in ("rails", "temperatures") for one in self._measured(table).values()]
        readings += [self._measured("fan")] if self.hardware.fan else []
        is_identified = self.hardware.identity is None or self.identity is not None or bool(self.unidentified)
        return is_identified and all(one["fault"] or one["age_s"] is not None for one in readings)

    def _measured(self, table: str) -> Any:
        return self.health.status().get(table, {})

    def set_line(self, name: str, is_active: bool, done: Done) -> None:
        """Set one of the Pi's lines at once, or one of an expander through the worker."""
        if name in self.lines:
            try:
                self.lines.set(name, is_active)
            except InterfaceError as error:
                done(error)
            else:
                done(None)
        else:
            self.remote.ask("expander_set", {"line": name, "active": is_active}, partial(_pass_on, done))

    def status(self) -> dict[str, object]:
        """The part of the status that is about the board."""
        return {
            "name": self.hardware.name,
            "description": self.hardware.description,
            "identity": self.identity,
            "slots": self.listed(),
            **self.health.status(),
            "complaints": [*self.complaints(), *self.health.complaints],
            "worker": self.remote.status(),
        }

    def complaints(self) -> list[str]:
        """What cannot be had of lines and hot-plug."""
        return [*([self.deaf] if self.deaf else []), *(fault.message for fault in self.lines.faults.values())]

    def _switch(self, slot: SlotDescription, kind: str, on: bool, done: Done) -> None:
        """board.supply.Switch: lines by name, the others through the hub that the slot is at."""
        line = {"power": slot.power, "reset": slot.reset}.get(kind)
        if line:
            self.set_line(line, on, done)
        else:
            self.remote.ask(kind, {"usb": slot.usb, "on": on}, partial(_pass_on, done))

    def _changed(self, sequencer: Sequencer) -> None:
        self.slots[sequencer.name].changed()

    def _listen(self) -> None:
        try:
            self._uevents = Uevents(self._loop, self.machine, self._plugged)
        except InterfaceError as error:
            self.deaf = error.message
            log.warning("%s", error)

    def _plugged(self, event: Uevent | None) -> None:
        """A device has come or gone; or some have, and nobody knows which."""
        if event is None:
            for sequencer in self._sequencers.values():
                sequencer.device_changed()
        elif event.properties.get("DEVTYPE") == "usb_device" and (place := topology.of_devpath(event.devpath)):
            name = topology.holder(place, {name: slot.usb for name, slot in self.hardware.slots.items()})
            if name is not None:
                self._sequencers[name].device_changed()

    def _identified(self, outcome: Any) -> None:
        if isinstance(outcome, InterfaceError):
            self.unidentified = outcome.message
            log.warning("identity: %s", outcome)
        else:
            self.identity = outcome

    def _said(self, error: StationError | None) -> None:
        if error is not None:
            log.warning("%s", error)


def _pass_on(done: Done, outcome: object) -> None:
    done(outcome if isinstance(outcome, StationError) else None)
