"""Every kind of interface, by the name that captain.toml calls it: a new one is a function here, and its line.

A driver is imported when it is used: a station pays at its start for those that it has. The imports are written out,
so that grep, mypy and the freezer see every driver.
"""

from collections.abc import Callable, Iterator, Mapping

from drivers.contract import DriverClass


def _udp() -> DriverClass:
    from drivers.udp import Udp

    return Udp


def _ethernet() -> DriverClass:
    from drivers.ethernet import Ethernet

    return Ethernet


def _uart() -> DriverClass:
    from drivers.uart import Uart

    return Uart


def _morse() -> DriverClass:
    from drivers.morse import Morse

    return Morse


def _zed_f9p() -> DriverClass:
    from drivers.zed_f9p import ZedF9p

    return ZedF9p


def _som301e() -> DriverClass:
    from drivers.som301e import Som301e

    return Som301e


def _sim8202g() -> DriverClass:
    from drivers.sim8202g import Sim8202g

    return Sim8202g


def _mqtt() -> DriverClass:
    from drivers.mqtt import Mqtt

    return Mqtt


LOADERS: dict[str, Callable[[], DriverClass]] = {
    "udp": _udp,
    "ethernet": _ethernet,
    "uart": _uart,
    "morse": _morse,
    "zed_f9p": _zed_f9p,
    "som301e": _som301e,
    "sim8202g": _sim8202g,
    "mqtt": _mqtt,
}


class Drivers(Mapping[str, DriverClass]):
    """The classes of LOADERS by name, each imported when it is asked for."""

    def __getitem__(self, name: str) -> DriverClass:
        return LOADERS[name]()

    def __contains__(self, name: object) -> bool:
        return name in LOADERS

    def __iter__(self) -> Iterator[str]:
        return iter(LOADERS)

    def __len__(self) -> int:
        return len(LOADERS)


DRIVERS = Drivers()
