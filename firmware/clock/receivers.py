"""Receiver of the pulse: the configured one, or the only one that announces pulses."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from board.description import PulseDescription
from board.runtime.describe import remedy
from drivers import DRIVERS
from drivers.contract import Can, Shared
from firmware.config.tables import TimeOptions

if TYPE_CHECKING:
    from firmware.config.captain_toml import InterfaceConfig


def mistakes(
    options: TimeOptions,
    pulse: PulseDescription | None,
    tables: Mapping[str, object],
    interfaces: "Sequence[InterfaceConfig]",
    mac: bytes,
) -> Iterator[str]:
    """Yield mistakes in the choice of the receiver, as `key.path: error; remedy`.

    options     table [time] of captain.toml.
    pulse       table [pulse] of the board file; None without one.
    tables      tables of the interfaces as written in the file, valid or not.
    interfaces  configurations of the valid interfaces.
    mac         MAC address of the station, which the drivers' constructors need.
    """
    named = {"time.receiver": options.receiver, "pulse.interface": pulse.interface if pulse else ""}
    if not any(named.values()) and pulse is None:
        return
    # Only a driver object knows its capabilities. Its construction opens no device.
    drivers = {one.name: DRIVERS[one.queue.driver](one.options, Shared(mac)) for one in interfaces}
    announcing = [name for name, driver in drivers.items() if Can.TIMEMARK in driver.capabilities.can]
    for key, name in named.items():
        if (
            name and name not in announcing and (name in drivers or name not in tables)
        ):  # an interface with an error is not reported here: it may announce pulses once it is corrected
            what = f"{name!r} announces no pulses" if name in tables else f"unknown interface {name!r}"
            yield f"{key}: {what}; {remedy(name, announcing)}"
    if pulse is not None and len(announcing) > 1 and not any(named.values()):
        yield f"time.receiver: {' and '.join(announcing)} announce pulses; name the one wired to the board's input"


def chosen(options: TimeOptions, pulse: PulseDescription | None, announcing: Collection[str]) -> str:
    """Return the interface of the receiver that drives the pulse input; empty if it cannot be determined.

    It is the configured one, or else the only one in `announcing`: the interfaces whose receivers announce pulses.
    """
    named = options.receiver or (pulse.interface if pulse else "")
    return named or (next(iter(announcing)) if len(announcing) == 1 else "")
