"""A serial port that goes while it is being opened, or cannot be."""

import os
import pty
import termios
from collections.abc import Iterator
from typing import NoReturn

import pytest

from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop
from board.serial import SerialPort
from tests.virtual import VirtualLoop


@pytest.fixture
def path() -> Iterator[str]:
    master, slave = pty.openpty()
    yield os.ttyname(slave)
    os.close(master)
    os.close(slave)


def opened(loop: Loop, path: str) -> SerialPort:
    return SerialPort(loop, path, 115200, lambda octets: None, lambda error: None, lambda: None)


def unplugged(*_: object) -> NoReturn:
    raise termios.error(5, "Input/output error")


@pytest.mark.parametrize("call", ["tcgetattr", "tcsetattr", "tcflush"])
def test_a_port_that_goes_while_it_is_opened_is_absent_and_leaves_no_descriptor(
    loop: VirtualLoop, path: str, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    before = len(os.listdir("/proc/self/fd"))
    with monkeypatch.context() as patched:
        patched.setattr(termios, call, unplugged)
        with pytest.raises(InterfaceError, match=rf"(?i)^{path}: .*input/output error"):
            opened(loop, path)
    assert len(os.listdir("/proc/self/fd")) == before
    opened(loop, path).close()
