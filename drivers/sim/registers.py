"""Simulated I2C chips: their registers, as in the data sheets.

A transaction writes to a chip and then reads from it. The functions held() and hold() save and restore the registers,
so that they survive the process that talks to the chip.
"""

import errno
import json
import os
import struct
from collections.abc import Sequence
from typing import Protocol


class Chip(Protocol):
    """Chip at an address of a bus."""

    def transfer(self, write: bytes, read: int) -> bytes:
        """Write, then read. Raises OSError(EREMOTEIO) if the chip does not answer."""

    def held(self) -> bytes:
        """Return the state of the chip, for hold() in another process."""

    def hold(self, octets: bytes) -> None: ...


class Expander:
    """PCA9555. Undriven pins are high, because of its 100 kohm pull-ups.

    outside  levels that an external source forces on pins, also on driven ones (a short).
    """

    def __init__(self) -> None:
        self.outside: dict[int, bool] = {}
        self.registers = bytearray((0, 0, 0xFF, 0xFF, 0, 0, 0xFF, 0xFF))  # values at power-on
        self._command = 0

    @property
    def levels(self) -> list[bool]:
        """Levels at the sixteen pins."""
        latches, inputs = struct.unpack("<2xH2xH", self.registers)
        return [self.outside.get(pin, bool((latches | inputs) >> pin & 1)) for pin in range(16)]

    def transfer(self, write: bytes, read: int) -> bytes:
        if write:
            self._command = write[0] & 7
        for octet in write[1:]:
            if self._command > 1:  # input registers are read-only
                self.registers[self._command] = octet
            self._command ^= 1  # the next access is to the other register of the pair
        found = bytearray()
        for _ in range(read):
            found.append(self._fetch(self._command))
            self._command ^= 1
        return bytes(found)

    def held(self) -> bytes:
        return bytes(self.registers)

    def hold(self, octets: bytes) -> None:
        self.registers[:] = octets

    def _fetch(self, register: int) -> int:
        if register > 1:
            return self.registers[register]
        levels = self.levels[8 * register : 8 * register + 8]
        return sum(level << pin for pin, level in enumerate(levels)) ^ self.registers[4 + register]


