"""Report of checks whose emulated computer ends early."""

import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import pytest

from tests.proof.kernel import __main__ as bench
from tests.proof.kernel.machine import Guest

PROMISED = ["air: one", "air: two", "lines: three"]
END = json.dumps({"exit": 0})
Guests = tuple[list[list[str]], list[list[str]]]


def told(check: str, trouble: str = "") -> str:
    return json.dumps({"check": check, "seen": "", "seconds": 1.0, "trouble": trouble})


def promised(*checks: str) -> str:
    return json.dumps({"promised": checks})


@contextmanager
def said_by(lines: Sequence[str], silence: str = "") -> Iterator[Guest]:
    """A program in place of a guest, which says these lines and ends."""
    program = f"print({chr(10).join(lines)!r}, flush=True)\n{silence}"
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as process:
        guest = Guest(process)
        try:
            yield guest
        finally:
            guest.kill()


@pytest.fixture
def guests(monkeypatch: pytest.MonkeyPatch) -> Guests:
    """What each guest is to say, and the options that each was started with."""
    lines: list[list[str]] = []
    options: list[list[str]] = []

    def booted(given: Sequence[str]) -> object:
        options.append(list(given))
        return said_by(lines[len(options) - 1])

    monkeypatch.setattr(bench, "booted", booted)
    return lines, options


def test_all_checks_of_a_guest_that_ends_by_itself_are_told(guests: Guests):
    lines, options = guests
    lines.append([promised(*PROMISED), "words of another", *map(told, PROMISED), END])
    rows = list(bench.checked(["-k", "x"], 60))
    assert [(row.check, row.is_ok) for row in rows] == [(check, True) for check in PROMISED]
    assert options == [["-k", "x", "--skip=0"]]


def test_a_check_in_which_a_guest_went_down_is_run_by_another(guests: Guests, capsys: pytest.CaptureFixture[str]):
    lines, options = guests
    lines.append([promised(*PROMISED), told("air: one", "wrong")])
    lines.append([promised(*PROMISED[1:]), told("air: two"), told("lines: three"), END])
    rows = list(bench.checked([], 60))
    assert [(row.check, row.trouble) for row in rows] == [("air: one", "wrong"), ("air: two", ""), ("lines: three", "")]
    assert [words[-1] for words in options] == ["--skip=0", "--skip=1"]
    assert "guest 1 went down in: air: two" in capsys.readouterr().err


def test_a_check_in_which_both_guests_went_down_has_failed_and_so_have_those_after_it(
    guests: Guests,
):
    lines, _ = guests
    lines.append([promised(*PROMISED), told("air: one")])
    lines.append([promised(*PROMISED[1:])])
    rows = list(bench.checked([], 60))
    assert [row.check for row in rows if not row.is_ok] == ["air: two", "lines: three", "a guest comes to its end"]


def test_a_guest_that_never_starts_has_failed(guests: Guests):
    lines, _ = guests
    lines += [[], []]
    (row,) = bench.checked([], 60)
    assert (row.is_ok, row.trouble) == (False, "2 did not; guest 2 went down in: its start")


def test_checks_that_ended_before_all_were_run_have_failed(guests: Guests):
    lines, _ = guests
    lines.append([promised(*PROMISED), told("air: one"), json.dumps({"exit": 3})])
    assert [row.is_ok for row in bench.checked([], 60)] == [True, False, False]


def test_a_guest_that_says_nothing_more_has_its_power_taken():
    with said_by([END], "import signal; signal.pause()") as guest:
        assert next(guest.lines(60)) == END
        assert list(guest.lines(0.05)) == [""]
        assert guest.process.wait(60) < 0
