"""V2N: station with a radio and a real broker, and an observing client there."""

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
NAME = "v2n"  # name of the interface
ANY_PDU = "v2x/btp/#"
STATUS = "v2x/status"
PATIENCE = 15.0  # timeout in seconds, long enough for a retry after the back-off; only a failing test reaches it


def text(host: str, port: int, pdu: bytes) -> str:
    """Return the payload of a PDU by section 4 of the contract."""
    return f"{host}({port}): <{b64encode(pdu).decode()}>"


class V2n(NamedTuple):
    """Both ends of the connection: station, broker and observer."""

    bench: Bench
    broker: Mosquitto
    observer: Client

    def says(self, pdu: bytes, port: int = 2001, host: str = "other") -> None:
        """Publish a PDU in the name of another station, as the original implementation does."""
        self.observer.publish(f"v2x/btp/{port}", text(host, port, pdu))

    def hears(self) -> Message:
        """Return the next message of this station that carries a PDU."""
        while not (message := self.observer.next()).payload.startswith(f"{HOST}(".encode()):
            pass
        return message

    def settled(self) -> "V2n":
        """Return this object after discarding messages that an earlier test left unread, at both ends."""
        self.bench.settled()
        self.bench.user.send(b"v2x.cam.", pdu := mark())
        while self.bench.air.hear().pdu != pdu:
            pass
        self.observer.until(text(HOST, 2001, pdu))
        self.says(pdu := mark())
        self.bench.user.forget_until(pdu)
        return self

    def hears_nothing_before_a_mark(self) -> None:
        """Check that all messages published before this call were dropped, and that new ones reach the user."""
        self.says(pdu := mark())
        assert self.bench.user.receive().pdu == pdu
        self.bench.user.hears_nothing_before_a_mark(self.bench.air)

    def dropped(self, reason: str, count: int) -> dict[str, Any]:
        """Wait until `count` messages are dropped for a reason; return the row of the status."""

        def rows(status: dict[str, Any]) -> list[dict[str, Any]]:
            return [row for row in status["drops"] if (row["where"], row["reason"]) == (NAME, reason)]

        status = self.bench.station.until(lambda status: sum(row["count"] for row in rows(status)) >= count)
        (row,) = rows(status)
        assert row["count"] == count, row
        return row


def table(brokers: Brokers, url: str, **options: Any) -> Table:
    """Return [interfaces.v2n] of a station with a valid certificate. An option that is None is left out."""
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
    """Start a station with both interfaces. The URL may be that of any broker, even an invalid one."""
    return launch("btp", more=toml_table(f"interfaces.{NAME}", table(brokers, url, **options)))


def state(status: dict[str, Any]) -> tuple[str, str]:
    """Return state and reason of the interface from the status of the station."""
    one = status["interfaces"][NAME]
    return one["state"], one["why"]


def until(bench: Bench, holds: Callable[[str, str], bool]) -> str:
    """Wait until holds() returns True for state and reason of the interface; return the reason."""
    return state(bench.station.until(lambda status: holds(*state(status)), PATIENCE))[1]


def until_up(bench: Bench) -> str:
    return until(bench, lambda state, _: state == "up")


def connected(launch: Launcher, brokers: Brokers, broker: Mosquitto | None = None, **options: Any) -> V2n:
    """Return a station that is connected to a broker, and an observer that connected before it."""
    broker = broker or brokers()
    observer = brokers.client(broker).subscribe(ANY_PDU, STATUS, no_local=True)
    bench = launched(launch, brokers, broker.url, **options)
    until_up(bench)
    return V2n(bench, broker, observer)
