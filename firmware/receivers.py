"""Which receiver drives the pulse: the one that is named, or the only one that announces pulses."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from board.describe import remedy
from board.description import PulseDescription
from drivers import DRIVERS
from drivers.contract import Can, Shared
from firmware.tables import TimeOptions

if TYPE_CHECKING:
    from firmware.config import InterfaceConfig


def mistakes(
    options: TimeOptions,
    pulse: PulseDescription | None,
    tables: Mapping[str, object],
    interfaces: "Sequence[InterfaceConfig]",
    mac: bytes,
) -> Iterator[str]:
    """What cannot be meant, as `key.path: what is wrong; what to do`.

    tables      the interfaces as they are written.
    interfaces  those of them that could be read.
    """
    named = {"time.receiver": options.receiver, "pulse.interface": pulse.interface if pulse else ""}
    if not any(named.values()) and pulse is None:
        return
    # What a driver is able to do it says once it is made, and making it touches nothing.
    drivers = {one.name: DRIVERS[one.queue.driver](one.options, Shared(mac)) for one in interfaces}
    announcing = [name for name, driver in drivers.items() if Can.TIMEMARK in driver.capabilities.can]
    for key, name in named.items():
        if (
            name and name not in announcing and (name in drivers or name not in tables)
        ):  # with mistakes it may become one
            what = f"{name!r} announces no pulses" if name in tables else f"unknown interface {name!r}"
            yield f"{key}: {what}; {remedy(name, announcing)}"
    if pulse is not None and len(announcing) > 1 and not any(named.values()):
        yield f"time.receiver: {' and '.join(announcing)} announce pulses; name the one that drives that of the board"


def chosen(options: TimeOptions, pulse: PulseDescription | None, announcing: Collection[str]) -> str:
    """Its interface; empty where no receiver announces pulses, or several do and nobody says which is meant."""
    named = options.receiver or (pulse.interface if pulse else "")
    return named or (next(iter(announcing)) if len(announcing) == 1 else "")
