"""The slots of a box and how it is updated, as operator sees it over ssh."""

import json
import time
from typing import NamedTuple

from tests.proof.image.login import Key, said, ssh
from tests.proof.image.machine import Guest, NotSeenError
from tests.proof.image.rows import Row

INSTALL_S = 900.0
WELL_S = 900.0
WELL = "passed at this start"
# The start is over, and the check of the slot has ended.
ENDED = (
    "systemctl is-system-running --wait >/dev/null; "
    "until systemctl show -P ActiveState captain-good | grep -Eqx 'inactive|failed'; do sleep 1; done"
)


class Ended(NamedTuple):
    """A command of operator. words: both outputs."""

    code: int
    words: str
    seconds: float

    @property
    def last(self) -> str:
        return self.words.strip().splitlines()[-1][:100] if self.words.strip() else ""


def update(guest: Guest, key: Key, words: str, limit_s: float = INSTALL_S) -> Ended:
    """captain update, by operator over ssh."""
    began = time.monotonic()
    ended = ssh(guest, key.path, f"captain update {words}", limit_s)
    return Ended(ended.returncode, ended.stdout + ended.stderr, time.monotonic() - began)


def status(guest: Guest, key: Key) -> dict[str, dict[str, object]]:
    ended = ssh(guest, key.path, "captain update --status --json")
    try:
        found: dict[str, dict[str, object]] = json.loads(ended.stdout)
    except ValueError as error:
        raise NotSeenError(f"captain update --status says {ended.stdout + ended.stderr!r}") from error
    return found


def counters(guest: Guest, key: Key) -> list[tuple[object, ...]]:
    return [(slot["name"], slot["left"], slot["is_new"], slot["is_next"]) for slot in slots(guest, key)]


def slots(guest: Guest, key: Key) -> list[dict[str, object]]:
    return list(status(guest, key)["slots"])  # type: ignore[arg-type]


def well(guest: Guest, key: Key, name: str, what: str) -> Row:
    """Once the check of the slot has ended: all tries are back, and it is not new any more."""
    began = time.monotonic()
    said(guest, key, ENDED, WELL_S)
    slot = next(slot for slot in slots(guest, key) if slot["name"] == name)
    seen = f"{slot['words']}, {slot['left']} tries, {'runs' if slot['is_booted'] else 'does not run'}"
    is_ok = (slot["words"], slot["left"], slot["is_booted"]) == (WELL, 3, True)
    took = f" (+{time.monotonic() - began:.0f} s)"
    return Row(what, seen + took, f"{WELL}, 3 tries, runs", is_ok)


def seen(ended: Ended, wanted: str) -> str:
    return wanted if wanted in ended.words else f"{ended.code}: {ended.last}"
