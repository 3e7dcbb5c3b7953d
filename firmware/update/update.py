"""Update of a box, from a named bundle to a slot on trial."""

import socket
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from board.runtime.errors import StationError, StorageError
from firmware.update import bundle, fetch, rauc, server, verity
from firmware.update import counters as update_counters
from firmware.update import slots as update_slots
from firmware.update.bundle import Bundle
from firmware.update.folder import Folder, LockedError
from firmware.update.rauc import BusyError
from firmware.update.reason import reason
from firmware.update.slots import RootSlot

# A connection to this socket restarts the box. It accepts no other request, and only operator and root may connect.
RESTART = Path("/run/captain-image/restart")
JUDGED = Path("/run/captain-image/judged")
# Stored result of an update from the start of the installation until its end is known, to the starting or a later call.
BEGUN = "is being installed"


class Progress(NamedTuple):
    """Callbacks for the progress of an update.

    step     percent, and the current step.
    fetched  octets received, and the total.
    shown    the checked bundle, and both slots.
    begun    the service starts to install, and will end in any case.
    """

    step: Callable[[int, str], None]
    fetched: Callable[[int, int], None]
    shown: Callable[[Bundle, list[RootSlot]], None]
    begun: Callable[[], None]


def run(source: str, progress: Progress, folder: Folder | None = None, only_look: bool = False) -> Bundle:
    """Check a bundle, and install it unless only_look.

    source  path, URL, or - for standard input.

    Raises StationError if the bundle is refused or cannot be fetched; no slot was written. Raises InstallError if the
    installation failed; the other slot is then unusable, and the current one stays in use.
    """
    server.check_names_nobody(source)
    folder = folder or Folder()
    own = bundle.box()
    with folder.locked():
        version = slot = ""
        name = fetch.INPUT if source == "-" else source
        rauc.idle()  # the bundle must not be replaced while an installation reads it
        try:
            both = slots()
            if not only_look:
                _is_proven(both)
            path = _had(source, folder, progress, update_slots.other(both))
            found = bundle.read(path, name)
            version = found.version
            bundle.fits(found, own)
            progress.shown(found, both)
            verity.check(path, name, found.tree, lambda part: progress.step(round(100 * part), "checking the contents"))
            if only_look:
                _cleared(folder)
                return found
            slot = update_slots.other(both).name
            folder.note_result(source, version, slot, BEGUN)
            progress.begun()
            rauc.install(path, name, progress.step)
        except StationError as error:
            if folder.bundle.exists():  # a part remains, so that the download can be resumed
                _cleared(folder)
            if not only_look:
                folder.note_result(source, version, slot, _told(error.message, error.hint))
            raise
        _cleared(folder)
        folder.note_result(source, version, slot, "installed")
    return found


def _told(words: str, hint: str) -> str:
    """Return message and hint in one line, for the stored result."""
    return f"{words} ({hint})" if hint else words


def _cleared(folder: Folder) -> None:
    """Clear the folder; a card that refuses it does not change the update's result."""
    with suppress(StorageError):
        folder.clear()


def _is_proven(both: list[RootSlot]) -> None:
    """Check that this slot is not on trial. Raises StationError if it is: the other one is the last known-good slot."""
    here = update_slots.booted(both)
    if here.is_new:
        raise StationError(
            f"slot {here.name} is on trial; the other one is the only known-good one",
            "wait until it works (captain doctor shows why not), or captain update --back --restart",
        )


def _had(source: str, folder: Folder, progress: Progress, slot: RootSlot) -> Path:
    if source == "-":
        if sys.stdin is None:
            raise StationError(f"{fetch.INPUT}: is closed", "captain update - < FILE")
        return fetch.from_stream(sys.stdin.buffer, folder, progress.fetched, update_slots.largest(slot))
    if fetch.is_url(source):
        return fetch.from_url(source, folder, progress.fetched, update_slots.largest(slot))
    if "://" in source:
        raise StationError(f"{source}: only http:// and https:// are fetched", "or copy the bundle here by ssh")
    return Path(source).absolute()  # because the service has another working directory


def slots() -> list[RootSlot]:
    """Return both slots, without tries if this user may not read them. Raises StationError if rauc does not answer."""
    try:
        counters = update_counters.read()
    except StationError:
        counters = None
    return update_slots.slots(rauc.status(), counters, _judged())


def _judged(place: Path = JUDGED) -> str:
    """Return the judge's result of this start; empty before it."""
    try:
        return place.read_text(encoding="ascii", errors="replace").strip()
    except OSError:
        return ""


def last(folder: Folder) -> Mapping[str, object]:
    """Return the stored result of the last update; if its end was not stored, complete it from the service."""
    told = folder.last()
    if told.get("result") != BEGUN:
        return told
    try:
        result = rauc.idle()
    except StationError:
        return told
    if result:
        result = _told(*reason(result))
    else:
        whole = (told.get("slot"), told.get("version"), "ok")
        is_there = any((slot.name, slot.version, slot.state) == whole for slot in slots())
        result = "installed" if is_there else "broke off before its end"
    return {**told, "result": result}


def back() -> RootSlot:
    """Make the other slot the next to boot. Raises StationError if that slot is incomplete or failed its trial."""
    bundle.box()
    with Folder().locked():
        rauc.idle()
        found = slots()
        chosen = update_slots.other(found)
        if not chosen.is_whole:
            raise StationError(f"slot {chosen.name} is incomplete", "update it again")
        if chosen.is_new and chosen.left == 0:
            raise StationError(f"slot {chosen.name} failed its trial", "update it again")
        rauc.activate(chosen.service_name)
    return chosen


@contextmanager
def undisturbed(folder: Folder | None = None) -> Iterator[None]:
    """Keep updates from starting. Raises StationError while an update is fetched, checked or installed.

    A failing folder or service does not prevent a restart, because the restart may repair it.
    """
    with ExitStack() as kept:
        for is_free in (lambda: kept.enter_context((folder or Folder()).locked()), rauc.idle):
            try:
                is_free()
            except (LockedError, BusyError) as error:
                raise StationError(f"the box is not restarted: {error.message}", error.hint) from error
            except StationError:
                continue  # the folder or service fails, which must not prevent a restart
        yield


def restart(place: Path = RESTART) -> None:
    """Restart the box by the service manager. Raises StationError if it does not answer."""
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as end:
            end.settimeout(10.0)
            end.connect(str(place))
    except OSError as error:
        why = error.strerror or str(error)
        raise StationError(f"cannot ask the box to restart: {why}", "switch the power off and on") from error
