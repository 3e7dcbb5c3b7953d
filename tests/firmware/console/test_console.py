"""The console on an emulated VT100, in virtual time: what is seen, what keys do, what a bad line does."""

import os
import signal
import termios
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop
from firmware.console import terminal
from firmware.console.console import Console, Options
from tests.firmware.console.emulated import ALLOWED, PRINTED, Bench
from tests.virtual import VirtualLoop

STATION = "captain  captain 0.1.0"


def test_a_person_sees_who_what_where_since_when_and_why(bench: Bench) -> None:
    bench.start_station()
    bench.open()
    bench.until_shown(STATION, within=3.0)
    shown = bench.terminal.text
    for words in (
        "time settling: first pulses received",
        "position 48.7681805 11.4326500, by gnss, fix full, carrier none, 28 satellites",
        "1  gnss      on     running",
        "2  free      off    unused",
        "1e0e:9001 SIMCom SIM8202G-M2",
        "cpu 48.2 C, fan 2640 rpm",
        "interface  driver    link",
        "10.64.1.2",
        "eth0   up      192.168.1.20/24 fe80::1/64",
        "g5 dropped 3 times",
    ):
        assert words in shown, f"{words!r} is missing:\n{shown}"
    assert shown.splitlines()[22].startswith("keys: ")


def test_nothing_is_sent_that_a_vt100_has_not_and_nothing_beyond_79_columns_and_23_lines(bench: Bench) -> None:
    bench.status["station"] = "\x1b[2J\x07\x9b31m\u202e\ud83d\ude97 M\u00fcller\n\n"
    bench.status["interfaces"]["g5"]["why"] = "\x1b]0;owned\x07" * 40
    bench.start_station()
    bench.open()
    bench.loop.run_for(30.0)
    assert ALLOWED.fullmatch(bench.terminal.sent)
    assert all(len(line) <= 79 for line in bench.terminal.lines)
    assert bench.terminal.lines[23] == ""


def test_rates_are_those_between_two_statuses(bench: Bench) -> None:
    bench.start_station()
    bench.open()
    bench.until_shown("-      -      3  module")
    before = bench.status["interfaces"]["g5"]["received"]["cam"]
    for _ in range(3):
        asked = len(bench.asked)
        bench.until(lambda asked=asked: len(bench.asked) > asked)
        bench.status["uptime_s"] += 2.0
        before += 42
        bench.status["interfaces"]["g5"]["received"]["cam"] = before
    bench.until_shown(" 21.0    0.0      3  module")


def test_the_station_is_asked_each_two_seconds_whatever_is_typed(bench: Bench) -> None:
    bench.start_station()
    bench.open()
    bench.until_shown(STATION)
    for _ in range(40):
        bench.press(b"r")
        bench.loop.run_for(0.25)
    assert 5 <= len(bench.asked) <= 7


def test_only_what_changes_is_sent_and_all_of_it_each_ten_seconds(bench: Bench) -> None:
    bench.start_station()
    bench.open()
    bench.until_shown(STATION)
    bench.terminal.sent = b""
    bench.loop.run_for(60.0)
    frames = [len(frame) for frame in bench.terminal.sent.split(b"\x1b[H")[1:]]
    assert 5 <= sum(length > 1000 for length in frames) <= 7, frames
    assert [length for length in frames if 400 < length <= 1000] == []  # the first rates; the clock of the head
    assert len(frames) <= 15  # of thirty looks, most of which bring nothing new
    bench.terminal.screen.reset()  # a terminal that is plugged in now
    bench.until(lambda: STATION in bench.terminal.text and "eth0" in bench.terminal.text, within=11.0)


def test_a_screen_has_less_than_two_kilobytes_and_a_line_of_115200_baud_carries_all(bench: Bench) -> None:
    bench.notes.write_text(f"{'m' * 500}\n" * 3)
    bench.start_station()
    bench.open()
    bench.until_shown(STATION)
    bench.terminal.sent = b""
    began = bench.loop.now
    for _ in range(100):  # keys as fast as they can be told apart: each has the screen drawn anew
        bench.press(b"r")
        bench.loop.run_for(0.101)
    screens = bench.terminal.sent.split(b"\x1b[H")[1:]
    assert len(bench.terminal.sent) < 11_520 * (bench.loop.now - began)
    assert 1700 < max(map(len, screens)) < 2048
    assert len(screens) > 30


