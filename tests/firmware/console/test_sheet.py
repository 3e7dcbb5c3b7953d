"""Status sheet of a station, with any status."""

import json
import string
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware.console.addresses import AddressedDevice
from firmware.console.journal import Trouble
from firmware.console.rates import Rate
from firmware.console.sheet import Facts, head, sections, shown
from tests.said import tells

NOW = 1795370000.0


def facts(status: dict[str, Any], **more: Any) -> Facts:
    given = {
        "why": "no station answers: /x: Connection refused",
        "service": "it is started by `captain run`",
        "last_words": "",
        "remedy": "",
        "rates": {},
        "devices": [],
        "is_open": False,
        "notes": [],
        "troubles": [],
        "unread": "",
        "now": NOW,
    }
    return Facts(status, **(given | more))


def said(status: dict[str, Any], width: int = 79, **more: Any) -> str:
    return "\n".join(line for section in sections(facts(status, **more), width) for line in section)


def test_the_head_says_who_and_when() -> None:
    status = {"station": "roadside", "version": "1.2.3", "uptime_s": 7200.0}
    assert head(facts(status)) == "roadside  captain 1.2.3  up 2 h  2026-11-22 17:53:20 UTC"


def test_sheet_without_a_station_gives_the_reason_and_the_command_to_start_it() -> None:
    text = said({}, devices=[AddressedDevice("eth0", "down", ())])
    why, remedy, *others = text.splitlines()
    assert tells(why, "no station", "/x: Connection refused")
    assert "`captain run`" in remedy
    assert others == ["eth0   down    no address", "no drops, no errors"]
    assert "no station" in head(facts({}))


def test_why_a_station_has_ended_and_what_to_do_stand_on_the_first_lines() -> None:
    words = {
        "service": "captain.service is activating (auto-restart)",
        "last_words": "x.toml: a: wrong",
        "remedy": "go",
    }
    text = said({}, **words)
    assert text.splitlines()[1:4] == [words["service"], "its last words: x.toml: a: wrong", "go"]
    assert "no errors" not in text


def test_long_last_words_leave_the_screen_its_size() -> None:
    section = sections(facts({}, last_words="word " * 120, remedy="correct it"), 79)[0]
    assert len(section) < 20
    assert section[-1] == "correct it"


def test_sheet_with_a_clock_that_is_not_set_begins_with_it(status: dict[str, Any]) -> None:
    assert "NOT SET" not in said(status)
    assert tells(said(status | {"is_clock_set": False}).splitlines()[0], "clock", "NOT SET: ")


def test_a_folder_for_state_that_keeps_nothing_is_told(status: dict[str, Any]) -> None:
    told = {"folder": "/var/lib/captain", "state": "full", "hint": "remove recordings", "refused": 0}
    assert said(status | {"storage": told}).startswith("storage: /var/lib/captain is full; remove recordings\n")
    assert "storage" not in said(status | {"storage": told | {"state": "kept"}})


def test_sheet_in_holdover_gives_its_bound(status: dict[str, Any]) -> None:
    text = said(status | {"clock": {"state": "holdover", "uncertainty_ns": 5210}})
    assert any(tells(line, "time holdover: ", "oscillator", "5.21 us") for line in text.splitlines())


@pytest.mark.parametrize(
    ("slot", "words"),
    [
        ({"sequence": "off", "state": "unused"}, "off    unused"),
        ({"sequence": "powered", "state": "powering"}, "on     powering"),
        ({"sequence": "present", "state": "running"}, "on     running"),
        ({"sequence": "fault", "state": "fault", "cause": "short circuit"}, "?      fault"),
        ({"switched_by": "nothing: the board file gives neither", "state": "running"}, "always  running"),
    ],
)
def test_a_slot_says_whether_it_has_power(slot: dict[str, Any], words: str) -> None:
    text = said({"board": {"slots": {"gnss": slot}}})
    assert words in text
    assert ("gnss: short circuit" in text) == ("cause" in slot)


def test_a_link_that_is_down_says_why_in_full(status: dict[str, Any]) -> None:
    why = "registers with the network: denied by operator 26201, because the subscription has no data plan"
    status["interfaces"]["cellular"] |= {"state": "down", "why": why, "hint": "ask the operator"}
    assert " ".join(line.strip() for line in said(status).splitlines()).endswith(f"cellular: {why} (ask the operator)")


