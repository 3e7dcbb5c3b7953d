"""Root slots: booted slot, next slot, version, remaining tries.

Rules (a slot's state is in the boot counters and in RAUC's status; this module reads both and writes neither):

# state      meaning                           event                             -> state    by
#
# kept       as written with the card, never   captain update, before the slot   on trial    before-install,
#            updated                           is written                                    RAUC's handler
# well       its station was well once         the same                          on trial    before-install
#                                              its station is not well           well        judge: all tries back
# on trial   updated, not well yet             all of it is written              next        RAUC
#                                              the write broke off               not whole   RAUC: no tries left
#                                              its station is well               well        judge: all tries back
#                                              its station is not well           on trial    judge: restart, next try
#                                              no try is left                    not well    boot.cmd: the other slot
# next       the next start takes it           that start, by one of its tries   as before   boot.cmd
# not whole  the write broke off               captain update                    on trial    before-install
# not well   no tries left, never well         captain update                    on trial    before-install
# well, kept, on trial with tries left         captain update --back             next        RAUC, by update.back()

The judge is the image's service that checks the station after a start; boot.cmd is the boot script (image/boot.cmd).

update.run() and back() hold the lock of /data/update and find RAUC idle before they look at slots. Only RAUC writes a
slot, and never the running one. Only before-install, the judge, RAUC and boot.cmd write counters. Each write is atomic
across a power cut. The option `--status` works at any time and changes nothing. `--look` needs the lock and an idle
RAUC, as an update does; it writes no slot.

run() refuses to install from a slot on trial. before-install refuses it once more, for direct calls of RAUC. Earlier
versions allowed a second update before the first was well. It overwrote the last good slot, and with both bad, the box
did not start.

back() refuses a slot that is not whole or not well. When no slot has tries left, boot.cmd gives three tries to each
slot except the one on trial. Earlier it gave them to both, and a bad or half-written slot started first. A slot that
was well once keeps running when its station fails. Earlier, three failed starts (a missing IP address) switched to the
older version, and later back.
"""

import json
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

from board.runtime.boot_counters import State
from board.runtime.errors import StationError
from firmware import VERSION

_JUDGED = {"well": "passed at this start", "not well": "failed at this start: see captain doctor"}
AS_WRITTEN = "as written"  # state of a slot that was written with the card and never updated
BLOCKS = Path("/sys/class/block")  # readable for all users, while the device itself is root's
SECTOR = 512  # unit in octets of the sizes there, for all cards


class RootSlot(NamedTuple):
    """Root slot, A or B.

    service_name  RAUC's name.
    is_booted     it is running.
    is_next       the next start takes it.
    version       version of its content, if known.
    installed     date of its installation.
    left          tries left; None if the counters cannot be read.
    is_new        it is on trial.
    state         RAUC's state of its content: ok, failed, pending; AS_WRITTEN: never updated.
    device        device of its partition.
    judged        result of the judge since this start: well, not well; empty: no result yet.
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
        """True unless its last installation is incomplete."""
        return self.state in (AS_WRITTEN, "ok")

    @property
    def words(self) -> str:
        """State of the slot in words."""
        if not self.is_whole:
            return "incomplete: update it again"
        if self.is_new:
            return self._words_of_new
        if self.is_booted:
            return _JUDGED.get(self.judged, "the slot's station has not passed the check yet")
        if self.left == 0:
            return "no tries left"
        return "kept" if self.state == AS_WRITTEN or self.left is None else "was well"

    @property
    def _words_of_new(self) -> str:
        """State of a new slot in words; a power cut may have come after it was marked and before it was written."""
        if self.state == AS_WRITTEN and not self.is_booted:
            return "an update of this slot began, but was not written"
        if self.left == 0 and not self.is_booted:
            return "failed its trial"
        has_to = "must pass the check"
        return f"on trial: {has_to}" if self.is_booted or self.is_next else has_to


def slots(status: Mapping[str, object], counters: State | None, judged: str = "") -> list[RootSlot]:
    """Return both slots, sorted by name, from RAUC's status, the boot counters and the judge's result.

    Raises StationError if the status is not in RAUC 1.13's format, or has not exactly two slots.
    """
    found = []
    try:
        for entry in status["slots"]:  # type: ignore[attr-defined]
            for service_name, one in entry.items():
                if one.get("bootname"):
                    found.append(_slot(service_name, one, status, counters, judged))
    except (KeyError, AttributeError, TypeError, ValueError) as error:
        raise StationError(f"rauc status: not the format of RAUC 1.13: {json.dumps(status)[:80]}") from error
    if len(found) != 2:
        raise StationError(f"rauc has {len(found)} slots, not two")
    return sorted(found)


def largest(slot: RootSlot, blocks: Path = BLOCKS) -> int:
    """Return the largest size in octets of a bundle for a slot.

    Raises StationError if the size of its partition cannot be read.

    The squashfs in it is at most as large as the partition, because incompressible data is stored unchanged. The hash
    tree adds 32 octets for each block of 4096, and 32 for each 4096 octets of these. The signature adds some thousand.
    """
    path = blocks / Path(slot.device).resolve().name / "size"
    try:
        size = int(path.read_text()) * SECTOR
    except (OSError, ValueError) as error:
        raise StationError(f"{path}: size of slot {slot.name} cannot be read: {error}") from error
    return size + size // 64 + (1 << 20)


def booted(found: list[RootSlot]) -> RootSlot:
    """Return the booted slot. Raises StationError if neither is booted: the boot script did not start the image."""
    return _one(found, True)


def other(found: list[RootSlot]) -> RootSlot:
    """Return the slot that is not running. Raises StationError as booted() does."""
    booted(found)
    return _one(found, False)


def _one(found: list[RootSlot], is_booted: bool) -> RootSlot:
    chosen = [slot for slot in found if slot.is_booted is is_booted]
    if len(chosen) != 1:
        raise StationError("the running slot is unknown", "start the box by its boot script")
    return chosen[0]


def _slot(
    name: str, one: Mapping[str, object], status: Mapping[str, object], counters: State | None, judged: str
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


def _first(counters: State) -> str:
    """Return the slot that the boot script would start now."""
    return next((slot for slot in counters.order if counters.left.get(slot)), "")


def _date(text: str) -> str:
    try:
        return datetime.fromisoformat(text).strftime("%Y-%m-%d %H:%M")
    except ValueError:
        return text
