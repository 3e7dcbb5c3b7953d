"""The block server, spoken to as QEMU does: newstyle handshake, requests, and no answer once the power is cut."""

import socket
import struct
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as some

from tests.proof.image.drive import (
    ACK,
    ANSWER,
    ANSWER_MAGIC,
    DISCONNECT,
    EXPORT_NAME,
    FLUSH,
    FUA,
    GO,
    INVALID,
    MAGIC,
    OPTION,
    READ,
    REQUEST,
    REQUEST_MAGIC,
    TOLD,
    UNSUPPORTED,
    WRITE,
    ZEROES,
    Drive,
    served,
)
from tests.proof.image.medium import SECTOR, Fate

SIZE = 64 * SECTOR
ONE, TWO = b"1" * SECTOR, b"2" * SECTOR
LIST = 3  # an option that the server does not know


class Client:
    """As little of one as the tests need. Source: NetworkBlockDevice/nbd, doc/proto.md."""

    def __init__(self, drive: Drive, option: int = GO) -> None:
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.settimeout(30)
        self._socket.connect(str(drive.url).removeprefix("nbd:unix:"))
        assert self.octets(18) == MAGIC + struct.pack(">QH", OPTION, 3)
        self._socket.sendall(struct.pack(">I", 3))
        if option == EXPORT_NAME:
            self._socket.sendall(struct.pack(">QII", OPTION, EXPORT_NAME, 0))
            self.size, self.flags = struct.unpack(">QH", self.octets(10))
            return
        told = self.option(option, struct.pack(">IH", 0, 0))
        self.size, self.flags = struct.unpack(">HQH", told[0])[1:]

    def option(self, option: int, octets: bytes = b"") -> list[bytes]:
        """What is told until the option is acknowledged."""
        self._socket.sendall(struct.pack(">QII", OPTION, option, len(octets)) + octets)
        told = []
        while True:
            _, of, kind, length = struct.unpack(">QIII", self.octets(20))
            assert of == option
            if kind == ACK:
                return told
            assert kind == TOLD, kind
            told.append(self.octets(length))

    def ask(self, kind: int, offset: int = 0, size: int = 0, octets: bytes = b"", flags: int = 0) -> None:
        self.send(REQUEST.pack(REQUEST_MAGIC, flags, kind, b"cookie..", offset, size or len(octets)) + octets)

    def answer(self, size: int = 0) -> tuple[int, bytes]:
        magic, error, cookie = ANSWER.unpack(self.octets(ANSWER.size))
        assert (magic, cookie) == (ANSWER_MAGIC, b"cookie..")
        return error, self.octets(size) if not error else b""

    def done(self, kind: int, offset: int = 0, size: int = 0, octets: bytes = b"", flags: int = 0) -> bytes:
        self.ask(kind, offset, size, octets, flags)
        error, found = self.answer(size if kind == READ else 0)
        assert error == 0
        return found

    def octets(self, size: int) -> bytes:
        found = b""
        while len(found) < size:
            part = self._socket.recv(size - len(found))
            if not part:
                raise ConnectionError
            found += part
        return found

    def send(self, octets: bytes) -> None:
        self._socket.sendall(octets)

    def close(self) -> None:
        self._socket.close()


@pytest.fixture
def drive(tmp_path: Path) -> Iterator[Drive]:
    card = tmp_path / "card"
    card.write_bytes(bytes(SIZE))
    with served(card, tmp_path, seed=1) as found:
        yield found


@pytest.fixture
def client(drive: Drive) -> Iterator[Client]:
    found = Client(drive)
    yield found
    found.close()


@pytest.mark.parametrize("option", [GO, EXPORT_NAME])
def test_it_says_how_large_it_is_and_that_it_can_flush_and_write_durably(drive: Drive, option: int):
    client = Client(drive, option)
    assert client.size == SIZE
    assert client.flags & 0b1101101 == 0b1101101
    client.done(WRITE, 0, octets=ONE)
    assert client.done(READ, 0, SECTOR) == ONE
    client.close()


def test_an_option_that_is_not_known_is_refused_and_the_next_one_is_taken(drive: Drive):
    other = socket.socket(socket.AF_UNIX)
    other.connect(str(drive.url).removeprefix("nbd:unix:"))
    assert len(other.recv(18)) == 18
    other.sendall(struct.pack(">I", 3) + struct.pack(">QII", OPTION, LIST, 0))
    assert struct.unpack(">QIII", other.recv(20))[1:3] == (LIST, UNSUPPORTED)
    other.sendall(struct.pack(">QII", OPTION, GO, 6) + bytes(6))
    assert struct.unpack(">QIII", other.recv(20))[1:3] == (GO, TOLD)
    other.close()


