"""I2C bus: one combined transaction per access; blocks, so only for the board process."""

import errno
import os
from fcntl import ioctl
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from board import sysfs
from board.runtime.errors import InterfaceError

if TYPE_CHECKING:
    from smbus2 import SMBus

I2C_SLAVE = 0x0703  # ioctl(2) of i2c-dev: selects an address; EBUSY if a kernel driver uses the chip

# Errors of adapters when no chip answers: EREMOTEIO from bcm2835, ENXIO from most others, ENODEV from i2c-stub.
NO_ANSWER = (errno.EREMOTEIO, errno.ENXIO, errno.ENODEV)

BLOCK = 32  # octets of the longest SMBus block


class Transfer(Protocol):
    """Bus as the functions of the chips use it.

    path  name of the bus in errors.
    """

    path: str

    def transfer(self, address: int, write: bytes, read: int) -> bytes:
        """Write octets, then read `read` octets, between one start and one stop condition.

        Raises InterfaceError if the chip does not answer or the adapter fails.
        """


def read_word(bus: Transfer, address: int, register: int) -> int:
    """Return 16 bits of a register, high octet first. Raises InterfaceError if the chip or the adapter fails."""
    return int.from_bytes(bus.transfer(address, bytes([register]), 2), "big")


class Bus:
    """I2C bus of the kernel by its device, such as /dev/i2c-1; open until close()."""

    def __init__(self, path: str, sys: Path = Path("/sys")) -> None:
        """Open the bus. Raises InterfaceError if it is absent, not an I2C bus, or not permitted."""
        from smbus2 import I2cFunc, SMBus

        self.path = path
        self._sys = sys
        try:
            self._bus = SMBus(path)
        except OSError as error:
            raise InterfaceError(f"{path}: {os.strerror(error.errno or 0)}", _remedy_of_open(error)) from error
        self._is_smbus_only = not self._bus.funcs & I2cFunc.I2C

    def transfer(self, address: int, write: bytes, read: int) -> bytes:
        """Write, then read, in one transaction. Raises InterfaceError if the chip or the adapter fails."""
        try:
            # I2C_RDWR does not check for a kernel driver of the chip; two users of one chip would disturb each other.
            ioctl(self._descriptor, I2C_SLAVE, address)
            if self._is_smbus_only:
                return _by_smbus(self._bus, address, write, read)
            return self._combined(address, write, read)
        except OSError as error:
            raise explained(error, address, self.path, self._sys) from error

    def close(self) -> None:
        """Close the bus; idempotent."""
        self._bus.close()

    @property
    def _descriptor(self) -> int:
        descriptor: int | None = self._bus.fd
        if descriptor is None:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        return descriptor

    def _combined(self, address: int, write: bytes, read: int) -> bytes:
        from smbus2 import i2c_msg

        messages = [i2c_msg.write(address, write)] if write or not read else []
        if read:
            messages.append(i2c_msg.read(address, read))
        self._bus.i2c_rdwr(*messages)
        return bytes(messages[-1]) if read else b""


def explained(error: OSError, address: int, path: str, sys: Path = Path("/sys")) -> InterfaceError:
    """Return the InterfaceError for an error of a transfer, with its cause and a remedy.

    path  device of the bus.
    sys   root of sysfs, which names the kernel driver of the chip.
    """
    number = error.errno or 0
    what = f"0x{address:02x} on {path}"
    if number in NO_ANSWER:
        hint = f"check that the chip is fitted and powered: `i2cdetect -y -r {_number(path)}`"
        return InterfaceError(f"no answer from {what}", hint)
    if number == errno.ETIMEDOUT:
        hint = "SDA or SCL is low: switch the board off and on, then check its pull-ups"
        return InterfaceError(f"{what}: the bus is stuck", hint)
    if number == errno.EBUSY:
        return _in_use(address, path, sys)
    if number == errno.EOPNOTSUPP:
        hint = "it supports SMBus only: use another bus"
        return InterfaceError(f"{what}: the adapter does not support this transfer", hint)
    hint = "check wires, pull-ups and bus speed" if number in (errno.EIO, errno.EAGAIN) else ""
    return InterfaceError(f"{what}: the transfer failed: {os.strerror(number)}", hint)


def _in_use(address: int, path: str, sys: Path) -> InterfaceError:
    """Return the error for a chip in use by the kernel; it names the driver, and the hwmon device to read instead."""
    device = sys / "bus/i2c/devices" / f"{_number(path)}-{address:04x}"
    driver = device / "driver"
    user = f"the kernel's driver {driver.resolve().name}" if driver.exists() else "the kernel"
    names = [sysfs.optional(found) for found in device.glob("hwmon/hwmon*/name")]
    hint = f'give hwmon = "{names[0]}" in the board file' if names else "name the line's gpiochip or the sensor's hwmon"
    return InterfaceError(f"0x{address:02x} on {path} is in use by {user}", f"{hint} in place of bus and address")


def _number(path: str) -> str:
    """Return the number of a bus: 1 for /dev/i2c-1."""
    return path.rpartition("-")[2]


def _remedy_of_open(error: OSError) -> str:
    if error.errno in (errno.EACCES, errno.EPERM):
        return "add the user to the group i2c: `sudo adduser USER i2c`"
    if error.errno == errno.ENOENT:
        return "`i2cdetect -l` lists buses; on a Pi, dtparam=i2c_arm=on (and i2c_vc=on) in config.txt gives them"
    return "`i2cdetect -l` lists buses"


def _by_smbus(bus: "SMBus", address: int, write: bytes, read: int) -> bytes:
    """Transfer the same octets by SMBus calls, for adapters and i2c-stub, which support nothing else.

    Raises OSError(EOPNOTSUPP) for transfers that SMBus lacks: a read after more than one octet, or long blocks.
    """
    match len(write), read:
        case 0, 1:
            return bytes([bus.read_byte(address)])
        case 1, 0:
            bus.write_byte(address, write[0])
        case 1, 1:
            return bytes([bus.read_byte_data(address, write[0])])
        case 1, 2:
            return bus.read_word_data(address, write[0]).to_bytes(2, "little")  # SMBus sends the low octet first
        case 1, length if length <= BLOCK:
            return bytes(bus.read_i2c_block_data(address, write[0], length))
        case 2, 0:
            bus.write_byte_data(address, write[0], write[1])
        case 3, 0:
            bus.write_word_data(address, write[0], int.from_bytes(write[1:], "little"))
        case length, 0 if 3 < length <= BLOCK + 1:
            bus.write_i2c_block_data(address, write[0], list(write[1:]))
        case _:
            raise OSError(errno.EOPNOTSUPP, os.strerror(errno.EOPNOTSUPP))
    return b""
