"""Activates a checked set of files, and reports the result."""

from firmware.card.note import Note
from firmware.card.store import Store
from firmware.card.system_files import system_files
from firmware.card.verdict import Verdict

MISTAKES = 2  # number of LED blinks for mistakes; image/overlay has the other numbers


def apply(found: Verdict, store: Store, key: str) -> list[str]:
    """Activate an accepted set. Of a rejected one, keep only the ssh keys, and only if no set is active yet.

    key  identifies the files and the software version that checked them.

    Returns the lines for the serial console. Raises OSError if the data partition cannot be written.
    """
    if found.is_accepted:
        store.accept(key, found.keys, found.files, system_files(found.options, set(found.files)))
    elif not store.has_current:
        store.keep_keys(key, found.keys)
    lines = [_verdict(found, store.has_current), *(note.text for note in _sorted(found))]
    store.tell(key, 0 if found.is_accepted else MISTAKES, lines)
    return lines


def content(found: Verdict) -> str:
    """Return the names of a set's files and the number of its keys."""
    names = [name for name in found.names if name != "cmdline.txt"]
    keys = f"{found.key_count} ssh key{'s' if found.key_count != 1 else ''}"
    return f"{', '.join(names) or 'no files'}; {keys}"


def _verdict(found: Verdict, has_current: bool) -> str:
    if found.is_accepted:
        return f"the owner's files are in force: {content(found)}"
    count = sum(note.is_mistake for note in found.notes)
    told = f"the owner's files are REJECTED, for {count} mistake{'s' if count != 1 else ''}"
    if has_current:
        return f"{told}; the last accepted set stays in force, with its ssh keys"
    return f"{told}; the box runs with its defaults and the valid ssh keys: {found.key_count}"


def _sorted(found: Verdict) -> list[Note]:
    return sorted(found.notes, key=lambda note: not note.is_mistake)