def test_pages_turn_forth_and_back_and_around(bench: Bench) -> None:
    bench.notes.write_text("".join(f"captain.toml: line {number}: wrong\n" for number in range(1, 31)))
    bench.start_station()
    bench.open()
    bench.until_shown("page 1/3")
    assert "! captain.toml: line 1: wrong" in bench.terminal.text
    assert "! 22 more lines" in bench.terminal.text
    bench.press(b"n")
    bench.until_shown("page 2/3")
    bench.press(b" ")
    bench.until_shown("! captain.toml: line 30: wrong")
    bench.press(b"\x1b[6~")
    bench.until_shown("page 1/3")
    bench.press(b"p")
    bench.until_shown("page 3/3")
    bench.press(b"\x1b[A")
    bench.until_shown("page 2/3")


def test_a_key_that_means_nothing_is_told(bench: Bench) -> None:
    bench.open()
    bench.until_shown("keys: ")
    bench.press(b"x")
    bench.until_shown("unknown key 'x'; h lists the keys")
    bench.press(b"r")
    bench.until_gone("unknown key")


@pytest.mark.parametrize(("shell", "stays"), [((), True), ((), False), (("/bin/sh",), True)])
def test_help_names_the_keys_that_there_are(bench: Bench, shell: tuple[str, ...], stays: bool) -> None:
    bench.open(shell=shell, stays=stays)
    bench.until_shown("keys: ")
    assert ("s shell" in bench.terminal.text) == bool(shell)
    assert ("q quit" in bench.terminal.text) == (not stays)
    bench.press(b"h")
    bench.until_shown("arrow down")
    assert ("open a shell here" in bench.terminal.text) == bool(shell)
    assert ("Ctrl-C   " in bench.terminal.text) == (not stays)
    bench.press(b"z")
    bench.until_gone("arrow down")


def test_without_a_shell_its_key_means_nothing(bench: Bench) -> None:
    bench.open()
    bench.until_shown("keys: ")
    bench.press(b"s")
    bench.until_shown("unknown key 's'")


def test_a_shell_that_cannot_be_started_is_told(bench: Bench) -> None:
    bench.open(shell=("/no/such/shell",))
    bench.until_shown("keys: ")
    bench.press(b"s")
    bench.until_shown("no shell: /no/such/shell: No such file or directory")
    bench.press(b"r")
    bench.until_gone("no shell:")


@pytest.mark.parametrize("key", [b"q", b"\x03"])
def test_a_key_ends_it_unless_it_is_a_service(bench: Bench, key: bytes) -> None:
    bench.open()
    bench.until_shown("keys: ")
    bench.press(key)
    bench.until(lambda: bench.is_over)
    assert bench.console is not None
    assert bench.console.status == (130 if key == b"\x03" else 0)


@pytest.mark.parametrize("key", [b"q", b"\x03", b"\x04", b"\x1a", b"\x1c"])
def test_no_key_ends_a_service(bench: Bench, key: bytes) -> None:
    bench.open(stays=True)
    bench.until_shown("keys: ")
    bench.press(key)
    bench.until_shown("unknown key")
    assert not bench.is_over


def test_noise_is_counted_opens_nothing_and_leaves_the_screen_as_it_was(bench: Bench) -> None:
    bench.start_station()
    bench.open(shell=("/no/such/shell",))
    bench.until_shown(STATION)
    flood = bytes(range(256)) * 14  # as much as a tty's queue takes at once
    for _ in range(3):
        bench.press(flood)
        bench.loop.run_for(0.02)
    bench.until_shown("octets of noise on the line")
    assert "no shell" not in bench.terminal.text
    bench.press(b"x")
    bench.until_shown("unknown key 'x'")


@settings(max_examples=25)
@given(octets=st.lists(st.binary(min_size=1, max_size=40), max_size=6))
def test_whatever_a_line_types_a_key_works_afterwards(octets: list[bytes], machine: None, tmp_path: Path) -> None:
    with (
        closing(VirtualLoop()) as loop,
        closing(Bench(loop, tmp_path, {})) as bench,
        pytest.MonkeyPatch.context() as patch,
    ):
        patch.setattr(terminal, "os", bench.terminal.ours)
        bench.open(stays=True)
        for part in octets:
            bench.press(part)
            loop.run_for(0.05)
        loop.run_for(0.5)
        bench.press(b"h")
        bench.until_shown("arrow down")
        assert ALLOWED.fullmatch(bench.terminal.sent)


def test_an_xoff_stops_frames_without_piling_them_up_and_any_key_goes_on(bench: Bench) -> None:
    bench.start_station()
    bench.open()
    bench.until_shown(STATION)
    bench.press(b"\x13")
    bench.until_silent()
    bench.loop.run_for(120.0)
    assert bench.terminal.sent == b""
    assert len(bench.asked) > 50
    bench.status["station"] = "renamed"
    bench.press(b"r")
    bench.until_shown("renamed")
    assert len(bench.terminal.sent) < 3 * 2048


