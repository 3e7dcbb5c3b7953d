"""A slot with a switch and a module that are played, and a driver that does what a test says."""

from collections.abc import Callable

from board.description import SlotDescription
from board.presence import FLAPS
from board.runtime.errors import InterfaceError, StationError
from board.slot import SlotSequencer as Sequencer
from board.usb import UsbDevice
from drivers.contract import Host
from firmware.slots.states import SlotState
from firmware.slots.supervisor import SlotSupervisor
from firmware.station.interface_supervisor import InterfaceSupervisor
from tests.firmware.doubles import NotingStation, ScriptedDriver, interface_of
from tests.virtual import VirtualLoop

DEAF = InterfaceError("/dev/ttyUSB2: no answer to AT within 3 s", "is it an AT port?")
SETTLE_S, BOOT_S, WAIT_S, OFF_S = 0.1, 8.0, 30.0, 5.0


class FakePlace:
    """A slot's switch and the module behind it: it shows itself BOOT_S after power, when there is one.

    refusal  why the switch cannot be set; None: it can.
    tries    times that it was told to.
    """

    def __init__(self, loop: VirtualLoop) -> None:
        self.is_on = False
        self.has_module = True
        self.refusal: StationError | None = None
        self.tries = 0
        self.switched: list[tuple[float, bool]] = []
        self.changed: Callable[[], None] = lambda: None
        self._loop = loop
        self._device: UsbDevice | None = None
        self._booting = loop.after(0.0, lambda: None)
        self._number = 0

    @property
    def cuts(self) -> int:
        return sum(not is_on for _, is_on in self.switched)

    def switch(self, kind: str, on: bool, done: Callable[[StationError | None], None]) -> None:
        self.tries += 1
        if self.refusal is not None:
            done(self.refusal)
            return
        if on is not self.is_on:
            self.switched.append((self._loop.now, on))
            self.is_on, self._device = on, None
            self._booting.cancel()
            if on:
                self._booting = self._loop.after(BOOT_S, self._boot)
        done(None)
        self.changed()

    def look(self) -> UsbDevice | None:
        return self._device

    def plug(self) -> None:
        self.has_module = True
        self._boot()

    def unplug(self) -> None:
        self.has_module, self._device = False, None
        self.changed()

    def flap(self, times: int = FLAPS) -> None:
        """Lose contact so often, half a second each time; the last time it stays away."""
        for _ in range(times - 1):
            self.unplug()
            self._loop.run_for(0.5)
            self.plug()
            self._loop.run_for(0.5)
        self.unplug()

    def _boot(self) -> None:
        if self.is_on and self.has_module and self._device is None:
            self._number += 1
            self._device = UsbDevice("1-1.3", self._number, "1e0e", "9001")
            self.changed()


class Bench:
    def __init__(self, loop: VirtualLoop, has_interface: bool = True) -> None:
        self.loop = loop
        self.power = FakePlace(loop)
        self.driver = ScriptedDriver()
        self.interface = interface_of(loop, NotingStation(), self.driver)
        self.interface.link(False, "not started")
        self.driver.starts = 0
        life = InterfaceSupervisor(loop, self.interface, lambda: 0.5) if has_interface else None
        self.notes: list[str] = []
        description = SlotDescription(
            "ITS-G5", "1-1.3", power="v2x_power", settle_s=SETTLE_S, wait_s=WAIT_S, off_s=OFF_S
        )
        self.sequencer = Sequencer(
            loop, "v2x", description, self.power.switch, self.power.look, lambda _: self.slot.sequencer_changed()
        )
        self.slot = SlotSupervisor(loop, self.sequencer, life, lambda who, what: self.notes.append(what))
        self.power.changed = self.sequencer.device_changed

    @property
    def state(self) -> SlotState:
        return self.slot.state

    def break_driver(self, error: StationError = DEAF) -> None:
        def start(host: Host) -> None:
            raise error

        self.driver.on_start = start

    def mend_driver(self) -> None:
        self.driver.on_start = lambda host: host.link(True, "answers")

    def until(self, state: SlotState, within: float = 600.0) -> None:
        self.loop.run_until(lambda: self.slot.state is state, within)