def test_rates_stand_beside_their_interface(status: dict[str, Any]) -> None:
    assert " 21.0    0.5      3  module" in said(status, rates={"g5": Rate(21.0, 0.5)})


def test_what_is_wrong_with_the_board_is_told(status: dict[str, Any]) -> None:
    status["board"]["complaints"] = ["rail supply: 10.1 V is below 11 V"]
    assert "WRONG: rail supply: 10.1 V is below 11 V" in said(status)


def test_the_last_drops_and_errors_are_told_the_newest_first(status: dict[str, Any]) -> None:
    drop = status["drops"][0]
    drops = [drop | {"where": f"if{ago}", "time": NOW - ago, "count": ago} for ago in range(1, 9)]
    text = said(status | {"drops": drops}, troubles=[Trouble(NOW, "captain", "gnss: WARNING: jammed")])
    found = [line for line in text.splitlines() if " dropped " in line]
    assert [line.split()[0] for line in found] == ["if1", "if2", "if3", "if4", "if5"]
    assert "if1 dropped once, 1.0 s ago: short-pdu: " in text
    assert "17:53:20 captain: gnss: WARNING: jammed" in text


def test_sheet_with_an_unread_journal_does_not_claim_no_errors(status: dict[str, Any]) -> None:
    assert "no drops, no errors" in said({})
    unread = "journal: not installed"
    text = said({}, unread=unread)
    assert unread in text
    assert "no errors" not in text


def test_that_anybody_may_send_is_said_where_it_is_so(status: dict[str, Any]) -> None:
    assert "without authentication" in said(status, is_open=True)
    assert "without authentication" not in said(status)


def test_notes_come_first_as_many_as_leave_room_and_all_at_the_end(status: dict[str, Any]) -> None:
    notes = [f"captain.toml: line {number}: wrong" for number in range(1, 13)]
    lines = said(status, notes=notes).splitlines()
    assert lines[:8] == [f"! {note}" for note in notes[:8]]
    assert lines[8].startswith("! 4 more ")
    assert lines[-12:] == [f"! {note}" for note in notes]
    assert said(status, notes=notes[:8]).count("! captain.toml") == 8


def test_many_network_devices_are_counted(status: dict[str, Any]) -> None:
    assert "28 more network devices" in said(status, devices=[AddressedDevice(f"veth{n}", "up", ()) for n in range(40)])


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("\x1b[2J", "\\x1b[2J"),
        ("\u0085\u009b", "\\x85\\x9b"),
        ("M\u00fcnchen", "M?nchen"),
        ("\u202eabc", "\\x202eabc"),
        ("a" * 100, "a" * 79),
    ],
)
def test_a_line_is_ascii_that_no_terminal_obeys(text: str, line: str) -> None:
    assert shown(text, 79) == line


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)
KEYS = ["interfaces", "board", "clock", "position", "drops", "endpoint", "station", "version", "uptime_s"]


@given(
    status=st.dictionaries(st.sampled_from(KEYS), JSON, max_size=9),
    width=st.integers(1, 79),
    notes=st.lists(st.text(max_size=100), max_size=12),
)
def test_whatever_answers_is_shown_as_ascii_within_the_width(
    status: dict[str, Any], width: int, notes: list[str]
) -> None:
    known = facts(status, notes=notes, troubles=[Trouble(1e300, note, note) for note in notes])
    lines = [shown(head(known), width), *(line for section in sections(known, width) for line in section)]
    assert all(len(line) <= width and set(line) <= set(string.printable[:95]) for line in lines)


@given(data=st.data(), more=st.dictionaries(st.text(max_size=5), JSON, max_size=3))
def test_a_status_with_one_strange_value_is_shown(data: st.DataObject, more: dict[str, Any]) -> None:
    status: dict[str, Any] = json.loads(Path(__file__).with_name("status.json").read_text())
    table = status
    while True:
        key = data.draw(st.sampled_from(sorted(table)))
        if not isinstance(table[key], dict) or not table[key] or data.draw(st.booleans()):
            break
        table = table[key]
    table[key] = data.draw(JSON)
    table |= more
    assert said(status)