def test_what_was_flushed_is_there_after_a_cut_and_the_rest_is_gone(drive: Drive, client: Client):
    client.done(WRITE, 0, octets=ONE)
    client.done(FLUSH)
    client.done(WRITE, SECTOR, octets=TWO)
    client.done(WRITE, 2 * SECTOR, octets=TWO, flags=FUA)
    assert client.done(READ, 0, 3 * SECTOR) == ONE + TWO + TWO
    assert drive.cut(Fate.DROP).gone == 1
    client.close()
    client = Client(drive)
    assert client.done(READ, 0, 3 * SECTOR) == ONE + bytes(SECTOR) + TWO
    client.close()


def test_without_power_nobody_answers_and_nothing_is_written(drive: Drive, client: Client):
    drive.cut(Fate.KEEP)
    client.ask(WRITE, 0, octets=ONE, flags=FUA)
    client.ask(DISCONNECT)
    with pytest.raises(ConnectionError):
        client.answer()
    client = Client(drive)
    assert client.done(READ, 0, SECTOR) == bytes(SECTOR)
    client.close()


def test_the_power_goes_at_the_write_that_was_asked_for_before_it_is_answered(drive: Drive, client: Client):
    drive.arm(2, Fate.DROP)
    client.done(WRITE, 0, octets=ONE, flags=FUA)
    client.ask(WRITE, SECTOR, octets=TWO, flags=FUA)
    assert drive.is_cut.wait(30)
    client.close()
    client = Client(drive)
    assert not drive.is_cut.is_set()  # power is back with the connection
    assert client.done(READ, 0, 2 * SECTOR) == ONE + bytes(SECTOR)
    client.close()


def test_the_power_goes_at_a_write_to_a_place(drive: Drive, client: Client):
    drive.arm(1, Fate.KEEP, within=range(2 * SECTOR, 3 * SECTOR))
    client.done(WRITE, 0, octets=ONE)
    client.ask(WRITE, 2 * SECTOR, octets=TWO)
    assert drive.is_cut.wait(30)


def test_a_drive_that_is_not_honest_forgets_what_it_was_told_to_keep(tmp_path: Path):
    card = tmp_path / "other"
    card.write_bytes(bytes(SIZE))
    with served(card, tmp_path, seed=1, is_honest=False) as drive:
        client = Client(drive)
        client.done(WRITE, 0, octets=ONE, flags=FUA)
        client.done(FLUSH)
        assert drive.cut(Fate.DROP).gone == 1
        client.close()
    assert card.read_bytes() == bytes(SIZE)


def test_the_power_goes_at_a_flush_which_has_then_kept_nothing(drive: Drive, client: Client):
    drive.arm(1, Fate.DROP, FLUSH)
    client.done(WRITE, 0, octets=ONE)
    client.ask(FLUSH)
    assert drive.is_cut.wait(30)
    client.close()
    client = Client(drive)
    assert client.done(READ, 0, SECTOR) == bytes(SECTOR)
    client.close()


def test_zeros_are_written_and_octets_are_counted_by_their_place(drive: Drive, client: Client):
    client.done(WRITE, 0, octets=ONE * 4)
    client.done(ZEROES, SECTOR, 2 * SECTOR)
    assert client.done(READ, 0, 4 * SECTOR) == ONE + bytes(2 * SECTOR) + ONE
    assert drive.octets[0] == 4 * SECTOR
    assert drive.requests[WRITE] == drive.requests[ZEROES] == 1


@pytest.mark.parametrize(
    ("kind", "offset", "size"),
    [(READ, 1, SECTOR), (READ, 0, 100), (READ, SIZE, SECTOR), (ZEROES, 0, SIZE + SECTOR), (9, 0, 0)],
)
def test_a_request_that_makes_no_sense_is_refused_and_the_next_one_is_taken(
    client: Client, kind: int, offset: int, size: int
):
    client.ask(kind, offset, size)
    assert client.answer()[0] == INVALID
    assert client.done(READ, 0, SECTOR) == bytes(SECTOR)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(octets=some.binary(min_size=28, max_size=200))
def test_random_octets_end_a_connection_at_most(drive: Drive, octets: bytes):
    client = Client(drive)
    client.send(octets)
    client.close()
    client = Client(drive)
    assert client.size == SIZE
    client.close()
