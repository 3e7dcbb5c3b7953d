"""The two slots of the box: which runs, which comes next, what is in them, and how often each may still be tried."""

import json
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

from board.errors import StationError
from firmware import VERSION
from firmware.box.update_counters import Counters

_JUDGED = {"well": "well at this start", "not well": "not well at this start: captain doctor tells more"}
AS_WRITTEN = "as written"  # with the card: nothing was installed into it
BLOCKS = Path("/sys/class/block")  # which anybody may read, where the device itself is root's
SECTOR = 512  # octets of what size says there, whatever the card's own are


class RootSlot(NamedTuple):
    """name: A or B. service_name: RAUC's. version of what is in it, where that is known; date of its installation.

    left    tries; None where the counters cannot be read.
    judged  what the judge has found in this start: well, not well; empty: nothing yet, or it does not run.
    is_new  it was updated and has not been well yet.
    device  of its partition.
    state   of what was written into it, in RAUC's word: ok, failed, pending; AS_WRITTEN: nothing was.
    """

    name: str
    service_name: str
    is_booted: bool
    is_next: bool
    version: str
    installed: str
    left: int | None
    is_new: bool
    state: str
    device: str
    judged: str

    @property
    def is_whole(self) -> bool:
        """What was written into it, if anything, came to its end."""
        return self.state in (AS_WRITTEN, "ok")

    @property
    def words(self) -> str:
        """What there is to say of it: the counters only know that it was well once."""
        if not self.is_whole:
            return "was not written whole: an update brings it back"
        if self.is_new:
            return self._words_of_new
        if self.is_booted:
            return _JUDGED.get(self.judged, "its station has not been found well yet")
        if self.left == 0:
            return "has used its tries up"
        return "kept" if self.state == AS_WRITTEN or self.left is None else "was well"

    @property
    def _words_of_new(self) -> str:
        """Of what is named before a slot is written: a cut of the power may have come before it was."""
        if self.state == AS_WRITTEN and not self.is_booted:
            return "an update of it was begun, and not written"
        if self.left == 0 and not self.is_booted:
            return "was updated and did not get well"
        has_to = "has to show that it is well"
        return f"was updated, and {has_to}" if self.is_booted or self.is_next else has_to


def slots(status: Mapping[str, object], counters: Counters | None, judged: str = "") -> list[RootSlot]:
    """Of RAUC's status, the boot counters and the judge's word. Raises StationError for a status of another form."""
    found = []
    try:
        for entry in status["slots"]:  # type: ignore[attr-defined]
            for service_name, one in entry.items():
                if one.get("bootname"):
                    found.append(_slot(service_name, one, status, counters, judged))
    except (KeyError, AttributeError, TypeError, ValueError) as error:
        raise StationError(f"rauc status: has not the form of RAUC 1.13: {json.dumps(status)[:80]}") from error
    if len(found) != 2:
        raise StationError(f"rauc knows {len(found)} slots, and not two")
    return sorted(found)


def largest(slot: RootSlot, blocks: Path = BLOCKS) -> int:
    """Octets of the largest bundle that a slot can be written from. Raises StationError.

    What is in it is no larger than the partition, for a squashfs leaves as it is what does not get smaller; behind it a
    hash tree with 32 octets for each block of 4096, and 32 for each 4096 of these, and a signature of some thousand.
    """
    path = blocks / Path(slot.device).resolve().name / "size"
    try:
        size = int(path.read_text()) * SECTOR
    except (OSError, ValueError) as error:
        raise StationError(f"{path}: how large slot {slot.name} is cannot be read: {error}") from error
    return size + size // 64 + (1 << 20)


def booted(found: list[RootSlot]) -> RootSlot:
    """Raises StationError where it is neither: an image that was started without the boot script."""
    return _one(found, True)


def other(found: list[RootSlot]) -> RootSlot:
    """The one that is not running."""
    booted(found)
    return _one(found, False)


def _one(found: list[RootSlot], is_booted: bool) -> RootSlot:
    chosen = [slot for slot in found if slot.is_booted is is_booted]
    if len(chosen) != 1:
        raise StationError("which slot this system runs from is not known", "it was not started by the boot script")
    return chosen[0]


def _slot(
    name: str, one: Mapping[str, object], status: Mapping[str, object], counters: Counters | None, judged: str
) -> RootSlot:
    letter = str(one["bootname"])
    kept = one.get("slot_status") or {}
    assert isinstance(kept, dict)
    bundle, installed = kept.get("bundle") or {}, kept.get("installed") or {}
    is_booted = one.get("state") == "booted"
    is_next = _first(counters) == letter if counters else status.get("boot_primary") == name
    return RootSlot(
        letter,
        name,
        is_booted,
        is_next,
        str(bundle.get("version") or (VERSION if is_booted else AS_WRITTEN)),
        _date(str(installed.get("timestamp") or "")),
        counters.left.get(letter) if counters else None,
        counters is not None and counters.new == letter,
        str(kept.get("status") or AS_WRITTEN),
        str(one.get("device") or ""),
        judged if is_booted else "",
    )


def _first(counters: Counters) -> str:
    """The slot that the boot script would take now."""
    return next((slot for slot in counters.order if counters.left.get(slot)), "")


def _date(text: str) -> str:
    try:
        return datetime.fromisoformat(text).strftime("%Y-%m-%d %H:%M")
    except ValueError:
        return text
