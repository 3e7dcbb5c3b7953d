"""An update of the box, from whatever somebody has named to a slot that is tried at the next start."""

import socket
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from board.errors import StationError, StorageError
from firmware.box import (
    update_bundle,
    update_counters,
    update_fetch,
    update_rauc,
    update_server,
    update_slots,
    update_verity,
)
from firmware.box.update_bundle import Bundle
from firmware.box.update_folder import Folder, LockedError
from firmware.box.update_rauc import BusyError
from firmware.box.update_reason import reason
from firmware.box.update_slots import RootSlot

# A connection to it restarts the box, and nothing else can be asked for: only operator and root reach it.
RESTART = Path("/run/captain-image/restart")
JUDGED = Path("/run/captain-image/judged")
# The result of an update from when the service has it until it has told how it ended, to who began it or to who asks.
BEGUN = "is being installed"


class Progress(NamedTuple):
    """Who is told how far it is.

    step     percent and what is done.
    fetched  octets that are there, and of how many.
    begun    from here on the service has it, and ends it in any case.
    """

    step: Callable[[int, str], None]
    fetched: Callable[[int, int], None]
    shown: Callable[[Bundle, list[RootSlot]], None]
    begun: Callable[[], None]


def run(source: str, progress: Progress, folder: Folder | None = None, only_look: bool = False) -> Bundle:
    """Look at a bundle, and unless only_look install it.

    source  a path, an address, or - for what comes by the input.

    Raises StationError where it is refused or cannot be had: nothing was written into a slot. Raises InstallError
    where it broke off behind that: the other slot is empty, and this one stays in use.
    """
    update_server.check_names_nobody(source)
    folder = folder or Folder()
    own = update_bundle.box()
    with folder.locked():
        version = slot = ""
        name = update_fetch.INPUT if source == "-" else source
        update_rauc.idle()  # what it still reads is not replaced
        try:
            both = slots()
            if not only_look:
                _is_proven(both)
            path = _had(source, folder, progress, update_slots.other(both))
            found = update_bundle.read(path, name)
            version = found.version
            update_bundle.fits(found, own)
            progress.shown(found, both)
            update_verity.check(
                path, name, found.tree, lambda part: progress.step(round(100 * part), "checking the contents")
            )
            if only_look:
                _cleared(folder)
                return found
            slot = update_slots.other(both).name
            folder.tell(source, version, slot, BEGUN)
            progress.begun()
            update_rauc.install(path, name, progress.step)
        except StationError as error:
            if folder.bundle.exists():  # a part is kept, so that it goes on from there
                _cleared(folder)
            if not only_look:
                folder.tell(source, version, slot, _told(error.message, error.hint))
            raise
        _cleared(folder)
        folder.tell(source, version, slot, "installed")
    return found


def _told(words: str, hint: str) -> str:
    """As it is kept, where a hint has no line of its own."""
    return f"{words} ({hint})" if hint else words


def _cleared(folder: Folder) -> None:
    """That a card takes no more writes changes nothing of how an update has ended."""
    with suppress(StorageError):
        folder.clear()


def _is_proven(both: list[RootSlot]) -> None:
    """Raises StationError where the other slot is the last good one."""
    here = update_slots.booted(both)
    if here.is_new:
        raise StationError(
            f"slot {here.name} was just updated and has not been well yet, and the other one is the last that was",
            "wait until it is (captain doctor tells what is not), or captain update --back --restart",
        )


def _had(source: str, folder: Folder, progress: Progress, slot: RootSlot) -> Path:
    if source == "-":
        if sys.stdin is None:
            raise StationError(f"{update_fetch.INPUT} cannot be read: it is closed", "captain update - < FILE")
        return update_fetch.from_stream(sys.stdin.buffer, folder, progress.fetched, update_slots.largest(slot))
    if update_fetch.is_url(source):
        return update_fetch.from_url(source, folder, progress.fetched, update_slots.largest(slot))
    if "://" in source:
        raise StationError(f"{source}: only http:// and https:// are fetched", "or copy the bundle here by ssh")
    return Path(source).absolute()  # the service has another folder


def slots() -> list[RootSlot]:
    """Both, as they are now; without the tries where this user may not read them. Raises StationError."""
    try:
        counters = update_counters.read()
    except StationError:
        counters = None
    return update_slots.slots(update_rauc.status(), counters, _judged())


def _judged(place: Path = JUDGED) -> str:
    """The judge's word of this start."""
    try:
        return place.read_text(encoding="ascii", errors="replace").strip()
    except OSError:
        return ""


def last(folder: Folder) -> Mapping[str, object]:
    """How the last update ended, as it is kept; where nobody waited for its end, as the service has it."""
    told = folder.last()
    if told.get("result") != BEGUN:
        return told
    try:
        result = update_rauc.idle()
    except StationError:
        return told
    if result:
        result = _told(*reason(result))
    else:
        whole = (told.get("slot"), told.get("version"), "ok")
        is_there = any((slot.name, slot.version, slot.state) == whole for slot in slots())
        result = "installed" if is_there else "broke off before it was whole"
    return {**told, "result": result}


def back() -> RootSlot:
    """Have the other slot be the next one. Raises StationError where there is nothing that would start in it."""
    update_bundle.box()
    with Folder().locked():
        update_rauc.idle()
        found = slots()
        chosen = update_slots.other(found)
        if not chosen.is_whole:
            raise StationError(f"slot {chosen.name} was not written whole", "an update writes it again")
        if chosen.is_new and chosen.left == 0:
            raise StationError(f"slot {chosen.name} was updated and did not get well", "an update writes it again")
        update_rauc.activate(chosen.service_name)
    return chosen


@contextmanager
def undisturbed(folder: Folder | None = None) -> Iterator[None]:
    """As long as it lasts no update begins. Raises StationError while one is fetched, looked at or written.

    A folder or a service that fails keeps nobody from a restart: it may be what mends them.
    """
    with ExitStack() as kept:
        for is_free in (lambda: kept.enter_context((folder or Folder()).locked()), update_rauc.idle):
            try:
                is_free()
            except (LockedError, BusyError) as error:
                raise StationError(f"the box is not restarted: {error.message}", error.hint) from error
            except StationError:
                continue  # nothing is known of it
        yield


def restart(place: Path = RESTART) -> None:
    """Ask for a restart of the box. Raises StationError."""
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as end:
            end.settimeout(10.0)
            end.connect(str(place))
    except OSError as error:
        why = error.strerror or str(error)
        raise StationError(
            f"the box cannot be asked to restart: {why}", "take its power away and give it again"
        ) from error
