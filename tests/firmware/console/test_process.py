"""The program itself on a terminal: its shell, its end, and a real station beside it."""

import os
import signal
import subprocess
import sys
import termios
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from firmware.lab.program import Program
from tests.expect import ROOT, Expect
from tests.firmware.console.emulated import ALLOWED, PRINTED
from tests.said import tells

ENDPOINTS = ("from_users", "to_users", "pull", "report")
SHELL = ("--shell", "/bin/sh -i")


def opened(*options: str, runtime: Path, is_controlling: bool = True, term: str = "vt100") -> Expect:
    """`captain console` on a terminal."""
    environment = {"TERM": term, "PS1": "prompt> ", "XDG_RUNTIME_DIR": str(runtime)}
    command = [sys.executable, "-m", "firmware", "console", *options]
    return Expect(command, environment, is_controlling=is_controlling)


def pid_of_shell(console: Expect) -> int:
    return int(console.run("echo me=$$", r"me=(\d+)")[1])


@pytest.fixture
def ignoring_quit() -> Iterator[None]:
    """As what a shell has put into the background."""
    before = signal.signal(signal.SIGQUIT, signal.SIG_IGN)
    yield
    signal.signal(signal.SIGQUIT, before)


@pytest.mark.parametrize("is_controlling", [True, False])
def test_a_key_opens_a_shell_with_job_control_and_its_end_brings_the_screen_back(
    tmp_path: Path, ignoring_quit: None, is_controlling: bool
) -> None:
    with opened(*SHELL, runtime=tmp_path, is_controlling=is_controlling) as console:
        console.until("keys: s shell")
        console.type(b"s")
        console.until("prompt>")
        assert "job control turned off" not in console.text
        # Signal 32, the last bit of these, is the C library's own: nobody else can change it.
        console.run("grep SigIgn /proc/self/status", r"SigIgn:\s+00000000[08]0000000")
        console.run("sh -c 'echo $((6 * 7)); exec sleep 100'", "42")
        console.type(b"\x03")  # ends what runs in the shell, and nothing else
        console.run("stty -echo -icanon; echo spoilt", "spoilt")
        console.prompted()
        console.type(b"exit 7\n")
        console.until("the shell ended with status 7")
        console.type(b"x")
        console.until("unknown key 'x'")
        console.type(b"q")
        assert console.ended() == 0
        assert termios.tcgetattr(console.slave) == console.modes


def test_the_shell_is_opened_again_and_again(tmp_path: Path) -> None:
    with opened(*SHELL, runtime=tmp_path) as console:
        for _ in range(3):
            console.until("keys: s shell")
            console.type(b"s")
            console.until("prompt>")
            console.prompted()
            console.type(b"exit\n")
            console.until_gone("prompt>")


def test_a_hang_up_ends_shell_and_console(tmp_path: Path, wait_for_end: Callable[[int], None]) -> None:
    with opened(*SHELL, runtime=tmp_path) as console:
        console.until("keys: s shell")
        console.type(b"s")
        console.until("prompt>")
        shell = pid_of_shell(console)
        console.hang_up()
        wait_for_end(shell)
        assert console.ended() == 0


@pytest.mark.parametrize("is_controlling", [True, False])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGKILL])
def test_a_shell_does_not_outlive_its_console(
    tmp_path: Path, number: signal.Signals, is_controlling: bool, wait_for_end: Callable[[int], None]
) -> None:
    with opened(*SHELL, runtime=tmp_path, is_controlling=is_controlling) as console:
        console.until("keys: s shell")
        console.type(b"s")
        console.until("prompt>")
        shell = pid_of_shell(console)
        console.process.send_signal(number)
        assert console.ended() == (-number if number == signal.SIGKILL else 0)
        wait_for_end(shell)


def test_ctrl_c_ends_it_as_it_ends_other_commands(tmp_path: Path) -> None:
    with opened(runtime=tmp_path) as console:
        console.until("keys: ")
        console.type(b"\x03")
        assert console.ended() == 130


@pytest.mark.parametrize(("term", "options"), [("dumb", ()), ("", ()), ("vt100", ("--plain",))])
def test_a_dumb_terminal_gets_no_escape_code(tmp_path: Path, term: str, options: tuple[str, ...]) -> None:
    with opened(*options, runtime=tmp_path, term=term) as console:
        console.until("keys: ")
        assert PRINTED.fullmatch(console.sent)


def test_a_real_station_is_shown(tmp_path: Path, block: int) -> None:
    control = str(tmp_path / f"captain-{block}.sock")
    endpoint = {"control": control} | {key: str(block + at) for at, key in enumerate(ENDPOINTS)}
    options = [word for key, value in endpoint.items() for word in ("--set", f"endpoint.{key}={value}")]
    with ended_at_last(Program("station", ["run", "--board", "sim", *options])) as station:
        station.wait_until_ready()
        with opened("--control", control, runtime=tmp_path) as console:
            console.until("board sim")
            console.until("som301e")
            assert ALLOWED.fullmatch(console.sent)
        ended = once("--once", "--control", control, runtime=tmp_path)
        assert ended.returncode == 0
        assert "som301e" in ended.stdout
        assert PRINTED.fullmatch(ended.stdout.encode())


@contextmanager
def ended_at_last(program: Program) -> Iterator[Program]:
    try:
        yield program
    finally:
        program.stop()


def once(*options: str, runtime: Path) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-m", "firmware", "console", *options],
        cwd=ROOT,
        env={**os.environ, "XDG_RUNTIME_DIR": str(runtime)},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=20,
        check=False,
    )


def test_once_prints_all_and_fails_where_no_station_answers(tmp_path: Path) -> None:
    ended = once("--once", "--control", str(tmp_path / "none.sock"), runtime=tmp_path)
    assert ended.returncode == 1
    assert "no station answers: no socket " in ended.stdout
    assert PRINTED.fullmatch(ended.stdout.encode())
    assert ended.stderr == ""


def test_console_without_a_terminal_fails_with_once(tmp_path: Path) -> None:
    ended = once(runtime=tmp_path)
    assert (ended.returncode, ended.stdout) == (1, "")
    assert tells(ended.stderr, "captain: standard input ", "not a terminal\n", "`captain console --once`")
    assert ended.stderr.count("captain: ") == 1


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--every", "1"), "'1': out of range; 2 to 3600 seconds"),
        (("--every", "nan"), "'nan': out of range"),
        (("--shell", "sh -c 'x"), '--shell: "sh -c \'x": No closing quotation'),
    ],
)
def test_wrong_usage_is_told(tmp_path: Path, options: tuple[str, ...], words: str) -> None:
    ended = once(*options, runtime=tmp_path)
    assert ended.returncode == 2
    assert words in ended.stderr


def test_a_shell_that_was_stopped_goes_on(tmp_path: Path) -> None:
    with opened(*SHELL, runtime=tmp_path) as console:
        console.until("keys: s shell")
        console.type(b"s")
        console.run("exec sh -c 'kill -STOP $$; echo $((6 * 7)); read word; exit 7'", "42")
        console.type(b"\n")
        console.until("the shell ended with status 7")
