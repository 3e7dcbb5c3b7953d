"""Power cuts while an update is fetched and installed, on a drive that loses, reorders or tears what was not flushed.

A machine that has looked at a bundle, and is about to install it, is kept as a file: its memory, and its card. Each cut
begins with it. After it U-Boot starts a slot, and that has to be the old version or the new one, to the octet; every
fourth time the whole system is started.
"""

import json
import socket
import subprocess
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import cycle
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from board.runtime import boot_counters
from image.description import Description, read
from image.filesystem import disk
from tests.proof.image import bundles
from tests.proof.image.bundles import Bundles, digest_of
from tests.proof.image.drive import MIB, Drive, served
from tests.proof.image.login import Key, new_key, said, ssh, wait_for_ssh
from tests.proof.image.machine import Guest, NotSeenError, Ports, held_ports, owned, powered
from tests.proof.image.medium import Fate
from tests.proof.image.rows import Options, Row
from tests.proof.image.site import serving
from tests.proof.image.slots import ENDED, INSTALL_S
from tests.proof.image.user import user

COUNT, SHORT = 12, 2
SEED = 11
FULL_EACH = 4  # of so many cuts the start of one is that of the whole system
BUNDLE = "/data/update/captain.raucb"  # operator's copy
CARD = "cut.img"  # of the cut that is under way


class Where(NamedTuple):
    """What is written when the power goes: to this partition, after this command. is_early: no slot was touched yet."""

    what: str
    partition: str
    command: str
    is_early: bool = False


COUNTERS = Where("while the counters are written", "state", BUNDLE)
SLOT = Where("while the slot is written", "root-b", BUNDLE)
FETCH = Where("while the bundle is fetched", "data", "URL", is_early=True)
# All writes of counters are met, one after the other: they are few, and decide.
ORDER = (SLOT, COUNTERS, COUNTERS, FETCH, COUNTERS, SLOT, COUNTERS, COUNTERS, COUNTERS, FETCH, COUNTERS, SLOT)
FATES = {COUNTERS: (Fate.TEAR, Fate.KEEP, Fate.SHUFFLE, Fate.DROP), SLOT: (Fate.SHUFFLE, Fate.DROP, Fate.TEAR)}


class Kept(NamedTuple):
    """A machine that is about to install. a_digest: of its slot A."""

    card: Path
    memory: Path
    ports: Ports
    a_digest: str


class Cut(NamedTuple):
    """At which write to the partition it comes."""

    where: Where
    write: int
    fate: Fate
    is_full: bool


class Seen(NamedTuple):
    slot: str
    words: str
    is_ok: bool


def rows(card: Path, folder: Path, options: Options) -> Iterator[Row]:
    count = options.count or (SHORT if options.is_short else COUNT)
    made = bundles.made(card, folder / "bundles", is_short=True)
    key = new_key(folder)
    own = owned(card, folder, {"authorized_keys": key.line})
    slots = []
    with serving(made.good.parent) as site, held_ports() as ports:
        url = site.url(made.good.name)
        kept = _kept(own, folder, key, made.good, ports)
        writes, took_s = _whole(kept, folder, key)
        told = ", ".join(f"{name} {number}" for name, number in writes.items())
        yield Row(f"writes of an update, {took_s:.0f} s", told, "", all(writes.values()))
        for number, cut in enumerate(plan(count, writes)):
            began = time.monotonic()
            seen = _cut(kept, folder, key, url, cut, SEED + number, made)
            slots.append(seen.slot)
            what = f"{number + 1}: {cut.where.what}, write {cut.write}, {cut.fate}"
            yield Row(what, f"{seen.words} ({time.monotonic() - began:.0f} s)", "starts, and is whole", seen.is_ok)
    started = sum(slot != "-" for slot in slots)
    yield Row("starts after a cut", f"{started} of {count}: {''.join(slots)}", "all", started == count)


