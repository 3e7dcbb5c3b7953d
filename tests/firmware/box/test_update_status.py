"""What is in both slots, and the way back to the other one."""

import json

import pytest

from board.errors import StationError
from firmware import VERSION
from firmware.box import update_counters
from firmware.box.update_counters import Counters
from firmware.cli import main
from tests.firmware.box.conftest import Said
from tests.firmware.box.rauc_service import STATUS, Service


def test_both_slots_with_what_is_in_them(service: Service, said: Said):
    assert main(["update", "--status"]) == 0
    lines = said()[0].splitlines()
    assert lines[0] == "slots"
    assert lines[2].split(maxsplit=5) == ["A", "runs", VERSION, "-", "2", "well at this start"]
    assert lines[3].startswith("B           next  1.2.3    2026-11-22 20:01")
    assert lines[3].endswith("3  was updated, and has to show that it is well")
    assert lines[4].strip() == "this is a release image"
    assert lines[5].strip() == "no update was tried yet, as far as is kept"


def test_the_status_is_one_object_for_programs(service: Service, said: Said):
    assert main(["update", "--status", "--json"]) == 0
    told = json.loads(said()[0])
    assert [(slot["name"], slot["is_booted"], slot["left"], slot["is_new"]) for slot in told["slots"]] == [
        ("A", True, 2, False),
        ("B", False, 3, True),
    ]


def test_programs_are_told_of_slots_what_people_are(service: Service, said: Said):
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
    lines = said()[0].splitlines()[2:4]
    assert all(slot["version"] in line and slot["words"] in line for slot, line in zip(told, lines, strict=True))


def test_the_version_of_a_slot_is_what_was_installed_into_it(service: Service, said: Said):
    service.says(json.dumps(STATUS).replace("inactive", "x").replace("booted", "inactive").replace('"x"', '"booted"'))
    assert main(["update", "--status", "--json"]) == 0
    assert [slot["version"] for slot in json.loads(said()[0])["slots"]] == ["as written", "1.2.3"]


def test_who_may_not_read_the_counters_sees_the_rest(service: Service, said: Said, monkeypatch: pytest.MonkeyPatch):
    def refuse() -> Counters:
        raise StationError("no")

    monkeypatch.setattr(update_counters, "read", refuse)
    assert main(["update", "--status"]) == 0
    assert said()[0].splitlines()[2].split(maxsplit=5) == ["A", "runs", VERSION, "-", "?", "well at this start"]


@pytest.mark.parametrize(
    ("status", "meant"),
    [
        ("", "is not understood"),
        ("{}", "has not the form of RAUC 1.13"),
        ('{"slots": []}', "knows 0 slots, and not two"),
        ('{"slots": [{"a": 1}]}', "has not the form"),
    ],
)
def test_a_service_of_another_form_is_told(service: Service, said: Said, status: str, meant: str):
    service.says(status)
    assert main(["update", "--status"]) == 1
    err = said()[1]
    assert meant in err
    assert "Error" not in err  # no name of Python's


@pytest.mark.parametrize("words", [["--status"], ["--back"]])
def test_a_service_that_does_not_start_is_told_in_words(service: Service, said: Said, words: list[str]):
    error = "GDBus.Error:org.freedesktop.DBus.Error.ServiceUnknown: The name was not provided by any .service files"
    service.says("", f"rauc-Message: 00:40:09.186: rauc status: error creating proxy: {error}", 1)
    assert main(["update", *words]) == 1
    assert said()[1] == "captain: rauc: the service of updates does not start\n  (journalctl -u rauc tells more)\n"


def test_back_has_the_other_slot_be_the_next_one(service: Service, said: Said):
    assert main(["update", "--back"]) == 0
    assert service.asked[-1] == "status mark-active rootfs.1"
    assert said()[0].startswith("the next start takes slot B, version 1.2.3: ")


@pytest.mark.parametrize("state", ["failed", "pending"])
def test_back_to_a_slot_that_was_not_written_whole_is_refused(service: Service, said: Said, state: str):
    service.says(json.dumps(STATUS).replace('"status": "ok"', f'"status": "{state}"'))
    assert main(["update", "--back"]) == 1
    assert "slot B was not written whole" in said()[1]


def test_back_to_a_slot_that_did_not_get_well_is_refused(service: Service, said: Said, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(update_counters, "read", lambda: Counters(("B", "A"), {"A": 3, "B": 0}, "B"))
    assert main(["update", "--back"]) == 1
    assert "slot B was updated and did not get well" in said()[1]
