"""Content of both slots, and the return to the other one."""

import json

import pytest

from board.runtime.boot_counters import State
from board.runtime.errors import StationError
from firmware import VERSION
from firmware.cli import main
from firmware.update import counters
from firmware.update.reason import REASONS
from tests.firmware.update.conftest import Said
from tests.firmware.update.rauc_service import STATUS, Service


def test_status_shows_both_slots_with_what_is_in_them(service: Service, said: Said):
    assert main(["update", "--status"]) == 0
    lines = said()[0].splitlines()
    assert lines[0] == "slots"
    assert lines[2].split() == ["A", "runs", VERSION, "-", "2"]
    assert lines[3].startswith("B           next  1.2.3    2026-11-22 20:01")
    assert [line.strip() for line in lines[4:]] == [
        "A: passed at this start",
        "B: on trial: must pass the check",
        "this is a release image",
        "no update recorded",
    ]


def test_status_for_programs_is_one_object(service: Service, said: Said):
    assert main(["update", "--status", "--json"]) == 0
    told = json.loads(said()[0])
    assert [(slot["name"], slot["is_booted"], slot["left"], slot["is_new"]) for slot in told["slots"]] == [
        ("A", True, 2, False),
        ("B", False, 3, True),
    ]


def test_status_of_a_fresh_card_tells_people_and_programs_the_same(service: Service, said: Said):
    # A fresh card: nothing was installed into either slot.
    status = json.loads(json.dumps(STATUS))
    for entry in status["slots"]:
        for slot in entry.values():
            slot.pop("slot_status", None)
    service.says(json.dumps(status))
    assert main(["update", "--status", "--json"]) == 0
    told = json.loads(said()[0])["slots"]
    assert [(slot["version"], slot["state"]) for slot in told] == [
        (VERSION, "as written"),
        ("as written", "as written"),
    ]
    assert main(["update", "--status"]) == 0
    lines = said()[0].splitlines()[2:]
    assert all(slot["version"] in line for slot, line in zip(told, lines[:2], strict=True))
    assert all(f": {slot['words']}" in line for slot, line in zip(told, lines[2:4], strict=True))


def test_version_of_a_slot_is_what_was_installed_into_it(service: Service, said: Said):
    service.says(json.dumps(STATUS).replace("inactive", "x").replace("booted", "inactive").replace('"x"', '"booted"'))
    assert main(["update", "--status", "--json"]) == 0
    assert [slot["version"] for slot in json.loads(said()[0])["slots"]] == ["as written", "1.2.3"]


def test_status_without_the_counters_shows_the_rest(service: Service, said: Said, monkeypatch: pytest.MonkeyPatch):
    def refuse() -> State:
        raise StationError("no")

    monkeypatch.setattr(counters, "read", refuse)
    assert main(["update", "--status"]) == 0
    lines = said()[0].splitlines()
    assert lines[2].split() == ["A", "runs", VERSION, "-", "?"]
    assert lines[4].strip() == "A: passed at this start"


@pytest.mark.parametrize(
    ("status", "meant"),
    [
        ("", "rauc status"),
        ("{}", "RAUC 1.13"),
        ('{"slots": []}', " 0 slots"),
        ('{"slots": [{"a": 1}]}', "RAUC 1.13"),
    ],
)
def test_service_of_another_form_is_told(service: Service, said: Said, status: str, meant: str):
    service.says(status)
    assert main(["update", "--status"]) == 1
    err = said()[1]
    assert meant in err
    assert "Error" not in err  # no name of Python's


@pytest.mark.parametrize("words", [["--status"], ["--back"]])
def test_service_that_does_not_start_is_told_in_words(service: Service, said: Said, words: list[str]):
    error = "GDBus.Error:org.freedesktop.DBus.Error.ServiceUnknown: The name was not provided by any .service files"
    service.says("", f"rauc-Message: 00:40:09.186: rauc status: error creating proxy: {error}", 1)
    assert main(["update", *words]) == 1
    _, words, hint = REASONS[0]
    assert said()[1] == f"captain: rauc: {words}\n  ({hint})\n"


def test_back_makes_the_other_slot_the_next_one(service: Service, said: Said):
    assert main(["update", "--back"]) == 0
    assert service.asked[-1] == "status mark-active rootfs.1"
    assert said()[0].startswith("the next start uses slot B, version 1.2.3; ")


@pytest.mark.parametrize("state", ["failed", "pending"])
def test_back_to_a_slot_that_was_not_written_whole_is_refused(service: Service, said: Said, state: str):
    service.says(json.dumps(STATUS).replace('"status": "ok"', f'"status": "{state}"'))
    assert main(["update", "--back"]) == 1
    assert said()[1].startswith("captain: slot B ")
    assert not any("mark-active" in words for words in service.asked)


def test_back_to_a_slot_that_did_not_get_well_is_refused(service: Service, said: Said, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(counters, "read", lambda: State(("B", "A"), 3, 0, "B"))
    assert main(["update", "--back"]) == 1
    assert said()[1].startswith("captain: slot B failed its trial\n")  # as the update proof has it
    assert not any("mark-active" in words for words in service.asked)
