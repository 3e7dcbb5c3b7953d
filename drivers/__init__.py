"""Registry of drivers by their name in captain.toml.

A driver is imported when it is first used, so a station starts faster: it loads only the drivers of its interfaces.
Each import is written out, so that grep, mypy and the program that builds the one-file binary find every driver.
"""

from collections.abc import Callable, Iterator, Mapping

from drivers.contract import DriverClass


def _udp() -> DriverClass:
    from drivers.udp.driver import Udp

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
    from drivers.gnss.driver import ZedF9p

    return ZedF9p


def _som301e() -> DriverClass:
    from drivers.som301e.driver import Som301e

    return Som301e


def _sim8202g() -> DriverClass:
    from drivers.sim8202g.driver import Sim8202g

    return Sim8202g


def _mqtt() -> DriverClass:
    from drivers.mqtt.driver import Mqtt

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
    """Driver classes by name; a look-up imports the class. Raises KeyError for a name that LOADERS does not have."""

    def __getitem__(self, name: str) -> DriverClass:
        return LOADERS[name]()

    def __contains__(self, name: object) -> bool:
        return name in LOADERS

    def __iter__(self) -> Iterator[str]:
        return iter(LOADERS)

    def __len__(self) -> int:
        return len(LOADERS)


DRIVERS = Drivers()
