"""Configured bearers: checks that each is an interface that carries a mobile network."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from board.runtime.describe import remedy
from drivers import DRIVERS
from drivers.contract import Can, Shared

if TYPE_CHECKING:
    from firmware.config.captain_toml import InterfaceConfig


def mistakes(
    tables: Mapping[str, Mapping[str, object]], interfaces: "Sequence[InterfaceConfig]", mac: bytes
) -> Iterator[str]:
    """Yield an error for each bearer that is not a mobile network, as `key.path: error; remedy`.

    tables      tables of the interfaces as written in the file, valid or not.
    interfaces  configurations of the valid interfaces.
    mac         MAC address of the station, which the drivers' constructors need.
    """
    wanted = {name: bearer for name, table in tables.items() if (bearer := _bearer_of(table))}
    if not wanted:
        return
    # Only a driver object knows its capabilities. Its construction opens no device.
    drivers = {one.name: DRIVERS[one.queue.driver](one.options, Shared(mac)) for one in interfaces}
    bearers = [name for name, driver in drivers.items() if Can.BEARER in driver.capabilities.can]
    for name, bearer in wanted.items():
        # An interface with an error is not reported here: it may be a mobile network once it is corrected.
        if bearer in drivers.keys() - set(bearers) or bearer not in tables:
            what = f"{bearer!r} carries no mobile network" if bearer in tables else f"unknown interface {bearer!r}"
            yield f"interfaces.{name}.bearer: {what}; {remedy(bearer, bearers)}"


def _bearer_of(table: Mapping[str, object]) -> str:
    """Return the value of an interface's key `bearer`; empty if the key is missing or its driver uses no bearer."""
    word, bearer = table.get("driver"), table.get("bearer")
    driver = DRIVERS.get(word) if isinstance(word, str) else None
    return bearer if driver is not None and hasattr(driver, "bearer_changed") and isinstance(bearer, str) else ""
