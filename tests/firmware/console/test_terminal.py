"""The descriptor's side: what waits, what does not, and whose the terminal is."""

import fcntl
import os
import struct
import termios
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import pytest

from firmware.console import terminal as module
from firmware.console.terminal import RATE, STOPPED_S, Terminal
from tests.firmware.console.emulated import Emulated
from tests.virtual import VirtualLoop


class Desk:
    """A terminal of ours and the emulated one at its other end."""

    def __init__(self, loop: VirtualLoop, monkeypatch: pytest.MonkeyPatch) -> None:
        self.loop = loop
        self.typed: list[bytes] = []
        self.gone: list[bool] = []
        self.far = Emulated(loop)
        monkeypatch.setattr(module, "os", self.far.ours)
        loop.is_carrying = lambda: self.far.is_carrying
        self.near = Terminal(loop, self.far.slave, self.typed.append, lambda: self.gone.append(True))

    def close(self) -> None:
        self.near.close()
        self.far.close()


@pytest.fixture
def desk(loop: VirtualLoop, monkeypatch: pytest.MonkeyPatch) -> Iterator[Desk]:
    with closing(Desk(loop, monkeypatch)) as desk:
        yield desk


def test_octets_pass_both_ways_as_they_are(desk: Desk) -> None:
    desk.far.type(bytes(octet for octet in range(256) if octet not in (0x11, 0x13)))
    desk.near.draw(b"a\nb\r\nc")
    desk.loop.run_for(1.0)
    assert b"".join(desk.typed) == bytes(octet for octet in range(256) if octet not in (0x11, 0x13))
    assert desk.far.sent == b"a\nb\r\nc"


def test_a_frame_that_was_not_taken_waits_and_leaves_whole_when_it_can(desk: Desk) -> None:
    desk.far.stop()
    desk.far.fill()
    desk.near.draw(b"the frame")
    assert not desk.near.is_free
    desk.loop.run_for(STOPPED_S + 1)
    assert desk.near.is_stopped
    desk.far.go_on()
    desk.loop.run_until(lambda: desk.far.sent.endswith(b"the frame"))
    desk.loop.run_until(lambda: desk.near.is_free)
    assert not desk.near.is_stopped


def test_the_next_frame_has_to_wait_for_as_long_as_a_line_needs_for_this(desk: Desk) -> None:
    assert desk.near.is_free
    desk.near.draw(b"x" * 1000)
    desk.loop.run_for(1000 / RATE - 0.01)
    assert not desk.near.is_free
    desk.loop.run_for(0.02)
    assert desk.near.is_free


def test_what_the_kernel_has_still_to_send_is_waited_for(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    # A pty has sent everything at once: a serial port has up to 4 KB (tty_chars_in_buffer of the kernel).
    queued = [700]
    real = fcntl.ioctl

    def ioctl(descriptor: int, request: int, value: Any) -> Any:
        return struct.pack("i", queued[0]) if request == termios.TIOCOUTQ else real(descriptor, request, value)

    monkeypatch.setattr(module.fcntl, "ioctl", ioctl)
    assert not desk.near.is_free
    queued[0] = 0
    assert desk.near.is_free


def test_what_was_typed_while_it_was_lent_is_not_for_us(desk: Desk) -> None:
    before = termios.tcgetattr(desk.far.slave)
    desk.near.lend()
    lent = termios.tcgetattr(desk.far.slave)
    assert lent[3] & termios.ICANON
    os.write(desk.far.master, b"q\n")
    while not struct.unpack("i", fcntl.ioctl(desk.far.slave, termios.FIONREAD, bytes(4)))[0]:
        pass  # the kernel's thread passes it on
    desk.near.take()
    assert termios.tcgetattr(desk.far.slave) == before
    desk.loop.run_for(1.0)
    assert desk.typed == []
    desk.far.type(b"h")
    desk.loop.run_for(1.0)
    assert desk.typed == [b"h"]


@pytest.mark.parametrize("before", ["", "IGNBRK", "BRKINT", "IGNPAR", "PARMRK", "INPCK"])
def test_what_a_driver_sets_a_line_up_for_stays_as_it_was(loop: VirtualLoop, before: str) -> None:
    # iflag_mask, cflag and speeds of uart_set_termios of Linux' serial_core.c. BRKINT, which makes signals, may go.
    kept = termios.IGNBRK | termios.IGNPAR | termios.PARMRK | termios.INPCK
    with closing(Emulated(loop)) as far:
        modes = termios.tcgetattr(far.slave)
        modes[0] = modes[0] & ~(kept | termios.BRKINT) | getattr(termios, before, 0)
        termios.tcsetattr(far.slave, termios.TCSANOW, modes)
        near = Terminal(loop, far.slave, lambda octets: None, lambda: None)
        own = termios.tcgetattr(far.slave)
        assert own[3] != modes[3]
        assert (own[0] & kept, own[2], own[4:6]) == (modes[0] & kept, modes[2], modes[4:6])
        assert not own[0] & termios.BRKINT
        near.lend()
        assert termios.tcgetattr(far.slave) == modes
        near.take()
        assert termios.tcgetattr(far.slave) == own
        near.close()
        assert termios.tcgetattr(far.slave) == modes


def test_modes_that_a_child_has_left_are_not_those_of_who_comes_after(desk: Desk) -> None:
    desk.near.lend()
    before = termios.tcgetattr(desk.far.slave)
    termios.tcsetattr(desk.far.slave, termios.TCSANOW, [*before[:3], before[3] ^ termios.ECHO, *before[4:]])
    desk.near.close()
    assert termios.tcgetattr(desk.far.slave) == before


def test_neither_lent_nor_closed_it_draws_nothing(desk: Desk) -> None:
    desk.near.lend()
    assert not desk.near.is_free
    desk.near.say(b"x")
    desk.near.close()
    desk.near.close()
    desk.loop.run_for(1.0)
    assert desk.far.sent == b""


def test_the_callers_descriptor_goes_on_waiting(desk: Desk) -> None:
    # It is the description that the caller's shell has, too.
    assert os.get_blocking(desk.far.slave)
    assert not os.get_blocking(desk.near.fileno())


def test_a_terminal_of_another_user_is_used_by_the_callers_descriptor(
    loop: VirtualLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    far = Emulated(loop)
    with monkeypatch.context() as patch:
        patch.setattr(module.os, "ttyname", lambda descriptor: "/nowhere/that/can/be/opened")
        near = Terminal(loop, far.slave, lambda octets: None, lambda: None)
    assert not os.get_blocking(far.slave)
    near.lend()
    assert os.get_blocking(far.slave)  # for the shell
    near.take()
    near.close()
    assert os.get_blocking(far.slave)
    far.close()


def test_closing_does_not_wait_for_a_line_that_is_stopped(desk: Desk) -> None:
    desk.far.stop()
    desk.far.fill()
    desk.near.draw(b"the frame")
    desk.near.close()
    assert desk.gone == []


def test_a_hang_up_is_told_once(desk: Desk) -> None:
    desk.far.hang_up()
    desk.loop.run_for(1.0)
    assert desk.gone == [True]
    assert not desk.near.is_free


def test_a_hang_up_is_found_by_writing_too(desk: Desk) -> None:
    desk.far.hang_up()
    desk.near.draw(b"x")
    desk.loop.run_for(1.0)
    assert desk.gone == [True]
