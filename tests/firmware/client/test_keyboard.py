"""Keys of a terminal, read one by one; the terminal is left as it was found."""

import os
import pty
import subprocess
import sys
import termios
from pathlib import Path

import pytest

from firmware.client.keyboard import Keyboard

ROOT = Path(__file__).resolve().parents[3]
# Its standard input is its controlling terminal, as of a command that a shell has started.
INSIDE = """
import os, sys
os.open(os.ttyname(0), os.O_RDWR)
from firmware.client.keyboard import Keyboard
with Keyboard() as keyboard:
    print("ready", keyboard.is_there, flush=True)
    while "quit" not in (keys := keyboard.read()):
        print(*keys, sep=",", flush=True)
"""


def test_keys_come_one_by_one_and_the_terminal_is_given_back() -> None:
    master, slave = pty.openpty()
    before = termios.tcgetattr(slave)
    program = subprocess.Popen(
        [sys.executable, "-c", INSIDE],
        stdin=slave, stdout=subprocess.PIPE, cwd=ROOT, start_new_session=True,
    )  # fmt: skip
    assert program.stdout is not None
    assert program.stdout.readline() == b"ready True\n"
    assert not termios.tcgetattr(slave)[3] & (termios.ICANON | termios.ECHO)
    told = []
    for typed in (b"\x1b[A", b"\x1b[6~", b"x", b"jk"):
        os.write(master, typed)
        told.append(program.stdout.readline().strip().decode())
    os.write(master, b"q")
    assert program.wait(10) == 0
    assert told == ["up", "page down", "", "down,up"]
    assert termios.tcgetattr(slave) == before
    program.stdout.close()
    os.close(master)
    os.close(slave)


# Its own process group is not the terminal's: as of a command that a shell continues in the background.
BEHIND = """
import os, signal
os.open(os.ttyname(0), os.O_RDWR)
from firmware.client.keyboard import Keyboard
with Keyboard() as keyboard:
    child = os.fork()
    if not child:
        os.setpgid(0, 0)
        print(keyboard.read(), flush=True)
        signal.raise_signal(signal.SIGCONT)
        keyboard.__exit__()
        os._exit(0)
    print(os.WIFSTOPPED(os.waitpid(child, os.WUNTRACED)[1]), flush=True)
"""


def test_keyboard_in_the_background_reads_nothing_and_is_not_stopped() -> None:
    master, slave = pty.openpty()
    os.write(master, b"x")
    done = subprocess.run(
        [sys.executable, "-c", BEHIND],
        stdin=slave, capture_output=True, text=True, cwd=ROOT, start_new_session=True, check=False, timeout=10,
    )  # fmt: skip
    os.close(master)
    os.close(slave)
    assert done.stdout == "[]\nFalse\n", done.stderr


def test_standard_input_that_is_no_terminal_has_no_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    with open(os.devnull) as nothing:
        monkeypatch.setattr("sys.stdin", nothing)
        with Keyboard() as keyboard:
            assert not keyboard.is_there


def test_a_terminal_of_another_session_has_no_keys_and_stays_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    master, slave = pty.openpty()
    before = termios.tcgetattr(slave)
    with os.fdopen(slave, "r") as stream:
        monkeypatch.setattr("sys.stdin", stream)
        with Keyboard() as keyboard:
            assert not keyboard.is_there
            assert termios.tcgetattr(slave) == before
    os.close(master)
