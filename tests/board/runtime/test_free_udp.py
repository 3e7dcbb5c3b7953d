"""Free UDP ports: unused, and reserved until they are opened."""

import errno
import socket

import pytest

from board.runtime import free_udp as module
from board.runtime.address import Address
from board.runtime.free_udp import free_udp

LOOPBACK = "127.0.0.1"


@pytest.fixture
def given(tmp_path, monkeypatch):
    """Has the kernel give programs these ports, by its word."""

    def given(first, last):
        monkeypatch.setattr(module, "GIVEN", tmp_path / "range")
        module.GIVEN.write_text(f"{first}\t{last}\n")

    return given


def test_none_is_one_that_the_kernel_gives_to_programs(given):
    given(32_768, 60_999)
    found = free_udp(LOOPBACK, 50)
    assert len(set(found)) == 50
    assert {place.host for place in found} == {LOOPBACK}
    assert all(10_000 <= place.port < 32_768 for place in found)


def test_they_are_any_where_the_kernel_gives_nearly_all(given):
    given(1024, 65_535)
    assert len(set(free_udp(LOOPBACK, 4))) == 4


def test_one_that_somebody_has_is_passed_over(monkeypatch):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind((LOOPBACK, 0))
        port = taken.getsockname()[1]
        ways = [Address(LOOPBACK, port), *free_udp(LOOPBACK, 1)]
        monkeypatch.setattr(module, "_places", lambda host: iter(ways))
        assert free_udp(LOOPBACK, 1) == ways[1:]


def test_none_left_is_a_failure(monkeypatch):
    ways = free_udp(LOOPBACK, 1)
    monkeypatch.setattr(module, "_places", lambda host: iter(ways))
    with pytest.raises(OSError, match="Address already in use") as refused:
        free_udp(LOOPBACK, 2)
    assert refused.value.errno == errno.EADDRINUSE


def test_a_host_that_is_not_this_machines_is_a_failure_of_its_own(monkeypatch):
    class Elsewhere(socket.socket):
        def bind(self, place):
            raise OSError(errno.EADDRNOTAVAIL, "Cannot assign requested address")

    monkeypatch.setattr(module.socket, "socket", Elsewhere)
    with pytest.raises(OSError, match="Cannot assign requested address"):
        free_udp("203.0.113.1", 1)