def test_a_terminal_that_reads_nothing_gets_one_frame_at_most_and_then_the_last(bench: Bench) -> None:
    bench.start_station()
    bench.open()
    bench.until_shown(STATION)
    bench.terminal.stop()
    bench.terminal.fill()
    for number in range(100):
        bench.status["station"] = f"name{number}" * 9
        bench.press(b"r")
        bench.loop.run_for(2.5)
    bench.terminal.sent = b""
    bench.terminal.go_on()
    bench.until_shown("name99")
    # A pty keeps up to 64 KiB of its own, when its kernel thread has the time; a hundred frames are 160.
    assert len(bench.terminal.sent) < 80_000


def test_a_terminal_that_is_resized_is_drawn_anew_within_its_size(bench: Bench) -> None:
    bench.start_station()
    bench.open()
    bench.until_shown(STATION)
    for columns, lines in ((40, 10), (20, 4), (10, 2), (132, 50), (80, 24)):
        bench.terminal.resize(columns, lines)
        bench.terminal.screen.reset()
        bench.terminal.sent = b""
        os.kill(os.getpid(), signal.SIGWINCH)
        keys, last = "keys: "[: columns - 1].strip(), min(lines, 24) - 2
        bench.until(lambda keys=keys, last=last: bench.terminal.lines[last].startswith(keys), within=1.0)
        assert all(len(line) <= min(columns, 80) - 1 for line in bench.terminal.lines)
        assert not any(bench.terminal.lines[23:])


def test_a_line_that_says_no_size_has_eighty_columns_and_twenty_four_lines(bench: Bench) -> None:
    bench.terminal.resize(80, 24)
    termios.tcsetwinsize(bench.terminal.master, (0, 0))
    bench.start_station()
    bench.open()
    bench.until_shown(STATION)
    assert bench.terminal.lines[22].startswith("keys: ")


def test_a_hang_up_ends_it(bench: Bench) -> None:
    bench.open(stays=True)
    bench.until_shown("keys: ")
    bench.terminal.hang_up()
    bench.until(lambda: bench.is_over, within=5.0)


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGTERM])
def test_a_signal_ends_it_and_the_terminal_has_its_modes_again(bench: Bench, number: int) -> None:
    before = termios.tcgetattr(bench.terminal.slave)
    bench.open()
    bench.until_shown("keys: ")
    assert termios.tcgetattr(bench.terminal.slave) != before
    os.kill(os.getpid(), number)
    bench.until(lambda: bench.is_over)
    assert bench.console is not None
    bench.console.close()
    assert termios.tcgetattr(bench.terminal.slave) == before
    assert os.get_blocking(bench.terminal.slave)


def test_what_is_no_terminal_is_refused_with_what_to_do() -> None:
    read, write = os.pipe()
    loop = Loop()
    try:
        with pytest.raises(InterfaceError, match="--once"):
            Console(loop, read, Options([]))
    finally:
        loop.close()
        os.close(read)
        os.close(write)


def test_a_station_that_goes_and_comes_back_is_followed(bench: Bench) -> None:
    bench.open()
    bench.until_shown("no station answers: no socket ")
    assert "start it with `captain run`" in bench.terminal.text
    assert "eth0" in bench.terminal.text
    bench.start_station()
    bench.until_shown(STATION)
    bench.stop_station()
    bench.until_shown("no station answers")
    assert "interface  driver" not in bench.terminal.text
    bench.status["station"] = "another"
    bench.start_station()
    bench.until_shown("another")


def test_notes_are_read_again_when_they_change(bench: Bench) -> None:
    bench.open()
    bench.until_shown("keys: ")
    bench.notes.write_text("captain.toml: line 3: \x1b[31mnot a key\n")
    bench.until_shown("! captain.toml: line 3: \\x1b[31mnot a key")
    bench.notes.write_text("")
    bench.until_gone("! captain")


def test_without_escape_codes_a_screen_is_printed_now_and_then_and_at_a_key(bench: Bench) -> None:
    bench.start_station()
    bench.open(is_plain=True, every_s=30.0)
    bench.until(lambda: STATION.encode() in bench.terminal.sent)
    began = bench.loop.now
    bench.until(lambda: bench.terminal.sent.count(b"keys: ") == 4, within=100.0)
    assert bench.loop.now - began >= 85.0
    bench.press(b"n")
    bench.until(lambda: bench.terminal.sent.count(b"keys: ") == 5)
    assert PRINTED.fullmatch(bench.terminal.sent)
    longest = max(map(len, bench.terminal.sent.split(b"\r\n")))
    assert longest <= 79