def plan(count: int, writes: Mapping[str, int]) -> list[Cut]:
    """Always the same one. writes: of a whole update, by partition."""
    random, places = Random(SEED), cycle(ORDER)
    fates = {where: cycle(FATES.get(where, tuple(Fate))) for where in ORDER}
    counters = cycle(range(1, max(1, writes["state"]) + 1))
    planned = []
    for number in range(count):
        where = next(places)
        write = next(counters) if where is COUNTERS else random.randrange(1, max(2, writes[where.partition]))
        planned.append(Cut(where, write, next(fates[where]), number % FULL_EACH == 1))
    return planned


def _kept(card: Path, folder: Path, key: Key, bundle: Path, ports: Ports) -> Kept:
    memory = folder / "memory"
    with served(card, folder, SEED) as drive:
        with powered(drive.url, folder, ports=ports) as guest:
            guest.wait("slots: trying A, 2 tries left")
            wait_for_ssh(guest)
            said(guest, key, ENDED, INSTALL_S)
            look = f"cat >{BUNDLE} && captain update --look {BUNDLE} && sync"
            looked = ssh(guest, key.path, look, INSTALL_S, bundle)
            if looked.returncode:
                raise NotSeenError(f"the bundle is refused: {looked.stdout + looked.stderr}")
            qmp = Qmp(guest.qmp)
            qmp.ask("stop")
            qmp.ask("migrate", uri=f"exec:cat >{memory}")
            while (found := qmp.ask("query-migrate").get("status")) not in ("completed", "failed"):
                time.sleep(0.2)
            if found == "failed":
                raise NotSeenError("QEMU cannot keep the machine's memory")
        drive.cut(Fate.KEEP)
    within = _within("root-a")
    return Kept(card, memory, ports, digest_of(card, within.start, len(within)))


@contextmanager
def _resumed(kept: Kept, folder: Path, seed: int) -> Iterator[tuple[Guest, Drive]]:
    """The kept machine, going on, with a copy of its card."""
    card = folder / CARD
    subprocess.run(["cp", "--sparse=always", kept.card, card], check=True)
    with served(card, folder, seed) as drive:
        words = ["-incoming", f"exec:cat {kept.memory}"]
        with powered(drive.url, folder, words, kept.ports) as guest:
            qmp = Qmp(guest.qmp)
            while qmp.ask("query-status").get("status") == "inmigrate":
                time.sleep(0.1)
            qmp.ask("cont")
            yield guest, drive


def _whole(kept: Kept, folder: Path, key: Key) -> tuple[dict[str, int], float]:
    """How often an update that is not cut writes to each partition; seconds."""
    with _resumed(kept, folder, SEED) as (guest, drive):
        began = time.monotonic()
        ended = ssh(guest, key.path, f"captain update {BUNDLE}", INSTALL_S)
        if ended.returncode:
            raise NotSeenError(f"the update fails: {ended.stdout + ended.stderr}")
        took_s = time.monotonic() - began
        return {name: _writes(drive, name) for name in ("data", "root-b", "state")}, took_s


