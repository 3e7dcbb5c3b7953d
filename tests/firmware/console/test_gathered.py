"""Rates, notes, the journal and the service manager: what is read beside the station's own word."""

import json
import os
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware import systemd
from firmware.console import journal as journal_module
from firmware.console.journal import MOST, Journal, Trouble, troubles
from firmware.console.notes import MOST_LINES, MOST_OCTETS, Notes
from firmware.console.rates import Rate, Rates
from firmware.console.service import BY_HAND, Service
from firmware.console.survey import _port
from tests.said import tells
from tests.virtual import VirtualLoop


def counted(received: float, sent: float = 0, pid: int = 1, uptime_s: float = 0.0) -> dict[str, Any]:
    return {
        "pid": pid,
        "uptime_s": uptime_s,
        "interfaces": {"g5": {"received": {"cam": received, "denm": 1}, "sent": {"cam": sent}}},
    }


def test_a_rate_is_what_was_counted_over_the_time_between() -> None:
    rates = Rates()
    rates.add(counted(10), 100.0)
    assert rates.of == {}
    rates.add(counted(30, 5, uptime_s=2.0), 102.0)
    assert rates.of == {"g5": Rate(10.0, 2.5)}


def test_a_station_that_was_started_again_has_no_rate_yet() -> None:
    rates = Rates()
    rates.add(counted(1000, uptime_s=50.0), 100.0)
    rates.add(counted(1100, pid=2, uptime_s=60.0), 102.0)
    assert rates.of == {}
    rates.add(counted(1100, pid=2, uptime_s=1.0), 104.0)  # with the process id that the one before had
    assert rates.of == {}


def test_an_interface_that_counts_anew_has_no_negative_rate_and_a_new_one_has_none() -> None:
    rates = Rates()
    rates.add(counted(1000), 100.0)
    later = counted(3, uptime_s=2.0)
    later["interfaces"]["new"] = {"received": {"cam": 7}}
    rates.add(later, 102.0)
    assert rates.of == {"g5": Rate(0.0, 0.0)}


def test_a_moment_is_too_short_for_a_rate() -> None:
    rates = Rates()
    rates.add(counted(10), 100.0)
    rates.add(counted(20, uptime_s=2.0), 102.0)
    rates.add(counted(30, uptime_s=2.0), 102.01)
    assert rates.of == {"g5": Rate(5.0, 0.0)}


# -- notes


def test_notes_are_the_lines_of_a_file_and_follow_it(tmp_path: Path) -> None:
    path = tmp_path / "notes"
    notes = Notes(str(path))
    notes.look()
    assert notes.lines == []
    path.write_text("one\n\n  two  \n")
    notes.look()
    assert notes.lines == ["one", "  two"]
    other = tmp_path / "other"
    other.write_text("six\n\n  six  \n")
    os.utime(other, ns=(0, path.stat().st_mtime_ns))
    other.rename(path)  # as long and as old, but another file
    notes.look()
    assert notes.lines == ["six", "  six"]
    path.unlink()
    notes.look()
    assert notes.lines == []


def test_notes_that_have_not_changed_are_not_read_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "notes"
    path.write_text("one\n")
    notes = Notes(str(path))
    notes.look()
    monkeypatch.setattr(os, "open", None)
    notes.look()
    assert notes.lines == ["one"]


@pytest.mark.parametrize("text", ["x" * 1_000_000, "x\n" * 1_000_000, "\n" * 1_000_000])
def test_notes_are_bounded(tmp_path: Path, text: str) -> None:
    (tmp_path / "notes").write_text(text)
    notes = Notes(str(tmp_path / "notes"))
    notes.look()
    assert len(notes.lines) <= MOST_LINES + 1
    assert sum(map(len, notes.lines)) <= MOST_OCTETS + 200
    assert notes.lines[-1] == f"... {tmp_path}/notes has more"


def test_notes_that_cannot_be_read_say_so(tmp_path: Path) -> None:
    notes = Notes(str(tmp_path))
    notes.look()
    assert notes.lines == [f"{tmp_path}: cannot be read: Is a directory"]


def test_a_pipe_in_place_of_notes_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "notes")
    notes = Notes(str(tmp_path / "notes"))
    notes.look()
    assert notes.lines == []


