"""Simulated board: its machine, the values of its chips, and a module in each slot.

The switches of a slot are real. A line that the station sets on a simulated expander cuts the supply of its module.
The files `authorized` and `disable` of its USB port do so too.
"""

from collections.abc import Callable, Mapping
from pathlib import Path

from board.description import Hardware, SlotDescription
from board.runtime.loop import Loop, Timer
from board.runtime.scratch import Scratch
from board.topology import parse
from drivers.sim.chips import World
from drivers.sim.machine import SimulatedMachine
from drivers.sim.modules import MODULES, Radio, SimulatedModule, SlotPort
from drivers.sim.options import NeighboursOptions
from drivers.sim.radio.control import VARIABLE
from drivers.sim.receiver.receiver import Receiver
from drivers.sim.trouble import Door, Troubles

# Interval of polling the switches; short compared with the boot of a module, about a second.
POLL_S = 0.1
POWER, RESET = "power", "release"


class SimulatedBoard:
    """Simulation of everything below the machine's files.

    air       addresses of the radio's simulated neighbours; None: the radio hears nothing.
    modules   simulated modules by slot, for slots whose ids have a simulator.
    world     measurements and faults of the chips.
    troubles  faults that tests or commands on a socket can begin and end.
    silence   called periodically; its argument is True while the receiver gives no pulses.
    """

    def __init__(self, loop: Loop, hardware: Hardware, air: NeighboursOptions | None = None) -> None:
        self._loop = loop
        self._air = air
        self._slots: Mapping[str, SlotDescription] = {name: slot for name, slot in hardware.slots.items() if slot.usb}
        self._scratch = Scratch("captain-sim-")
        hub, ports = _hub(self._slots)
        self._simulated = SimulatedMachine(self._scratch.path, hub, ports)
        self.machine = self._simulated.machine
        self.world = World(hardware, self.machine)
        _plant(self.machine.sys, hardware)
        self.modules: dict[str, SimulatedModule] = {}
        self.troubles = Troubles(loop, self, hardware)
        self.silence: Callable[[bool], None] = lambda is_silent: None
        self._door: Door | None = None
        self._timer: Timer | None = None

    def start(self) -> None:
        """Put the modules into their slots, and react to the switches of the board from now on."""
        for name, slot in self._slots.items():
            for made in (MODULES[id_] for id_ in slot.ids[:1] if id_ in MODULES):
                self.modules[name] = made(self._loop, SlotPort(self._simulated, slot.usb, self._air))
                self._simulated.sit(slot.usb, self.modules[name].supplied, _missing(slot))
        self._door = Door(self._loop, self._scratch.path, self.troubles)
        self._poll()

    @property
    def receiver(self) -> Receiver | None:
        """First simulated receiver, which drives the pulse; None without one."""
        players = (module.plays for module in self.modules.values())
        return next((one for one in players if isinstance(one, Receiver)), None)

    @property
    def environment(self) -> dict[str, str]:
        """Environment variables that driver processes need; complete after start()."""
        radios = (module.plays for module in self.modules.values() if isinstance(module.plays, Radio))
        settings = next((radio.settings for radio in radios), "")
        return {VARIABLE: settings} if settings else {}

    def unplug(self, slot: str) -> None:
        """Pull the module out of a slot."""
        self._simulated.leave(self._slots[slot].usb)

    def plug(self, slot: str, other: Callable[[Loop, SlotPort], SimulatedModule] | None = None) -> None:
        """Replace the module in a slot, by the slot's own module or by another one."""
        self.unplug(slot)
        place = SlotPort(self._simulated, self._slots[slot].usb, self._air)
        self._simulated.sit(place.usb, (other(self._loop, place) if other else self.modules[slot]).supplied)

    def close(self) -> None:
        """Stop all modules and remove the simulated machine; idempotent."""
        if self._timer is not None:
            self._timer.cancel()
        if self._door is not None:
            self._door.close()
        for module in self.modules.values():
            module.supplied(False)
        self.modules.clear()
        self._simulated.close()
        self._scratch.close()

    def _poll(self) -> None:
        self._timer = self._loop.after(POLL_S, self._poll)
        self._simulated.poll()
        self.silence(self.receiver is not None and not self.receiver.gives_pulses)
        for slot in self._slots.values():
            if slot.power:
                self._simulated.supply(slot.usb, POWER, self.world.is_active(slot.power))
            if slot.reset:
                self._simulated.supply(slot.usb, RESET, not self.world.is_active(slot.reset))


def _missing(slot: SlotDescription) -> list[str]:
    """Return the conditions of a module's supply that the slot's lines control: power, release of reset."""
    return [word for word, line in ((POWER, slot.power), (RESET, slot.reset)) if line]


def _hub(slots: Mapping[str, SlotDescription]) -> tuple[str, int]:
    """Return the place of the slots' hub, and its number of ports."""
    places = [parse(slot.usb) for slot in slots.values()]
    return (places[0].hub if places else "1-1"), max((place.port for place in places), default=4)


def _plant(sys: Path, hardware: Hardware) -> None:
    """Create the files of the kernel's own drivers: thermal zones, and a fan."""
    for number, one in enumerate(one for one in hardware.temperatures.values() if one.kind == "thermal"):
        _files(sys / f"class/thermal/thermal_zone{number}", type=one.source, temp=48_200)
    if hardware.fan is not None:
        channel = hardware.fan.channel
        files = {"name": hardware.fan.hwmon, f"fan{channel}_input": 2640, f"pwm{channel}": 128}
        _files(sys / "class/hwmon/hwmon0", **files)


def _files(folder: Path, **files: object) -> None:
    folder.mkdir(parents=True)
    for name, value in files.items():
        (folder / name).write_text(f"{value}\n")
