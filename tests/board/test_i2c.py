"""A bus by the ioctls that the kernel sees: one combined transaction per access, and what its errors mean."""

import ctypes
import errno
import os

import pytest
import smbus2.smbus2 as library

import board.i2c
from board.i2c import Bus
from board.runtime.errors import InterfaceError

EVERYTHING = 0x0EFF0009  # I2C and all of SMBus but quick commands, as i2c-bcm2835 has it
SMBUS_ONLY = 0x0EFF0008


class Kernel:
    """ioctl(2) of i2c-dev: writes down what it is given, and answers reads with 1, 2, 3 ..."""

    def __init__(self):
        self.functions = EVERYTHING
        self.transactions = []
        self.addresses = []
        self.failures = {}  # errno by ioctl

    def ioctl(self, descriptor, request, argument):
        if request in self.failures:
            raise OSError(self.failures[request], os.strerror(self.failures[request]))
        match request:
            case library.I2C_FUNCS:
                argument.value = self.functions
            case library.I2C_SLAVE:
                self.addresses.append(argument)
            case library.I2C_RDWR:
                self.transactions.append([self._message(argument.msgs[i]) for i in range(argument.nmsgs)])
            case library.I2C_SMBUS:
                self.transactions.append(self._smbus(argument))
            case _:
                raise AssertionError(hex(request))

    def _message(self, message):
        if message.flags & library.I2C_M_RD:
            ctypes.memmove(message.buf, bytes(place % 256 for place in range(1, message.len + 1)), message.len)
            return ("read", message.addr, message.len)
        return ("write", message.addr, bytes(message))

    def _smbus(self, argument):
        """The union holds a word, or a block behind its length, which is given for reads too."""
        block = argument.data.contents.block
        is_block = argument.size == library.I2C_SMBUS_I2C_BLOCK_DATA
        sent = bytes(block[: 1 + block[0]]) if is_block else argument.data.contents.word
        if argument.read_write == library.I2C_SMBUS_WRITE:
            return ("write", argument.command, argument.size, sent)
        first = 1 if is_block else 0
        block[first : first + 32] = list(range(1, 33))
        return ("read", argument.command, argument.size)


@pytest.fixture
def kernel(monkeypatch):
    kernel = Kernel()
    monkeypatch.setattr(library, "ioctl", kernel.ioctl)
    monkeypatch.setattr(board.i2c, "ioctl", kernel.ioctl)
    return kernel


@pytest.fixture
def open_bus(kernel, tmp_path):
    buses = []

    def open_bus(**kernel_has):
        vars(kernel).update(kernel_has)
        (tmp_path / "i2c-1").touch()
        buses.append(Bus(str(tmp_path / "i2c-1"), tmp_path))
        return buses[-1]

    yield open_bus
    for bus in buses:
        bus.close()


def test_a_write_and_a_read_are_one_transaction(open_bus, kernel):
    assert open_bus().transfer(0x50, b"\x01\x20", 3) == b"\1\2\3"
    assert kernel.transactions == [[("write", 0x50, b"\x01\x20"), ("read", 0x50, 3)]]


@pytest.mark.parametrize(("write", "read", "messages"), [
    (b"\2\xff", 0, [("write", 0x20, b"\2\xff")]),
    (b"", 1, [("read", 0x20, 1)]),
    (b"\0" * 34, 0, [("write", 0x20, b"\0" * 34)]),
    (b"\0\0", 600, [("write", 0x20, b"\0\0"), ("read", 0x20, 600)]),
])  # fmt: skip
def test_a_write_or_a_read_alone_is_one_message(open_bus, kernel, write, read, messages):
    assert len(open_bus().transfer(0x20, write, read)) == read
    assert kernel.transactions == [messages]


def test_the_kernel_is_asked_each_time_whether_the_chip_is_its_own(open_bus, kernel):
    bus = open_bus()
    bus.transfer(0x40, b"\0", 2)
    bus.transfer(0x48, b"\0", 2)
    assert kernel.addresses == [0x40, 0x48]


@pytest.mark.parametrize(("write", "read", "transaction"), [
    (b"", 1, ("read", 0, library.I2C_SMBUS_BYTE)),
    (b"\5", 0, ("write", 5, library.I2C_SMBUS_BYTE, 0)),
    (b"\5", 1, ("read", 5, library.I2C_SMBUS_BYTE_DATA)),
    (b"\5", 2, ("read", 5, library.I2C_SMBUS_WORD_DATA)),
    (b"\5", 3, ("read", 5, library.I2C_SMBUS_I2C_BLOCK_DATA)),
    (b"\5\xab", 0, ("write", 5, library.I2C_SMBUS_BYTE_DATA, 0xAB)),
    (b"\5\x12\x34", 0, ("write", 5, library.I2C_SMBUS_WORD_DATA, 0x3412)),
    (b"\5\1\2\3", 0, ("write", 5, library.I2C_SMBUS_I2C_BLOCK_DATA, b"\3\1\2\3")),
])  # fmt: skip
def test_an_adapter_of_smbus_alone_is_given_the_same_octets(open_bus, kernel, write, read, transaction):
    found = open_bus(functions=SMBUS_ONLY).transfer(0x20, write, read)
    assert kernel.transactions == [transaction]
    assert found == bytes(range(1, read + 1))