@given(octets=st.binary(max_size=300))
def test_whatever_is_in_a_file_is_lines_of_text(octets: bytes, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.getbasetemp() / "octets"
    path.write_bytes(octets)
    notes = Notes(str(path))
    notes.look()
    assert all(line.strip() for line in notes.lines)


# -- the journal


def entry(message: Any, priority: int = 6, who: Any = "captain", at: int = 1_795_370_000_000_000) -> str:
    fields = {"MESSAGE": message, "PRIORITY": str(priority), "SYSLOG_IDENTIFIER": who, "__REALTIME_TIMESTAMP": str(at)}
    return json.dumps(fields)


def test_troubles_are_errors_of_all_programs_and_warnings_of_the_station() -> None:
    warning, error = "captain.time: WARNING: built-in table", "captain: ERROR: policy unchanged"
    of_kernel = "mmc0: error -110"
    output = "\n".join(
        (
            entry(warning),
            entry("captain: INFO: captain is ready"),
            entry(of_kernel, 3, "kernel"),
            entry("a warning of somebody", 4, "sshd"),
            entry(error, at=1_795_369_000_000_000),
        )
    )
    assert troubles(output) == [
        Trouble(1795370000.0, "captain", warning),
        Trouble(1795370000.0, "kernel", of_kernel),
        Trouble(1795369000.0, "captain", error),
    ]


def test_what_comes_again_and_again_is_told_once_the_newest() -> None:
    again = [entry("captain: ERROR: x", at=at) for at in range(9_000_000, 0, -1_000_000)]
    assert troubles("\n".join([*again, entry("captain: ERROR: y")])) == [
        Trouble(9.0, "captain", "captain: ERROR: x"),
        Trouble(1795370000.0, "captain", "captain: ERROR: y"),
    ]


def test_troubles_are_bounded() -> None:
    assert len(troubles("\n".join(entry(f"captain: ERROR: {number}") for number in range(100)))) == MOST


@pytest.mark.parametrize(
    "line",
    [
        "",
        "{",
        "[]",
        "3",
        "null",
        entry([1, 2]),
        entry(None),
        '{"MESSAGE": "a: ERROR: x"}',
        "[" * 10_000,
        entry("x")[:40],
    ],
)
def test_a_line_that_is_no_entry_is_passed_over(line: str) -> None:
    good = entry("captain: ERROR: y", who=["twice"])
    assert [one.text for one in troubles(f"{line}\n{good}")] == ["captain: ERROR: y"]


def test_the_journal_is_asked_and_its_end_is_told(
    loop: VirtualLoop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = tmp_path / "said"
    said.write_text(entry("captain: ERROR: y") + "\n")
    monkeypatch.setattr(journal_module, "COMMAND", ("cat", str(said)))
    loop.patience_s = 20.0
    told: list[None] = []
    journal = Journal(loop, lambda: told.append(None))
    journal.look()
    journal.look()
    assert not journal.is_read
    loop.run_until(lambda: bool(told))
    assert journal.is_read
    assert [one.text for one in journal.troubles] == ["captain: ERROR: y"]
    assert journal.why == ""


def test_journal_that_this_user_may_not_read_gives_the_group(
    loop: VirtualLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(journal_module, "COMMAND", ("false",))
    loop.patience_s = 20.0
    told: list[None] = []
    journal = Journal(loop, lambda: told.append(None))
    journal.look()
    loop.run_until(lambda: bool(told))
    assert tells(journal.why, "journal cannot be read: ", "group systemd-journal")


def test_journal_without_its_program_has_no_troubles_and_names_it(
    loop: VirtualLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(journal_module, "COMMAND", ("no-such-program",))
    journal = Journal(loop, lambda: None)
    journal.look()
    assert journal.is_read
    assert journal.troubles == []
    assert tells(journal.why, "journal cannot be read: ", "no-such-program ", "not installed")


# -- the service manager


def test_service_that_ended_gives_its_state_last_words_and_remedy(
    loop: VirtualLoop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown, said = tmp_path / "shown", tmp_path / "said"
    shown.write_text("LoadState=loaded\nActiveState=activating\nSubState=auto-restart\nNRestarts=3\nrubbish\n")
    said.write_text(entry("captain: no free port") + "\n")
    monkeypatch.setattr(systemd, "SHOW", ("cat", str(shown)))
    monkeypatch.setattr(systemd, "SAID", ("cat", str(said)))
    monkeypatch.setattr(systemd, "MANAGER", tmp_path)
    loop.patience_s = 20.0
    told: list[None] = []
    service = Service(loop, lambda: told.append(None))
    service.look()
    loop.run_until(lambda: service.is_read)
    assert tells(service.words, "captain.service ", "activating (auto-restart)", " 3 times")
    assert service.last_words == "no free port"
    assert tells(service.remedy, "configuration", "`systemctl restart captain.service`")
    assert len(told) == 2


@pytest.mark.parametrize("shown", ["LoadState=not-found\n", ""])
def test_a_station_that_is_no_service_is_started_by_hand(
    loop: VirtualLoop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shown: str
) -> None:
    (tmp_path / "shown").write_text(shown)
    monkeypatch.setattr(systemd, "SHOW", ("cat", str(tmp_path / "shown")))
    monkeypatch.setattr(systemd, "MANAGER", tmp_path)
    loop.patience_s = 20.0
    told: list[None] = []
    service = Service(loop, lambda: told.append(None))
    service.look()
    loop.run_until(lambda: bool(told))
    assert (service.words, service.last_words, service.remedy) == (BY_HAND, "", "")


def test_without_a_service_manager_nobody_is_asked(
    loop: VirtualLoop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(systemd, "MANAGER", tmp_path / "systemd")
    service = Service(loop, lambda: None)
    service.look()
    assert service.is_read
    assert service.words == BY_HAND


@pytest.mark.parametrize(
    ("path", "port"),
    [
        ("/run/captain/captain-5565.sock", 5565),
        ("/tmp/captain-0-4026531833-5555.sock", 5555),
        ("/x/control.sock", 5555),
    ],
)
def test_the_name_of_the_control_socket_says_the_port(path: str, port: int) -> None:
    assert _port([path]) == port
