"""Addresses as the kernel tells them, beside what iproute2 reads of the same answer."""

import json
import shutil
import socket
import struct
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware.console.addresses import _dump, addresses, devices, is_open

# One message of RTM_GETADDR's answer on a Debian 12 machine, and one of a point-to-point device, made after it.
ETH0 = struct.pack("=IHHIIBBBBI", 40, 20, 2, 1, 0, 2, 24, 0, 0, 2) + struct.pack(
    "=HH4sHH4s", 8, 1, bytes([192, 168, 1, 20]), 8, 2, bytes([192, 168, 1, 20])
)
WWAN0 = struct.pack("=IHHIIBBBBI", 40, 20, 2, 1, 0, 2, 30, 0, 0, 5) + struct.pack(
    "=HH4sHH4s", 8, 1, bytes([10, 64, 1, 1]), 8, 2, bytes([10, 64, 1, 2])
)
# With the device's name in front: 9 octets, and three that fill the word.
USB0 = struct.pack("=IHHIIBBBBI", 44, 20, 2, 1, 0, 2, 24, 0, 0, 6) + struct.pack(
    "=HH5s3xHH4s", 9, 3, b"usb0\0", 8, 2, bytes([192, 168, 7, 2])
)
LINK = struct.pack("=IHHIIBBBBI", 44, 20, 2, 1, 0, 10, 64, 0, 253, 2) + struct.pack(
    "=HH16s", 20, 1, socket.inet_pton(socket.AF_INET6, "fe80::1")
)


def test_addresses_are_those_of_this_end_and_the_widest_reach_comes_first() -> None:
    assert addresses(LINK + ETH0 + WWAN0 + USB0) == {
        2: ["192.168.1.20/24", "fe80::1/64"],
        5: ["10.64.1.2/30"],
        6: ["192.168.7.2/24"],
    }


@given(octets=st.binary(max_size=200), at=st.integers(0, 120))
def test_whatever_answers_is_read_without_harm(octets: bytes, at: int) -> None:
    whole = ETH0 + WWAN0 + LINK
    for answer in (octets, whole[:at] + octets + whole[at:], whole[:at]):
        assert all(isinstance(text, str) for found in addresses(answer).values() for text in found)


def test_iproute2_reads_the_same() -> None:
    ip = shutil.which("ip")
    assert ip is not None, "make setup-test installs iproute2"
    told = json.loads(subprocess.run([ip, "-j", "addr"], capture_output=True, check=True).stdout)
    theirs = {
        one["ifindex"]: {f"{info['local']}/{info['prefixlen']}" for info in one["addr_info"]}
        for one in told
        if one["addr_info"]
    }
    assert {number: set(found) for number, found in addresses(_dump()).items()} == theirs


def test_devices_are_all_but_the_loopback_those_with_addresses_first() -> None:
    names = [one.name for one in devices()]
    assert set(names) == {path.name for path in Path("/sys/class/net").iterdir()} - {"lo"}
    having = [bool(one.addresses) for one in devices()]
    assert having == sorted(having, reverse=True)


def test_without_sys_there_are_no_devices(tmp_path: Path) -> None:
    assert devices(tmp_path) == []


HEAD = "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode\n"


@pytest.mark.parametrize(
    ("table", "local", "state", "expected"),
    [
        ("tcp", "00000000:15B3", "0A", True),
        ("tcp", "1401A8C0:15B3", "0A", True),  # 192.168.1.20
        ("tcp", "0100007F:15B3", "0A", False),  # 127.0.0.1
        ("tcp", "00000000:15B3", "01", False),  # a connection
        ("tcp", "00000000:15B4", "0A", False),  # another port
        ("tcp6", "00000000000000000000000000000000:15B3", "0A", True),
        ("tcp6", "00000000000000000000000001000000:15B3", "0A", False),  # ::1
        ("tcp6", "0000000000000000FFFF00000100007F:15B3", "0A", False),  # ::ffff:127.0.0.1
    ],
)
def test_a_port_is_open_when_more_than_the_loopback_is_listened_to(
    tmp_path: Path, table: str, local: str, state: str, expected: bool
) -> None:
    (tmp_path / "proc/net").mkdir(parents=True)
    (tmp_path / "proc/net" / table).write_text(
        f"{HEAD}   0: {local} 00000000:0000 {state} 00000000:00000000 00:0 0 0\n"
    )
    assert is_open(5555, tmp_path) is expected


@pytest.mark.parametrize(("address", "expected"), [("127.0.0.1", False), ("0.0.0.0", True)])
def test_the_kernel_says_it_of_a_socket_of_ours(address: str, expected: bool) -> None:
    with socket.socket() as listener:
        listener.bind((address, 0))
        listener.listen()
        assert is_open(listener.getsockname()[1]) is expected
