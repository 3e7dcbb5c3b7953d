"""An MCP2221, a bridge from USB HID to I2C, played by a program at /dev/uhid: the kernel's driver makes a bus of it.

Sources: DS20005565 (reports), the kernel's include/uapi/linux/uhid.h and drivers/hid/hid-mcp2221.c.
"""

import os
import struct
import threading
from pathlib import Path

from board.i2c import Transfer
from board.runtime.errors import InterfaceError
from tests.proof.kernel.checks.kernel import load

VENDOR, PRODUCT, BUS_USB = 0x04D8, 0x00DD, 3
REPORT = 64  # octets, both ways, without a number
DESCRIPTOR = bytes.fromhex("0600ff0901a101150026ff007508954009018102954009019102c0")

# enum uhid_event_type
DESTROY, STOP, OUTPUT, CREATE, INPUT = 1, 3, 6, 11, 12
CREATION = struct.Struct("<I128s64s64sHHIIII4096s")
EVENT = 4380  # octets: sizeof(struct uhid_event)

# Commands and answers of the bridge.
STATUS, GET_DATA = 0x10, 0x40
WRITE, READ, READ_AGAIN, WRITE_ON = 0x90, 0x91, 0x93, 0x94
SET_SPEED = 0x20
PART_READ, ALL_READ, NOT_ACKNOWLEDGED, NACK_BIT = 0x54, 0x55, 0x25, 0x40
CHUNK = 60  # octets of data in a report


class Mcp2221:
    """The bridge, and the chips behind it; gone at the end.

    transfers  address, octets written, and how many were read after them, of each transaction.
    """

    def __init__(self, chips: Transfer) -> None:
        load("uhid")
        load("hid-mcp2221")
        self.transfers: list[tuple[int, bytes, int]] = []
        self._chips = chips
        self._write = b""  # what is written before the read of the same transaction
        self._found: bytes | None = b""  # None: nobody has acknowledged
        self._device = os.open("/dev/uhid", os.O_RDWR | os.O_CLOEXEC)
        words = (b"MCP2221", b"", b"", len(DESCRIPTOR), BUS_USB, VENDOR, PRODUCT, 0, 0, DESCRIPTOR)
        os.write(self._device, CREATION.pack(CREATE, *words))
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def __enter__(self) -> "Mcp2221":
        return self

    def __exit__(self, *_: object) -> None:
        os.write(self._device, struct.pack("<I", DESTROY))
        self._thread.join()
        os.close(self._device)

    @property
    def path(self) -> str:
        """Of its bus; empty until the driver has made it."""
        found = (path for path in Path("/sys/bus/i2c/devices").glob("i2c-*") if _is_ours(path))
        return next((f"/dev/{path.name}" for path in found), "")

    def _serve(self) -> None:
        """Answer report by report until the driver lets go of the device (UHID_STOP)."""
        while (event := os.read(self._device, EVENT)) and (kind := int.from_bytes(event[:4], "little")) != STOP:
            if kind == OUTPUT:
                answer = self._obey(event[4 : 4 + REPORT]).ljust(REPORT, b"\0")
                os.write(self._device, struct.pack("<IH", INPUT, REPORT) + answer)

    def _obey(self, report: bytes) -> bytes:
        command, length, address = report[0], int.from_bytes(report[1:3], "little"), report[3] >> 1
        if command == STATUS:
            speed = SET_SPEED if report[3] == SET_SPEED else 0
            nack = NACK_BIT if self._found is None and not report[2] else 0
            if report[2]:  # the last transaction is given up
                self._found = b""
            return bytes([STATUS, 0, 0, speed]) + bytes(16) + bytes([nack])
        if command == GET_DATA:
            if self._found is None:
                return bytes([GET_DATA, 0, NOT_ACKNOWLEDGED])
            now, self._found = self._found[:CHUNK], self._found[CHUNK:]
            return bytes([GET_DATA, 0, PART_READ if self._found else ALL_READ, len(now)]) + now
        if command == WRITE_ON:
            self._write = report[4 : 4 + length]
        elif command == WRITE:
            self._transfer(address, report[4 : 4 + length], 0)
        elif command in (READ, READ_AGAIN):
            write, self._write = self._write, b""
            self._transfer(address, write, length)
        return bytes([command, 0])

    def _transfer(self, address: int, write: bytes, read: int) -> None:
        self.transfers.append((address, write, read))
        try:
            self._found = self._chips.transfer(address, write, read)
        except InterfaceError:
            self._found = None


def _is_ours(path: Path) -> bool:
    return (path / "name").read_text().startswith("MCP2221")
