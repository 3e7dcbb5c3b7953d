"""What a box does with a set that was looked at, and how it tells its owner."""

from firmware.box.note import Note
from firmware.box.store import Store
from firmware.box.system_files import system_files
from firmware.box.verdict import Verdict

MISTAKES = 2  # blinks of the LED; image/overlay has the other numbers


def apply(found: Verdict, store: Store, key: str) -> list[str]:
    """Put an accepted set in force; of another one only ssh keys count, and those only as long as there is no set.

    key  of the files, and of the software that has looked at them.

    Returns what the serial console shows. Raises OSError where the data partition takes nothing.
    """
    if found.is_accepted:
        store.accept(key, found.keys, found.files, system_files(found.options, set(found.files)))
    elif not store.has_current:
        store.keep_keys(key, found.keys)
    lines = [_verdict(found, store.has_current), *(note.text for note in _sorted(found))]
    store.tell(key, 0 if found.is_accepted else MISTAKES, lines)
    return lines


def content(found: Verdict) -> str:
    """The files of a set, and how many keys it has."""
    names = [name for name in found.names if name != "cmdline.txt"]
    keys = f"{found.key_count} ssh key{'s' if found.key_count != 1 else ''}"
    return f"{', '.join(names) or 'no files'}; {keys}"


def _verdict(found: Verdict, has_current: bool) -> str:
    if found.is_accepted:
        return f"the owner's files are in force: {content(found)}"
    count = sum(note.is_mistake for note in found.notes)
    told = f"the owner's files are NOT taken, for {count} mistake{'s' if count != 1 else ''}"
    if has_current:
        return f"{told}; those of before stay in force, their ssh keys too"
    return f"{told}; the box runs as it was made, with the sound ssh keys of them: {found.key_count}"


def _sorted(found: Verdict) -> list[Note]:
    return sorted(found.notes, key=lambda note: not note.is_mistake)
