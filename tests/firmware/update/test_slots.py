"""Slots: RAUC's status, boot counters, verdict on trial."""

import json
from pathlib import Path

import pytest

from board.runtime.boot_counters import State
from board.runtime.errors import StationError
from firmware.update import slots as update_slots
from tests.firmware.update.rauc_service import STATUS

NOT_YET = "the slot's station has not passed the check yet"
HAS_TO = "on trial: must pass the check"


@pytest.mark.parametrize(
    ("judged", "counters", "here", "there"),
    [
        # of a slot that runs, and of one that was updated and was well
        ("well", State(("A", "B"), 3, 3), "passed at this start", "was well"),
        ("", State(("A", "B"), 2, 3), NOT_YET, "was well"),
        ("not well", State(("A", "B"), 3, 3), "failed at this start: see captain doctor",
         "was well"),
        ("well", State(("A", "B"), 3, 0), "passed at this start", "no tries left"),
        # its last try is running
        ("", State(("A", "B"), 0, 3), NOT_YET, "was well"),
        ("", None, NOT_YET, "kept"),
        # updated and next; not next, as before it is written and behind --back; given up
        ("well", State(("B", "A"), 3, 3, "B"), "passed at this start", HAS_TO),
        ("well", State(("A", "B"), 3, 3, "B"), "passed at this start", "must pass the check"),
        ("well", State(("B", "A"), 3, 0, "B"), "passed at this start", "failed its trial"),
    ],
)  # fmt: skip
def test_words_of_both_slots_are_what_is_known_of_them(judged: str, counters: State | None, here: str, there: str):
    slots = update_slots.slots(STATUS, counters, judged)
    assert [slot.words for slot in slots] == [here, there]


@pytest.mark.parametrize("left", [0, 3])
def test_slot_whose_update_was_cut_off_before_it_was_written_is_not_updated(left: int):
    # The power went right behind the first write of the counters, or behind the one that takes the slot's tries.
    status = json.loads(json.dumps(STATUS))
    status["slots"][0]["rootfs.1"].pop("slot_status")
    there = update_slots.other(update_slots.slots(status, State(("A", "B"), 3, left, "B")))
    assert there.words == "an update of this slot began, but was not written"


@pytest.mark.parametrize("left", [0, 2])
def test_slot_on_its_last_try_has_not_failed_yet(left: int):
    text = json.dumps(STATUS).replace("inactive", "x").replace("booted", "inactive").replace('"x"', '"booted"')
    slots = update_slots.slots(json.loads(text), State(("B", "A"), 3, left, "B"))
    assert [slot.words for slot in slots] == ["kept", HAS_TO]


def test_largest_bundle_is_that_of_the_slots_partition(tmp_path: Path):
    (tmp_path / "43505401-03").mkdir()
    size = tmp_path / "43505401-03/size"
    size.write_text("1638400\n")  # 800 MiB, as the image has them
    there = update_slots.other(update_slots.slots(STATUS, None))
    assert 800 << 20 < update_slots.largest(there, tmp_path) < 820 << 20
    size.write_text("")
    with pytest.raises(StationError, match=r"^.*43505401-03/size: .* B "):
        update_slots.largest(there, tmp_path)


def test_system_without_the_boot_script_has_no_other_slot():
    slots = update_slots.slots(json.loads(json.dumps(STATUS).replace("booted", "active")), None)
    with pytest.raises(StationError, match=r"^the running slot is unknown\n.*boot script"):
        update_slots.other(slots)
