"""Drivers that go by a modem: told how it is from their start on, and no more often than there is news."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

import drivers.mqtt
from board.errors import ConfigurationError, InterfaceError
from drivers.contract import Can, Host, Shared
from drivers.mqtt import Mqtt
from drivers.mqtt_options import MqttOptions
from drivers.wire import v2n_talk as talk
from firmware import bearers, carrier, config
from firmware.drops import Drops
from firmware.interface import Interface
from firmware.supervisor import Supervised
from firmware.tables import QueueOptions
from firmware.topics import Topics
from tests.drivers.fake_worker import FakeWorker
from tests.firmware.doubles import NotingStation, ScriptedDriver
from tests.firmware.whole_board import NearRemote, WholeBoard
from tests.virtual import VirtualLoop


class BorneDriver(ScriptedDriver):
    """One that notes what it is told of its bearer."""

    bearer = "modem"

    def __init__(self) -> None:
        super().__init__()
        self.told: list[tuple[bool, str, str]] = []

    def bearer_changed(self, is_up: bool, device: str, why: str) -> None:
        self.told.append((is_up, device, why))

    def take(self) -> list[tuple[bool, str, str]]:
        told, self.told = self.told, []
        return told


class Bench:
    def __init__(self, loop: VirtualLoop) -> None:
        self.driver = BorneDriver()
        modem = ScriptedDriver(Can.BEARER)
        modem.on_start = lambda host: host.link(False, "asks for its SIM")
        self.heard: list[str] = []
        self.all = {name: self._made(loop, name, driver) for name, driver in (("v2n", self.driver), ("modem", modem))}
        self.modem = self.all["modem"].interface
        self.modem.on_link = lambda is_up, why: self.heard.append(why)
        self.all["v2n"].on_start = lambda: self.heard.append("v2n runs")
        bearers.join(self.all)

    def _made(self, loop: VirtualLoop, name: str, driver: ScriptedDriver) -> Supervised:
        interface = Interface(name, driver, QueueOptions("scripted"), loop, NotingStation(), Topics(), Drops())
        return Supervised(loop, interface, chance=lambda: 0.5)

    def up(self, address: str = "10.0.0.7", device: str = "wwan0") -> None:
        self.modem.tell({"device": device, "addresses": [address]})
        self.modem.link(True, f"{device} has {address}")


@pytest.fixture
def bench() -> Iterator[Bench]:
    with closing(VirtualLoop()) as loop:
        yield Bench(loop)


def test_what_its_bearer_is_a_driver_is_told_when_it_has_started(bench: Bench) -> None:
    bench.all["v2n"].start()
    assert bench.driver.take() == [(False, "", "not started")]
    bench.all["modem"].start()
    assert bench.driver.take() == [(False, "", "asks for its SIM")]


def test_a_bearer_that_was_up_before_is_told_with_its_device(bench: Bench) -> None:
    bench.all["modem"].start()
    bench.up()
    assert bench.driver.take() == []  # it does not run yet
    bench.all["v2n"].start()
    assert bench.driver.take() == [(True, "wwan0", "wwan0 has 10.0.0.7")]


def test_another_address_is_news_and_other_words_of_the_same_are_none(bench: Bench) -> None:
    bench.all["modem"].start()
    bench.all["v2n"].start()
    bench.driver.take()
    bench.up("10.0.0.7")
    bench.modem.link(True, "wwan0 has 10.0.0.7, 5 bars")
    bench.up("10.0.0.8")
    assert [state[:2] for state in bench.driver.take()] == [(True, "wwan0")] * 2
    bench.modem.link(False, "lost the network")
    assert bench.driver.take() == [(False, "", "lost the network")]


def test_a_driver_that_has_failed_is_told_nothing_and_all_when_it_runs_again(bench: Bench) -> None:
    bench.all["modem"].start()
    bench.all["v2n"].start()
    bench.driver.take()
    bench.all["v2n"].interface.fail(InterfaceError("its process has ended"))
    bench.up()
    assert bench.driver.take() == []
    bench.all["v2n"].start()
    assert bench.driver.take() == [(True, "wwan0", "wwan0 has 10.0.0.7")]


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


def test_an_interface_at_a_broker_follows_the_modem_of_a_slot(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drivers.mqtt, "Worker", FakeWorker)
    monkeypatch.setattr(FakeWorker, "made", [])
    monkeypatch.setattr(carrier, "Remote", NearRemote)
    with closing(VirtualLoop()) as loop, closing(WholeBoard(loop)) as board:
        driver = Mqtt(MqttOptions(url="mqtts://broker.example:8883", bearer="cellular"), Shared(bytes(6)))
        interface = Interface("v2n", driver, QueueOptions("mqtt"), loop, NotingStation(), Topics(), Drops())
        v2n = Supervised(loop, interface)
        bearers.join({"v2n": v2n, "cellular": board.cellular})
        v2n.start()
        (worker,) = FakeWorker.made
        worker.run()
        board.start()
        board.until_up()
        assert [talk.parse_bearer(message)[0] for message in worker.take(talk.BEARER)] == [False, True]
        assert interface.why.startswith("bearer cellular is down: ")  # until the process says what it does
        worker.message(talk.state(True, "connected"))
        assert (interface.is_up, interface.why) == (True, "connected")
        board.carrier.slots["cellular"].operate("off")
        assert [talk.parse_bearer(message)[0] for message in worker.take(talk.BEARER)] == [False]
        assert (interface.is_up, interface.why) == (
            False,
            "bearer cellular is down: slot cellular: off: by an operator",
        )
        v2n.stop()


TOML = """
[interfaces.v2n]
driver = "mqtt"
url = "mqtts://broker.example:8883"
bearer = "{bearer}"
[interfaces.modem]
driver = "sim8202g"
usb = "1-1.4"
[interfaces.air]
driver = "udp"
listen = "127.0.0.1:0"
"""


@pytest.mark.parametrize(
    ("bearer", "says"),
    [
        ("modm", "interfaces.v2n.bearer: unknown interface 'modm'; did you mean modem?"),
        ("zzz", "interfaces.v2n.bearer: unknown interface 'zzz'; known: modem"),
        ("air", "interfaces.v2n.bearer: 'air' carries no mobile network; known: modem"),
        ("v2n", "interfaces.v2n.bearer: 'v2n' carries no mobile network; known: modem"),
    ],
)
def test_a_bearer_that_is_none_is_a_mistake_of_the_configuration(tmp_path: Path, bearer: str, says: str) -> None:
    path = tmp_path / "captain.toml"
    path.write_text(TOML.format(bearer=bearer))
    with pytest.raises(ConfigurationError) as caught:
        config.load(str(path))
    assert caught.value.message == f"{path}: {says}"


@pytest.mark.parametrize("bearer", ["modem", ""])
def test_a_bearer_that_is_one_and_none_at_all_are_taken(tmp_path: Path, bearer: str) -> None:
    path = tmp_path / "captain.toml"
    path.write_text(TOML.format(bearer=bearer))
    assert config.load(str(path))
