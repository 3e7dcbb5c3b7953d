"""Interfaces that go by a mobile network, and the modem's that each has named as its bearer."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from board.describe import remedy
from drivers import DRIVERS
from drivers.contract import Borne, Can, Shared
from firmware.supervisor import Supervised

if TYPE_CHECKING:
    from firmware.config import InterfaceConfig

RUNS = ("up", "down")  # states in which a driver is started


def mistakes(
    tables: Mapping[str, Mapping[str, object]], interfaces: "Sequence[InterfaceConfig]", mac: bytes
) -> Iterator[str]:
    """Each bearer that is none, as `key.path: what is wrong; what to do`.

    tables      the interfaces as they are written.
    interfaces  those of them that could be read.
    """
    wanted = {name: bearer for name, table in tables.items() if (bearer := _bearer_of(table))}
    if not wanted:
        return
    # What a driver is able to do it says once it is made, and making it touches nothing.
    drivers = {one.name: DRIVERS[one.queue.driver](one.options, Shared(mac)) for one in interfaces}
    bearers = [name for name, driver in drivers.items() if Can.BEARER in driver.capabilities.can]
    for name, bearer in wanted.items():
        if bearer in drivers.keys() - set(bearers) or bearer not in tables:  # what has mistakes may become one
            what = f"{bearer!r} carries no mobile network" if bearer in tables else f"unknown interface {bearer!r}"
            yield f"interfaces.{name}.bearer: {what}; {remedy(bearer, bearers)}"


def _bearer_of(table: Mapping[str, object]) -> str:
    """What an interface that can follow one names as its bearer; empty: nothing."""
    word, bearer = table.get("driver"), table.get("bearer")
    driver = DRIVERS.get(word) if isinstance(word, str) else None
    return bearer if driver is not None and hasattr(driver, "bearer_changed") and isinstance(bearer, str) else ""


def join(interfaces: Mapping[str, Supervised]) -> None:
    """Tell each driver that has a bearer how that is, from its start on. After whoever else listens to them."""
    for follower in interfaces.values():
        driver = follower.interface.driver
        if isinstance(driver, Borne) and driver.bearer:
            _Following(driver, follower, interfaces[driver.bearer])


class _Following:
    """One driver and its bearer. Those who were told before of start and link still are."""

    def __init__(self, driver: Borne, follower: Supervised, bearer: Supervised) -> None:
        self._driver = driver
        self._follower = follower
        self._bearer = bearer.interface
        self._told: tuple[object, ...] = ()
        self._on_start = follower.on_start
        self._on_link = self._bearer.on_link
        follower.on_start = self._started
        self._bearer.on_link = self._changed

    def _started(self) -> None:
        self._on_start()
        self._told = ()
        self._tell()

    def _changed(self, is_up: bool, why: str) -> None:
        self._on_link(is_up, why)
        self._tell()

    def _tell(self) -> None:
        """Where it has another device or address it is told anew; other words of a link that is up are no news."""
        bearer = self._bearer
        device, addresses = bearer.details.get("device", ""), bearer.details.get("addresses")
        state = (True, device, addresses) if bearer.is_up else (False, bearer.why)
        if self._follower.state in RUNS and state != self._told:
            self._told = state
            self._driver.bearer_changed(bearer.is_up, str(device) if bearer.is_up else "", bearer.why)
