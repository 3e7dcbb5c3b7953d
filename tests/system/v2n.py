"""A station with an ITS-G5 interface and one to a real broker, and an independent client that observes it there."""

from base64 import b64encode
from collections.abc import Callable
from typing import Any, NamedTuple

from tests.broker.client import Client, Message
from tests.broker.fixtures import Brokers
from tests.broker.mosquitto import Mosquitto
from tests.system.conftest import Bench, Launcher
from tests.system.station import Table, toml_table
from tests.system.user import mark

HOST = "vm"
NAME = "v2n"  # of the interface
ANY_PDU = "v2x/btp/#"
STATUS = "v2x/status"
PATIENCE = 15.0  # s, for what may need a second try with its back-off; reached only by a test that fails


def text(host: str, port: int, pdu: bytes) -> str:
    """The payload of the contract, section 4."""
    return f"{host}({port}): <{b64encode(pdu).decode()}>"


class V2n(NamedTuple):
    """All that a test needs of both ends."""

    bench: Bench
    broker: Mosquitto
    observer: Client

    def says(self, pdu: bytes, port: int = 2001, host: str = "other") -> None:
        """Another station publishes a PDU as the original does."""
        self.observer.publish(f"v2x/btp/{port}", text(host, port, pdu))

    def hears(self) -> Message:
        """The next message of this station that carries a PDU."""
        while not (message := self.observer.next()).payload.startswith(f"{HOST}(".encode()):
            pass
        return message

    def settled(self) -> "V2n":
        """Without what an earlier test left unread, both ways."""
        self.bench.settled()
        self.bench.user.send(b"v2x.cam.", pdu := mark())
        while self.bench.air.hear().pdu != pdu:
            pass
        self.observer.until(text(HOST, 2001, pdu))
        self.says(pdu := mark())
        self.bench.user.forget_until(pdu)
        return self

    def hears_nothing_before_a_mark(self) -> None:
        """What was published before this moment reaches no user; good messages still do, and those of the air."""
        self.says(pdu := mark())
        assert self.bench.user.receive().pdu == pdu
        self.bench.user.hears_nothing_before_a_mark(self.bench.air)

    def dropped(self, reason: str, count: int) -> dict[str, Any]:
        """Wait until so many are dropped for a reason; returns the row of the status."""

        def rows(status: dict[str, Any]) -> list[dict[str, Any]]:
            return [row for row in status["drops"] if (row["where"], row["reason"]) == (NAME, reason)]

        status = self.bench.station.until(lambda status: sum(row["count"] for row in rows(status)) >= count)
        (row,) = rows(status)
        assert row["count"] == count, row
        return row


def table(brokers: Brokers, url: str, **options: Any) -> Table:
    """[interfaces.v2n] of a station with a good certificate. An option that is None is left out."""
    known = brokers.certificates
    good = {
        "driver": "mqtt",
        "url": url,
        "host": HOST,
        "client_id": HOST,
        "ca": str(known.authority.certificate),
        "certificate": str(known.client.certificate),
        "key": str(known.client.key),
    }
    return {key: value for key, value in (good | options).items() if value is not None}


def launched(launch: Launcher, brokers: Brokers, url: str, **options: Any) -> Bench:
    """A started station with both interfaces; the broker may be anything."""
    return launch("btp", more=toml_table(f"interfaces.{NAME}", table(brokers, url, **options)))


def state(status: dict[str, Any]) -> tuple[str, str]:
    """Of the interface: its state, and why."""
    one = status["interfaces"][NAME]
    return one["state"], one["why"]


def until(bench: Bench, holds: Callable[[str, str], bool]) -> str:
    """Wait for a state of the interface; returns why."""
    return state(bench.station.until(lambda status: holds(*state(status)), PATIENCE))[1]


def until_up(bench: Bench) -> str:
    return until(bench, lambda state, _: state == "up")


def connected(launch: Launcher, brokers: Brokers, broker: Mosquitto | None = None, **options: Any) -> V2n:
    """A station that is connected to a broker, and an observer that was there before."""
    broker = broker or brokers()
    observer = brokers.client(broker).subscribe(ANY_PDU, STATUS, no_local=True)
    bench = launched(launch, brokers, broker.url, **options)
    until_up(bench)
    return V2n(bench, broker, observer)
