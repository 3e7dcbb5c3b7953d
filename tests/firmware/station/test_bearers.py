"""Drivers that go by a modem: told how it is from their start on, and no more often than there is news."""

from collections.abc import Iterator
from contextlib import closing

import pytest

import drivers.mqtt.uplink
from board.runtime.errors import InterfaceError, StationError
from drivers.contract import Can, Host, Shared
from drivers.mqtt.driver import Mqtt
from drivers.mqtt.options import MqttOptions
from drivers.wire.v2n import talk
from firmware.config.tables import QueueOptions
from firmware.routing.drops import Drops
from firmware.routing.interface import Interface, InterfaceListener
from firmware.station import bearers, carrier
from firmware.station.interface_supervisor import InterfaceSupervisor
from firmware.topics import Topics
from tests.drivers.fake_worker import FakeWorker
from tests.firmware.doubles import NotingStation, ScriptedDriver
from tests.firmware.whole_board import NearBoardWorker, WholeBoard
from tests.said import tells
from tests.virtual import VirtualLoop


class BorneDriver(ScriptedDriver):
    """One that notes what it is told of its bearer."""

    bearer = "modem"

    def __init__(self) -> None:
        super().__init__()
        self.told: list[tuple[str, str, str]] = []

    def bearer_changed(self, state: str, device: str, why: str) -> None:
        self.told.append((state, device, why))

    def take(self) -> list[tuple[str, str, str]]:
        told, self.told = self.told, []
        return told


class NotingListener(InterfaceListener):
    def __init__(self, heard: list[str]) -> None:
        self._heard = heard

    def link_changed(self, state: str, why: str) -> None:
        self._heard.append(why)


class NotingSlot:
    def __init__(self, heard: list[str]) -> None:
        self._heard = heard

    def driver_started(self) -> None:
        self._heard.append("v2n runs")

    def driver_failed(self, error: StationError) -> bool:
        return True


class Bench:
    def __init__(self, loop: VirtualLoop) -> None:
        self.driver = BorneDriver()
        modem = ScriptedDriver(Can.BEARER)
        modem.on_start = lambda host: host.link(False, "asks for its SIM")
        self.heard: list[str] = []
        self.all = {name: self._made(loop, name, driver) for name, driver in (("v2n", self.driver), ("modem", modem))}
        self.modem = self.all["modem"].interface
        self.modem.listener = NotingListener(self.heard)
        self.all["v2n"].slot = NotingSlot(self.heard)
        bearers.join(self.all)

    def _made(self, loop: VirtualLoop, name: str, driver: ScriptedDriver) -> InterfaceSupervisor:
        interface = Interface(name, driver, QueueOptions("scripted"), loop, NotingStation(), Topics(), Drops())
        return InterfaceSupervisor(loop, interface, chance=lambda: 0.5)

    def up(self, address: str = "10.0.0.7", device: str = "wwan0") -> None:
        self.modem.report_details({"device": device, "addresses": [address]})
        self.modem.link(True, f"{device} has {address}")


@pytest.fixture
def bench() -> Iterator[Bench]:
    with closing(VirtualLoop()) as loop:
        yield Bench(loop)


def test_what_its_bearer_is_a_driver_is_told_when_it_has_started(bench: Bench) -> None:
    bench.all["v2n"].start()
    assert bench.driver.take() == [("down", "", "not started")]
    bench.all["modem"].start()
    assert bench.driver.take() == [("down", "", "asks for its SIM")]


def test_bearer_in_its_bring_up_is_told_as_starting(bench: Bench) -> None:
    bench.all["v2n"].start()
    bench.all["modem"].start()
    bench.driver.take()
    why = "registers with the network"
    bench.modem.starting(why)
    bench.modem.link(False, why)
    assert bench.driver.take() == [(state, "", why) for state in ("starting", "down")]