def _writes(drive: Drive, name: str) -> int:
    within = _within(name)
    return sum(drive.writes[mib] for mib in range(within.start // MIB, within.stop // MIB))


def _cut(kept: Kept, folder: Path, key: Key, url: str, cut: Cut, seed: int, made: Bundles) -> Seen:
    """At an earlier write where that one does not come: writes that the kernel joins are fewer than those counted."""
    planned = cut.write
    while not _is_met(kept, folder, key, url, cut, seed):
        if cut.write == 1:
            return Seen("-", "is not met: nothing was written there", False)
        cut = cut._replace(write=cut.write - max(1, cut.write // 4))
    at = f"at {cut.write}, as no {planned} came: " if cut.write < planned else ""
    try:
        seen = _after(folder, cut, kept, made)
    except NotSeenError as error:
        seen = Seen("-", str(error).splitlines()[0][:60], False)
    return seen._replace(words=at + seen.words)


def _is_met(kept: Kept, folder: Path, key: Key, url: str, cut: Cut, seed: int) -> bool:
    """Whether the power went at that write, and not once the update had ended."""
    with _resumed(kept, folder, seed) as (guest, drive):
        drive.arm(cut.write, cut.fate, within=_within(cut.where.partition))

        def install() -> None:
            with suppress(subprocess.SubprocessError):
                ssh(guest, key.path, f"captain update {cut.where.command.replace('URL', url)}", INSTALL_S)

        working = threading.Thread(target=install, daemon=True)
        working.start()
        while working.is_alive() and not drive.is_cut.wait(1.0):
            pass
        is_met = drive.is_cut.is_set()
        drive.cut(cut.fate)
        guest.cut()
        working.join(60)
    return is_met


def _after(folder: Path, cut: Cut, kept: Kept, made: Bundles) -> Seen:
    """Which slot starts, and whether all that it starts from is what it has to be. Raises NotSeenError: none does."""
    card = folder / CARD
    counters = _counters(card)
    beats = [0, 1]
    with powered(card, folder) as guest:
        slot = guest.wait(r"slots: trying ([AB]), ").group(1)
        guest.wait("Starting kernel")
        if cut.is_full:
            with user(guest.ports) as one:
                beats = [one.heartbeat(), one.heartbeat()]
    within = _within(f"root-{slot.lower()}")
    is_new = slot == "B"
    digest = digest_of(card, within.start, made.octets if is_new else len(within))
    is_whole = digest == (made.digest if is_new else kept.a_digest) and not (is_new and cut.where.is_early)
    trouble = "" if cut.is_full else _fsck(card)
    seen = f"{slot} {'whole' if is_whole else 'is not whole'}, {counters}"
    seen += f", heartbeats {beats[0]}, {beats[1]}" if cut.is_full else ""
    return Seen(slot, seen + trouble, is_whole and beats[1] == beats[0] + 1 and not trouble)


def _fsck(card: Path) -> str:
    """What is wrong with the data once its journal was played back, as the early boot does; empty: nothing."""
    tools = bundles.TOOLS
    loader = next(tools.glob("usr/lib/*/ld-linux*.so.*"))
    words = [loader, "--library-path", loader.parent, tools / "usr/sbin/e2fsck"]
    # A copy of it alone: e2fsck opens what it has played a journal back into once more, and without an offset.
    within, data = _within("data"), card.with_suffix(".data")
    copy = ["dd", f"if={card}", f"of={data}", "bs=1M", f"skip={within.start // MIB}", f"count={len(within) // MIB}"]
    subprocess.run([*copy, "conv=sparse", "status=none"], check=True)
    for option, most in (("-p", 3), ("-fn", 0)):
        ended = subprocess.run([*words, option, data], capture_output=True, text=True, check=False)
        if ended.returncode > most:
            return f"; e2fsck {option}: {ended.returncode}: {ended.stdout[-200:]}"
    return ""


def _counters(card: Path) -> str:
    within = _within("state")
    with card.open("rb") as file:
        file.seek(within.start)
        found = boot_counters.newest(boot_counters.copies_in(file.read(len(within))))
    if found is None:
        return "no counters"
    return f"order {' '.join(found.order)}, left {found.a_left} {found.b_left}, new {found.new}"


def _within(name: str) -> range:
    """Of a partition, octets of the card."""
    description: Description = read(bundles.PROJECT / "image/image.toml")
    place = next(place for place in disk.places(description.disk) if place.partition.name == name)
    return range(place.offset, place.offset + place.partition.size_mib * MIB)


class Qmp:
    """QEMU's own commands. Source: QEMU's docs/interop/qmp-spec."""

    def __init__(self, place: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.connect(str(place))
        self._file = self._socket.makefile("rw")
        self._file.readline()
        self.ask("qmp_capabilities")

    def ask(self, command: str, **arguments: object) -> dict[str, Any]:
        """What it returns. Raises NotSeenError."""
        self._file.write(json.dumps({"execute": command, "arguments": arguments}) + "\n")
        self._file.flush()
        while line := self._file.readline():
            found = json.loads(line)
            if "return" in found:
                return dict(found["return"])
            if "error" in found:
                raise NotSeenError(f"QEMU, {command}: {found['error'].get('desc')}")
        raise NotSeenError(f"QEMU has ended before it answered {command}")
