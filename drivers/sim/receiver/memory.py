"""Configuration of a simulated receiver: keys in RAM, battery-backed RAM and flash, and factory defaults."""

from collections.abc import Collection
from typing import Literal

from drivers.wire.ublox.keys import KEYS, PORTS, key
from drivers.wire.ublox.values import BBR, FLASH, GET_BBR, GET_DEFAULT, GET_FLASH, GET_RAM, RAM, ValGet, ValSet

NMEA = ("GGA", "GSA", "RMC", "VTG")
PROTOCOLS = ("UBX", "NMEA", "RTCM3X")


def _factory() -> dict[int, int]:
    values: dict[str, int] = dict.fromkeys(KEYS, 0)
    for port in PORTS[:4]:
        values |= {f"CFG-{port}INPROT-{protocol}": 1 for protocol in PROTOCOLS}
        values |= {f"CFG-{port}OUTPROT-{protocol}": 1 for protocol in PROTOCOLS[:2]}
        values |= {f"CFG-MSGOUT-NMEA_ID_{formatter}_{port}": 1 for formatter in NMEA}
    values |= {"CFG-UART1-BAUDRATE": 38_400, "CFG-UART2-BAUDRATE": 38_400}
    values |= {"CFG-RATE-MEAS": 1000, "CFG-RATE-NAV": 1, "CFG-TP-ANT_CABLEDELAY": 50}
    return {KEYS[name].number: value for name, value in values.items()}


class Memory:
    """Configuration layers, with values by key number.

    unknown  names of keys that the firmware does not support.
    """

    def __init__(self, unknown: Collection[str] = ()) -> None:
        self._factory = {number: value for number, value in _factory().items() if key(number).name not in unknown}
        self._flash: dict[int, int] = {}
        self._battery: dict[int, int] = {}
        self._ram = dict(self._factory)
        self.flash_writes = 0

    def boot(self) -> None:
        """Load RAM: a key's value in battery-backed RAM, else in flash, else the factory default."""
        self._ram = {**self._factory, **self._flash, **self._battery}

    def value(self, name: str) -> int:
        """Return the value of a key in RAM; 0 for an unsupported key."""
        return self._ram.get(KEYS[name].number, 0)

    @property
    def baud(self) -> int:
        return self.value("CFG-UART1-BAUDRATE")

    @property
    def period_ms(self) -> int:
        return self.value("CFG-RATE-MEAS")

    def speaks(self, protocol: Literal["ubx", "nmea"], port: str) -> bool:
        return bool(self.value(f"CFG-{port}OUTPROT-{protocol.upper()}"))

    def hears(self, protocol: Literal["ubx", "rtcm3x"], port: str) -> bool:
        return bool(self.value(f"CFG-{port}INPROT-{protocol.upper()}"))

    def set(self, message: ValSet) -> bool:
        """Set all keys of a message; return False, and change nothing, if one of them is unsupported."""
        if not all(number in self._factory for number, _ in message.items):
            return False
        layers = ((RAM, self._ram), (BBR, self._battery), (FLASH, self._flash))
        for layer, values in layers:
            if message.layers & layer:
                values.update(message.items)
        self.flash_writes += bool(message.layers & FLASH)
        return True

    def get(self, question: ValGet) -> ValGet | None:
        """Return the requested values of a layer; None if the layer has none, or a key is unsupported."""
        layers = {GET_RAM: self._ram, GET_BBR: self._battery, GET_FLASH: self._flash, GET_DEFAULT: self._factory}
        values = layers.get(question.layer, {})
        if not all(number in self._factory for number, _ in question.items):
            return None
        found = tuple((number, values[number]) for number, _ in question.items if number in values)
        return ValGet(1, question.layer, found) if found else None
