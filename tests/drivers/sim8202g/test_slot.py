"""Modem in a slot: unplugging the module ends the driver, plugging it in starts it.

The test uses the station's own slot, supervisor and interface, with a simulated modem in virtual time.
"""

from contextlib import closing

import pytest

from board import usb
from board.description import SlotDescription
from board.slot import SlotSequencer as Sequencer
from drivers.sim8202g.composition import MOST_SWITCHES
from firmware.config.tables import QueueOptions
from firmware.routing.drops import Drops
from firmware.routing.interface import Interface
from firmware.slots.states import SlotState
from firmware.slots.supervisor import SlotSupervisor
from firmware.station.interface_supervisor import InterfaceSupervisor
from firmware.topics import Topics
from tests.drivers.sim8202g.modem import PLACE, Bench
from tests.firmware.doubles import NotingStation
from tests.ptys import PtyLoop, Ptys


class SlotBench:
    """Bench with a modem in a slot that has a power switch."""

    def __init__(self, loop, folder, **options) -> None:
        self.loop = loop
        self.inner = Bench(loop, folder, **options)
        self.modem = self.inner.modem
        self.cuts = 0
        self.interface = Interface(
            "modem", self.inner.driver, QueueOptions("sim8202g", 1, 0.0), loop, NotingStation(), Topics(), Drops()
        )
        ids = ("1e0e:9001", "1e0e:9011", "1e0e:901e")
        description = SlotDescription("5G", PLACE, ids=ids, power="modem_power", wait_s=45.0, off_s=5.0)
        machine = self.inner.board.machine
        sequencer = Sequencer(
            loop,
            "m2",
            description,
            self._switch,
            lambda: usb.find(machine, PLACE),
            lambda _: self.slot.sequencer_changed(),
        )
        life = InterfaceSupervisor(loop, self.interface, lambda: 0.5)
        self.notes: list[str] = []
        self.slot = SlotSupervisor(loop, sequencer, life, lambda who, what: self.notes.append(what))
        self.inner.board.sit(PLACE, lambda is_on: None)
        plug, unplug = self.modem._plug, self.modem._unplug
        self.modem._plug = lambda device: (plug(device), sequencer.device_changed())
        self.modem._unplug = lambda: (unplug(), sequencer.device_changed())

    def _switch(self, kind, on, done) -> None:
        self.cuts += not on
        self.modem.supplied(on)
        done(None)

    def close(self) -> None:
        self.slot.stop()
        self.inner.close()


@pytest.fixture
def make(tmp_path, monkeypatch):
    with closing(PtyLoop(Ptys(monkeypatch))) as loop:
        made = []

        def make(**options):
            made.append(SlotBench(loop, tmp_path, **options))
            made[-1].slot.start()
            return made[-1]

        yield make
        for bench in made:
            bench.close()


def writes(bench, begin="AT+CUSBCFG="):
    return sum(text.startswith(begin) for text in bench.modem.asked)


def test_it_comes_up_in_its_slot(make):
    bench = make()
    bench.loop.run_until(lambda: bench.interface.is_up, within=120)
    assert bench.slot.state is SlotState.RUNNING


def test_another_composition_takes_the_driver_down_and_it_comes_back_with_it(make):
    bench = make(bearer="rndis")
    bench.loop.run_until(lambda: bench.interface.is_up, within=300)
    assert (bench.modem.product, writes(bench)) == ("9011", 1)


def test_a_composition_that_is_not_kept_is_not_written_for_ever(make):
    bench = make(bearer="rndis")
    bench.modem.lies = lambda text: "\r\nUSBID: 0X1E0E,0X9001\r\n\r\nOK\r\n" if text == "AT+CUSBCFG?" else None
    bench.loop.run_for(1800)
    assert writes(bench) == MOST_SWITCHES
