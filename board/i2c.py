"""An I2C bus of the kernel: one combined transaction per access. It blocks, so only the worker has one."""

import errno
import os
from fcntl import ioctl
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from board import sysfs
from board.errors import InterfaceError

if TYPE_CHECKING:
    from smbus2 import SMBus

I2C_SLAVE = 0x0703  # ioctl(2) of i2c-dev: choose an address; EBUSY where a kernel driver has it

# How adapters say that nobody answered: bcm2835 with EREMOTEIO, most others with ENXIO, i2c-stub with ENODEV.
NO_ANSWER = (errno.EREMOTEIO, errno.ENXIO, errno.ENODEV)

BLOCK = 32  # octets: the longest block of SMBus


class Transfer(Protocol):
    """A bus as the chips see it.

    path  names it in errors.
    """

    path: str

    def transfer(self, address: int, write: bytes, read: int) -> bytes:
        """Write octets, then read so many, between one start and one stop. Raises InterfaceError."""


class Bus:
    """A bus by the path of its device, /dev/i2c-1; open until close()."""

    def __init__(self, path: str, sys: Path = Path("/sys")) -> None:
        """Raises InterfaceError when it is absent, no I2C bus, or not permitted."""
        from smbus2 import I2cFunc, SMBus

        self.path = path
        self._sys = sys
        try:
            self._bus = SMBus(path)
        except OSError as error:
            raise InterfaceError(f"{path}: {os.strerror(error.errno or 0)}", _remedy_of_open(error)) from error
        self._is_smbus_only = not self._bus.funcs & I2cFunc.I2C

    def transfer(self, address: int, write: bytes, read: int) -> bytes:
        try:
            # I2C_RDWR does not ask whether the kernel itself uses the chip; two who talk to it confuse each other.
            ioctl(self._descriptor, I2C_SLAVE, address)
            if self._is_smbus_only:
                return _by_smbus(self._bus, address, write, read)
            return self._combined(address, write, read)
        except OSError as error:
            raise explained(error, address, self.path, self._sys) from error

    def close(self) -> None:
        """Idempotent."""
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
    """What the kernel says of a transfer, in words.

    path  of the bus; sys  where the kernel tells which of its drivers has the chip.
    """
    number = error.errno or 0
    what = f"0x{address:02x} on {path}"
    if number in NO_ANSWER:
        hint = f"is the chip fitted and powered? `i2cdetect -y -r {_number(path)}` shows who answers"
        return InterfaceError(f"no answer from {what}", hint)
    if number == errno.ETIMEDOUT:
        hint = "SDA or SCL is held low: cut the power of the board, then look at its pull-ups"
        return InterfaceError(f"{what}: the bus is stuck", hint)
    if number == errno.EBUSY:
        return _in_use(address, path, sys)
    if number == errno.EOPNOTSUPP:
        return InterfaceError(f"{what}: the adapter cannot do such a transfer", "it knows SMBus alone: use another bus")
    hint = "look at wires, pull-ups and bus speed" if number in (errno.EIO, errno.EAGAIN) else ""
    return InterfaceError(f"{what}: the transfer failed: {os.strerror(number)}", hint)


def _in_use(address: int, path: str, sys: Path) -> InterfaceError:
    """The kernel has a driver for the chip: its name, and that of the hwmon device to read instead."""
    device = sys / "bus/i2c/devices" / f"{_number(path)}-{address:04x}"
    driver = device / "driver"
    user = f"the kernel's driver {driver.resolve().name}" if driver.exists() else "the kernel"
    names = [sysfs.optional(found) for found in device.glob("hwmon/hwmon*/name")]
    hint = (
        f'give hwmon = "{names[0]}" in the board file' if names else "give the line its gpiochip, a sensor its hwmon,"
    )
    return InterfaceError(f"0x{address:02x} on {path} is in use by {user}", f"{hint} in place of bus and address")


def _number(path: str) -> str:
    """1 of /dev/i2c-1."""
    return path.rpartition("-")[2]


def _remedy_of_open(error: OSError) -> str:
    if error.errno in (errno.EACCES, errno.EPERM):
        return "add the user to the group i2c: `sudo adduser USER i2c`"
    if error.errno == errno.ENOENT:
        return "`i2cdetect -l` lists buses; on a Pi, dtparam=i2c_arm=on (and i2c_vc=on) in config.txt gives them"
    return "`i2cdetect -l` lists buses"


def _by_smbus(bus: "SMBus", address: int, write: bytes, read: int) -> bytes:
    """The same octets on the wire, where an adapter or i2c-stub knows the transfers of SMBus alone.

    Raises OSError(EOPNOTSUPP) for those that SMBus has not: a read after more than one octet, long blocks.
    """
    match len(write), read:
        case 0, 1:
            return bytes([bus.read_byte(address)])
        case 1, 0:
            bus.write_byte(address, write[0])
        case 1, 1:
            return bytes([bus.read_byte_data(address, write[0])])
        case 1, 2:
            return bus.read_word_data(address, write[0]).to_bytes(2, "little")  # its first octet is the low one
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
