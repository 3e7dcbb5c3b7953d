"""Ptys: virtual time waits for octets in transit in a pty, and only for these."""

import os
from collections.abc import Iterator
from contextlib import closing
from typing import NamedTuple

import pytest

from board.runtime.loop import READ
from drivers.sim.tty_end import TtyEnd
from tests.ptys import PtyLoop, Ptys


class Port:
    """End of a pty that the station has open."""

    def __init__(self, loop: PtyLoop, path: str) -> None:
        self.descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        self.heard = b""
        self.loop = loop
        loop.add(self)
        loop.want(self, READ)

    def fileno(self) -> int:
        return self.descriptor

    def ready(self, events: int) -> None:
        self.heard += os.read(self.descriptor, 4096)

    def close(self) -> None:
        self.loop.remove(self)
        os.close(self.descriptor)


class Pair(NamedTuple):
    loop: PtyLoop
    module: TtyEnd
    heard: list[bytes]


@pytest.fixture
def pair(monkeypatch: pytest.MonkeyPatch) -> Iterator[Pair]:
    with closing(PtyLoop(Ptys(monkeypatch))) as loop:
        heard: list[bytes] = []
        module = TtyEnd(loop, heard.append)
        module.open()
        yield Pair(loop, module, heard)
        module.close()


def test_what_is_said_by_either_end_arrives_before_the_clock_goes_on(pair: Pair) -> None:
    loop, module, heard = pair
    with closing(Port(loop, module.path)) as port:
        for number in range(100):
            module.say(b"%d\n" % number)
            os.write(port.descriptor, b"%d\n" % number)
            loop.after(1e-6, lambda: None)
            began = loop.now
            while loop.now == began:
                loop.turn()
            assert port.heard.endswith(b"%d\n" % number)
            assert b"".join(heard).endswith(b"%d\n" % number)
        assert not loop.ptys.is_carrying()


def test_what_nobody_has_open_is_not_waited_for(pair: Pair) -> None:
    pair.module.say(b"to nobody")
    assert not pair.loop.ptys.is_carrying()


@pytest.mark.parametrize("closes", ["port", "module"])
def test_what_was_under_way_when_an_end_is_closed_is_not_waited_for(pair: Pair, closes: str) -> None:
    loop, module, _ = pair
    port = Port(loop, module.path)
    module.say(b"down")
    os.write(port.descriptor, b"up")
    assert loop.ptys.is_carrying()
    if closes == "port":
        port.close()
        assert not loop.ptys.is_carrying()
    else:
        module.close()
        assert not loop.ptys.is_carrying()
        port.close()


def test_what_does_not_come_is_lost_once_and_the_clock_goes_on(pair: Pair) -> None:
    loop, module, _ = pair
    port = os.open(module.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)  # open, but never read
    module.say(b"unread")
    loop.run_for(1.0)
    assert not loop.ptys.is_carrying()
    os.close(port)