@pytest.mark.parametrize(("write", "read"), [(b"\0\0", 32), (b"\0", 33), (b"\0" * 34, 0), (b"", 2)])
def test_what_smbus_cannot_do_is_refused_and_nothing_is_sent(open_bus, kernel, write, read):
    with pytest.raises(InterfaceError, match=r"0x50 on .*i2c-1: the adapter does not support this transfer"):
        open_bus(functions=SMBUS_ONLY).transfer(0x50, write, read)
    assert kernel.transactions == []


@pytest.mark.parametrize(("number", "message", "hint"), [
    (errno.EREMOTEIO, "no answer from 0x40 on {path}", "i2cdetect -y -r 1"),
    (errno.ENXIO, "no answer from 0x40 on {path}", "fitted and powered"),
    (errno.ETIMEDOUT, "0x40 on {path}: the bus is stuck", "SDA or SCL is low"),
    (errno.EIO, "0x40 on {path}: the transfer failed: Input/output error", "pull-ups"),
    (errno.EAGAIN, "0x40 on {path}: the transfer failed: Resource temporarily unavailable", "pull-ups"),
    (errno.EINVAL, "0x40 on {path}: the transfer failed: Invalid argument", ""),
])  # fmt: skip
def test_an_error_names_chip_and_bus_and_says_what_to_do(open_bus, kernel, number, message, hint):
    bus = open_bus(failures={library.I2C_RDWR: number})
    with pytest.raises(InterfaceError) as caught:
        bus.transfer(0x40, b"\0", 2)
    assert caught.value.message == message.format(path=bus.path)
    assert hint in caught.value.hint


def test_chip_that_the_kernel_drives_is_refused_untouched_with_driver_and_hwmon(open_bus, kernel, tmp_path):
    device = tmp_path / "bus/i2c/devices/1-0040"
    (device / "hwmon/hwmon3").mkdir(parents=True)
    (device / "hwmon/hwmon3/name").write_text("ina226\n")
    (tmp_path / "ina2xx").mkdir()
    (device / "driver").symlink_to(tmp_path / "ina2xx")
    bus = open_bus(failures={library.I2C_SLAVE: errno.EBUSY})
    with pytest.raises(InterfaceError, match=r"0x40 on .* is in use by the kernel's driver ina2xx") as caught:
        bus.transfer(0x40, b"\0", 2)
    assert 'hwmon = "ina226"' in caught.value.hint
    assert kernel.transactions == []


def test_a_chip_that_the_kernel_has_without_saying_more_is_said(open_bus):
    with pytest.raises(InterfaceError, match=r"0x20 on .* is in use by the kernel") as caught:
        open_bus(failures={library.I2C_SLAVE: errno.EBUSY}).transfer(0x20, b"\0", 2)
    assert "gpiochip" in caught.value.hint


@pytest.mark.parametrize(("number", "hint"), [(errno.EACCES, "adduser USER i2c"), (errno.ENXIO, "i2cdetect -l")])
def test_a_bus_that_cannot_be_opened_is_named(monkeypatch, number, hint):
    def refuse(*_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(library.os, "open", refuse)
    with pytest.raises(InterfaceError, match="/dev/i2c-1: ") as caught:
        Bus("/dev/i2c-1")
    assert hint in caught.value.hint


def test_a_bus_that_is_not_there_is_said_with_how_a_pi_gets_it(tmp_path):
    with pytest.raises(InterfaceError, match="i2c-9: No such file or directory") as caught:
        Bus(str(tmp_path / "i2c-9"))
    assert "dtparam=i2c_arm=on" in caught.value.hint


def test_a_file_that_is_no_bus_is_refused(tmp_path):
    (tmp_path / "i2c-9").touch()
    with pytest.raises(InterfaceError, match="i2c-9: Inappropriate ioctl for device"):
        Bus(str(tmp_path / "i2c-9"))


def test_a_closed_bus_says_so(open_bus):
    bus = open_bus()
    bus.close()
    bus.close()
    with pytest.raises(InterfaceError, match="Bad file descriptor"):
        bus.transfer(0x40, b"\0", 2)
