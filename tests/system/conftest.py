"""Fixtures that start stations: shared by a module, or for a single test."""

import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import zmq

from tests.broker.fixtures import brokers, brokers_shared, certificates
from tests.system.air import Air
from tests.system.ports import Ports
from tests.system.station import ROOT, Station, Table
from tests.system.user import Reports, User, mark

__all__ = ["brokers", "brokers_shared", "certificates"]  # fixtures


class Bench(NamedTuple):
    """Running station with the far ends of its interfaces and a connected user."""

    station: Station
    airs: dict[str, Air]
    user: User
    make_reports: Callable[[], Reports]

    @property
    def air(self) -> Air:
        return next(iter(self.airs.values()))

    def settled(self) -> "Bench":
        """Return this bench after discarding messages that an earlier test left unread."""
        self.user.send(b"v2x.cam.", sent := mark())
        while self.air.hear().pdu != sent:
            pass
        self.air.send(thrown := mark())
        self.user.forget_until(thrown)
        return self


class Launcher:
    """Launcher of stations with udp interfaces. At the end it stops them all and checks that each ends normally."""

    def __init__(self, folder: Callable[[], Path]) -> None:
        self._folder = folder
        self._ports = Ports()
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._closing: list[Callable[[], None]] = []
        self._stations: list[Station] = []

    def station(self) -> Station:
        """Return a station that is neither configured nor started."""
        station = Station(self._folder(), self._ports)
        self._stations.append(station)
        return station

    def port(self) -> int:
        return self._ports.take()

    def at_end(self, close: Callable[[], None]) -> None:
        """Register a function to call after all stations have ended."""
        self._closing.append(close)

    def air(self, framing: str) -> Air:
        air = Air(framing, self._ports.take())
        self.at_end(air.close)
        return air

    def user(self, station: Station) -> User:
        """Return a further user, which is not connected yet."""
        user = User(self._context, station)
        self.at_end(user.close)
        return user

    def __call__(
        self,
        framing: str = "pdu",
        *,
        interfaces: Mapping[str, str] | None = None,
        options: Mapping[str, Table] | None = None,
        more: str = "",
        **tables: Any,
    ) -> Bench:
        """Return a running station with a user, connected through the first interface.

        framing     framing of the only interface, g5; or else
        interfaces  framing of each interface, by name.
        options     further keys of each interface, by name.
        more        further text of captain.toml.
        tables      further tables of captain.toml, by name.
        """
        airs = {name: self.air(kind) for name, kind in (interfaces or {"g5": framing}).items()}
        rows = {name: dict(air.table) | dict((options or {}).get(name, {})) for name, air in airs.items()}
        station = self.station()
        station.configure(rows, more, **tables)
        station.start()
        user = self.user(station).join(next(iter(airs.values())))
        return Bench(station, airs, user, lambda: self.reports(station, user))

    def reports(self, station: Station, user: User) -> Reports:
        """Return a subscriber to all reports; confirms of the user's requests arrive."""
        reports = Reports(self._context, station)
        self.at_end(reports.close)
        return reports.join(user)

    def close(self) -> None:
        try:
            for station in self._stations:
                station.stop()
        finally:
            for station in self._stations:
                station.kill()
            while self._closing:
                self._closing.pop()()
            self._context.destroy(linger=0)
            self._ports.release()


@pytest.fixture
def launch(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launcher]:
    launcher = Launcher(lambda: tmp_path_factory.mktemp("s"))
    yield launcher
    launcher.close()


@pytest.fixture(scope="module")
def launch_shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launcher]:
    launcher = Launcher(lambda: tmp_path_factory.mktemp("s"))
    yield launcher
    launcher.close()


@pytest.fixture(scope="module")
def shared_pdu(launch_shared: Launcher) -> Bench:
    return launch_shared("pdu")


@pytest.fixture(scope="module")
def shared_btp(launch_shared: Launcher) -> Bench:
    return launch_shared("btp")


@pytest.fixture(scope="module")
def shared_ethernet(launch_shared: Launcher) -> Bench:
    return launch_shared("ethernet")


@pytest.fixture(scope="module")
def shared_legacy(launch_shared: Launcher) -> Bench:
    return launch_shared("btp", station={"profile": "legacy"})


@pytest.fixture
def pdu(shared_pdu: Bench) -> Bench:
    """Return a station with one interface of framing pdu, shared by the tests of a module."""
    return shared_pdu.settled()


@pytest.fixture
def btp(shared_btp: Bench) -> Bench:
    """Return a shared station with framing btp."""
    return shared_btp.settled()


@pytest.fixture
def ethernet(shared_ethernet: Bench) -> Bench:
    """Return a shared station with framing ethernet."""
    return shared_ethernet.settled()


@pytest.fixture
def legacy(shared_legacy: Bench) -> Bench:
    """Return a shared station with framing btp and profile legacy."""
    return shared_legacy.settled()


@pytest.fixture(scope="session")
def frames() -> dict[str, bytes]:
    """Return frames of an independent station, by name."""
    rows = json.loads((ROOT / "tests" / "captures" / "frames.json").read_text())["frames"]
    return {row["name"]: bytes.fromhex(row["hex"]) for row in rows}


@pytest.fixture(scope="session")
def vectors() -> list[dict[str, Any]]:
    """Return the twelve messages that tests, demo and lab send."""
    rows: list[dict[str, Any]] = json.loads((ROOT / "firmware" / "vectors.json").read_text())
    return [row | {"pdu": bytes.fromhex(row["hex"])} for row in rows]