def test_bearer_that_fails_alike_after_a_retry_is_told_as_down(bench: Bench) -> None:
    gone = InterfaceError("unplugged")
    bench.all["modem"].start()
    bench.modem.fail(gone)
    modem = bench.all["modem"].interface.driver
    assert isinstance(modem, ScriptedDriver)
    modem.on_start = lambda host: None
    bench.all["modem"].start()
    bench.all["v2n"].start()
    bench.modem.fail(gone)
    (state, device, why), down = bench.driver.take()
    assert (state, device, down) == ("starting", "", ("down", "", gone.message))
    assert "link" in why


def test_a_bearer_that_was_up_before_is_told_with_its_device(bench: Bench) -> None:
    bench.all["modem"].start()
    bench.up()
    assert bench.driver.take() == []  # it does not run yet
    bench.all["v2n"].start()
    assert bench.driver.take() == [("up", "wwan0", "wwan0 has 10.0.0.7")]


def test_another_address_is_news_and_other_words_of_the_same_are_none(bench: Bench) -> None:
    bench.all["modem"].start()
    bench.all["v2n"].start()
    bench.driver.take()
    bench.up("10.0.0.7")
    bench.modem.link(True, "wwan0 has 10.0.0.7, 5 bars")
    bench.up("10.0.0.8")
    assert [state[:2] for state in bench.driver.take()] == [("up", "wwan0")] * 2
    bench.modem.link(False, "lost the network")
    assert bench.driver.take() == [("down", "", "lost the network")]


def test_a_driver_that_has_failed_is_told_nothing_and_all_when_it_runs_again(bench: Bench) -> None:
    bench.all["modem"].start()
    bench.all["v2n"].start()
    bench.driver.take()
    bench.all["v2n"].interface.fail(InterfaceError("its process has ended"))
    bench.up()
    assert bench.driver.take() == []
    bench.all["v2n"].start()
    assert bench.driver.take() == [("up", "wwan0", "wwan0 has 10.0.0.7")]


def test_whoever_listened_before_still_does(bench: Bench) -> None:
    bench.all["v2n"].start()
    bench.all["modem"].start()
    assert bench.heard == ["v2n runs", "asks for its SIM"]


def test_a_driver_may_fail_by_what_it_is_told(bench: Bench) -> None:
    hosts: list[Host] = []
    bench.driver.on_start = hosts.append
    bench.driver.bearer_changed = lambda *_: hosts[0].fail(InterfaceError("no"))  # type: ignore[method-assign]
    bench.all["v2n"].start()
    assert bench.all["v2n"].state == "waiting"


def test_interface_at_a_broker_follows_the_modem_of_a_slot(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drivers.mqtt.uplink, "Worker", FakeWorker)
    monkeypatch.setattr(FakeWorker, "made", [])
    monkeypatch.setattr(carrier, "BoardWorker", NearBoardWorker)
    with closing(VirtualLoop()) as loop, closing(WholeBoard(loop)) as board:
        driver = Mqtt(MqttOptions(url="mqtts://broker.example:8883", bearer="cellular"), Shared(bytes(6)))
        interface = Interface("v2n", driver, QueueOptions("mqtt"), loop, NotingStation(), Topics(), Drops())
        v2n = InterfaceSupervisor(loop, interface)
        bearers.join({"v2n": v2n, "cellular": board.cellular})
        v2n.start()
        (worker,) = FakeWorker.made
        worker.run()
        board.start()
        board.until_up()
        assert [talk.parse_bearer(message)[0] for message in worker.take(talk.BEARER)] == [False, True]
        # Until the process reports its own link.
        assert interface.link_state == "starting"
        assert tells(interface.why, "bearer cellular", "connects")
        worker.message(talk.state(True, "connected"))
        assert (interface.is_up, interface.why) == (True, "connected")
        board.carrier.slots["cellular"].operate("off")
        assert [talk.parse_bearer(message)[0] for message in worker.take(talk.BEARER)] == [False]
        assert interface.link_state == "down"
        assert tells(interface.why, "bearer cellular", "slot cellular: off: ", "operator")
        v2n.stop()
