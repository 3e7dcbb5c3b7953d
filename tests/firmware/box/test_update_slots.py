"""What is known of both slots, of RAUC's status, the boot counters and the judge's word."""

import json
from pathlib import Path

import pytest

from board.errors import StationError
from firmware.box import update_slots
from firmware.box.update_counters import Counters
from tests.firmware.box.rauc_service import STATUS

NOT_YET = "its station has not been found well yet"
HAS_TO = "was updated, and has to show that it is well"


@pytest.mark.parametrize(
    ("judged", "counters", "here", "there"),
    [
        # of a slot that runs, and of one that was updated and was well
        ("well", Counters(("A", "B"), {"A": 3, "B": 3}, ""), "well at this start", "was well"),
        ("", Counters(("A", "B"), {"A": 2, "B": 3}, ""), NOT_YET, "was well"),
        ("not well", Counters(("A", "B"), {"A": 3, "B": 3}, ""), "not well at this start: captain doctor tells more",
         "was well"),
        ("well", Counters(("A", "B"), {"A": 3, "B": 0}, ""), "well at this start", "has used its tries up"),
        # its last try is running
        ("", Counters(("A", "B"), {"A": 0, "B": 3}, ""), NOT_YET, "was well"),
        ("", None, NOT_YET, "kept"),
        # updated and next; not next, as before it is written and behind --back; given up
        ("well", Counters(("B", "A"), {"A": 3, "B": 3}, "B"), "well at this start", HAS_TO),
        ("well", Counters(("A", "B"), {"A": 3, "B": 3}, "B"), "well at this start", "has to show that it is well"),
        ("well", Counters(("B", "A"), {"A": 3, "B": 0}, "B"), "well at this start", "was updated and did not get well"),
    ],
)  # fmt: skip
def test_what_is_said_of_slots_is_what_is_known_of_them(judged: str, counters: Counters | None, here: str, there: str):
    slots = update_slots.slots(STATUS, counters, judged)
    assert [slot.words for slot in slots] == [here, there]


@pytest.mark.parametrize("left", [0, 3])
def test_a_slot_whose_update_was_cut_off_before_it_was_written_was_not_updated(left: int):
    # The power went right behind the first write of the counters, or behind the one that takes the slot's tries.
    status = json.loads(json.dumps(STATUS))
    status["slots"][0]["rootfs.1"].pop("slot_status")
    there = update_slots.other(update_slots.slots(status, Counters(("A", "B"), {"A": 3, "B": left}, "B")))
    assert there.words == "an update of it was begun, and not written"


@pytest.mark.parametrize("left", [0, 2])
def test_a_slot_on_its_last_try_has_not_failed_yet(left: int):
    text = json.dumps(STATUS).replace("inactive", "x").replace("booted", "inactive").replace('"x"', '"booted"')
    slots = update_slots.slots(json.loads(text), Counters(("B", "A"), {"A": 3, "B": left}, "B"))
    assert [slot.words for slot in slots] == ["kept", HAS_TO]


def test_the_largest_bundle_is_that_of_the_slots_partition(tmp_path: Path):
    (tmp_path / "43505401-03").mkdir()
    size = tmp_path / "43505401-03/size"
    size.write_text("1638400\n")  # 800 MiB, as the image has them
    there = update_slots.other(update_slots.slots(STATUS, None))
    assert 800 << 20 < update_slots.largest(there, tmp_path) < 820 << 20
    size.write_text("")
    with pytest.raises(StationError, match="how large slot B is cannot be read"):
        update_slots.largest(there, tmp_path)


def test_a_system_that_was_started_otherwise_has_no_other_slot():
    slots = update_slots.slots(json.loads(json.dumps(STATUS).replace("booted", "active")), None)
    with pytest.raises(StationError, match="which slot this system runs from is not known"):
        update_slots.other(slots)