class Words:
    """Chip with 16-bit big-endian registers, which a pointer register selects."""

    def __init__(self, at_power_on: dict[int, int]) -> None:
        self.registers = dict(at_power_on)
        self._pointer = 0

    def transfer(self, write: bytes, read: int) -> bytes:
        if write:
            self._pointer = write[0]
        if len(write) > 2:
            self.store(self._pointer, int.from_bytes(write[1:3], "big"))
        return (self.fetch(self._pointer).to_bytes(2, "big") * ((read + 1) // 2))[:read]

    def store(self, register: int, word: int) -> None:
        if register in self.registers:
            self.registers[register] = word

    def fetch(self, register: int) -> int:
        return self.registers.get(register, 0)

    def held(self) -> bytes:
        return json.dumps(self.registers).encode()

    def hold(self, octets: bytes) -> None:
        self.registers = {int(register): word for register, word in json.loads(octets).items()}


class Ina(Words):
    """INA219, INA226 or INA3221 between a supply and a load.

    loads      volts and amperes of each channel.
    shunt_ohm  shunt resistance of each channel.
    """

    def __init__(self, kind: str, shunt_ohm: Sequence[float]) -> None:
        configuration = {"ina219": 0x399F, "ina226": 0x4127, "ina3221": 0x7127}[kind]
        super().__init__({0: configuration})
        self.loads = [(0.0, 0.0)] * len(shunt_ohm)
        self._kind = kind
        self._shunt_ohm = shunt_ohm

    def fetch(self, register: int) -> int:
        match self._kind, register:
            case "ina226", 0xFF:
                return 0x2260
            case "ina3221", 0xFF:
                return 0x3220
            case "ina226", 0x06:
                return 1 << 3  # the flag "conversion ready" is set
            case "ina3221", 0x0F:
                return 1
        if not 1 <= register <= 2 * len(self.loads):
            return super().fetch(register)
        channel, is_bus = divmod(register - 1, 2)
        volts, amps = self.loads[channel]
        return self._bus(volts) if is_bus else self._shunt(amps * self._shunt_ohm[channel])

    def _bus(self, volts: float) -> int:
        if self._kind == "ina219":
            return min(round(volts / 4e-3), 0x1FFF) << 3 | 1 << 1  # bit 1: ready
        if self._kind == "ina226":
            return min(round(volts / 1.25e-3), 0x7FFF)
        return _signed(volts / 8e-3, 0xFFF) << 3 & 0xFFFF

    def _shunt(self, volts: float) -> int:
        if self._kind == "ina219":
            return _signed(volts / 10e-6, 32000) & 0xFFFF
        if self._kind == "ina226":
            return _signed(volts / 2.5e-6, 0x7FFF) & 0xFFFF
        return _signed(volts / 40e-6, 0xFFF) << 3 & 0xFFFF


class Tmp102(Words):
    """TMP102 at a temperature in degrees Celsius."""

    def __init__(self) -> None:
        super().__init__({1: 0x60A0, 2: 75 << 8, 3: 80 << 8})
        self.celsius = 25.0

    def fetch(self, register: int) -> int:
        if register != 0:
            return super().fetch(register)
        if self.registers[1] & 1 << 4:  # extended mode: 13 bits; the last bit of the word is set
            return (_signed(self.celsius * 16, 0xFFF) << 3 & 0xFFFF) | 1
        return _signed(self.celsius * 16, 0x7FF) << 4 & 0xFFFF


class Eeprom:
    """EEPROM 24C32.

    busy          number of transactions without answer after a write.
    is_protected  state of pin WP: True acknowledges writes and discards their data.
    """

    SIZE = 4096
    PAGE = 32

    def __init__(self, octets: bytes = b"", busy: int = 3) -> None:
        self.memory = bytearray(octets.ljust(self.SIZE, b"\xff"))
        self.is_protected = False
        self._busy = busy
        self._unanswered = 0
        self._address = 0

    def transfer(self, write: bytes, read: int) -> bytes:
        """Write, then read a number of octets.

        Raises OSError(EREMOTEIO) while a page is being written: a 24C32 does not answer in that time.
        """
        if self._unanswered:
            self._unanswered -= 1
            raise OSError(errno.EREMOTEIO, os.strerror(errno.EREMOTEIO))
        if len(write) >= 2:
            self._address = int.from_bytes(write[:2], "big") % self.SIZE
        if len(write) > 2:
            self._write(write[2:])
        found = bytes(self.memory[(self._address + place) % self.SIZE] for place in range(read))
        self._address = (self._address + read) % self.SIZE
        return found

    def held(self) -> bytes:
        return bytes(self.memory)

    def hold(self, octets: bytes) -> None:
        self.memory[:] = octets

    def _write(self, octets: bytes) -> None:
        self._unanswered = self._busy
        page = self._address - self._address % self.PAGE
        for place, octet in enumerate(octets, self._address):
            if not self.is_protected:
                self.memory[page + place % self.PAGE] = octet  # the address wraps at the end of the page


def hat_image(vendor: str, product: str, product_id: int, product_ver: int, uuid: str) -> bytes:
    """Return the ID EEPROM of a HAT, with only a vendor atom.

    Source: Raspberry Pi HAT ID EEPROM format specification, version 1.
    """
    names = vendor.encode(), product.encode()
    serial = bytes.fromhex(uuid.replace("-", ""))[::-1]
    data = struct.pack("<16sHHBB", serial, product_id, product_ver, *map(len, names)) + b"".join(names)
    atom = struct.pack("<HHI", 1, 0, len(data) + 2) + data
    atom += _crc(atom).to_bytes(2, "little")
    return b"R-Pi" + struct.pack("<BxHI", 1, 1, 12 + len(atom)) + atom


def _crc(octets: bytes) -> int:
    """Return the specification's CRC, computed by a shift register. The bits of each octet enter it lowest first."""
    register = 0
    bits = [octet >> bit & 1 for octet in (*octets, 0, 0) for bit in range(8)]
    for bit in bits:
        carry = register >> 15
        register = (register << 1 | bit) & 0xFFFF ^ (0x8005 if carry else 0)
    return int(f"{register:016b}"[::-1], 2)


def _signed(units: float, most: int) -> int:
    return max(-most - 1, min(most, round(units)))
