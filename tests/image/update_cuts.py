"""Power cuts while an update is installed, on a drive that loses, reorders or tears what was not flushed.

A machine that is about to install is kept as a file: its memory, and its card. Each cut begins with it.
"""

import json
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from image import disk, state
from image.description import read
from tests.image import bundles
from tests.image.drive import WRITE, ZEROES, Drive, served
from tests.image.login import Key, new_key, said, ssh, wait_for_ssh
from tests.image.machine import Guest, NotSeenError, Ports, free_ports, owned, powered
from tests.image.medium import Fate
from tests.image.rows import Options, Row
from tests.image.site import serving
from tests.image.update import ENDED
from tests.image.user import user

COUNT = 10
SEED = 11
WRITES = (WRITE, ZEROES)
INSTALL_S = 900.0


class Kept(NamedTuple):
    """A machine that is about to install. writes: of a whole installation, as the drive sees it."""

    card: Path
    memory: Path
    ports: Ports
    writes: int


def rows(card: Path, folder: Path, options: Options) -> Iterator[Row]:
    count = options.count or (1 if options.is_short else COUNT)
    made = bundles.made(card, folder / "bundles", is_short=True)
    key = new_key(folder)
    own = owned(card, folder, {"authorized_keys": key.line})
    with serving(made.good.parent) as site:
        site_url = site.url(made.good.name)
        kept = _kept(own, folder, key)
        kept = kept._replace(writes=_whole(kept, folder, key, site_url))
        yield Row("writes of a whole update", str(kept.writes), "", kept.writes > 0)
        random = Random(SEED)
        slots: list[str] = []
        for number in range(count):
            # As much at the end, where the counters are written, as all the way before.
            part = random.random() if number % 2 else 1 - 0.02 * random.random()
            at, fate = max(1, round(kept.writes * part)), list(Fate)[number % len(Fate)]
            seen = _cut(kept, folder, key, site_url, at, fate, number)
            slots.append(seen.slot)
            yield Row(
                f"cut {number + 1}: write {at} ({100 * part:.1f} %), {fate}",
                seen.words,
                "starts, and is well",
                seen.is_ok,
            )
        yield Row("starts after a cut", f"{len(slots)} of {count}: {''.join(slots)}", "all", len(slots) == count)


class Seen(NamedTuple):
    slot: str
    words: str
    is_ok: bool


def _kept(card: Path, folder: Path, key: Key) -> Kept:
    ports, memory = free_ports(), folder / "memory"
    with served(card, folder, SEED) as drive:
        with powered(drive.url, folder, ports=ports) as guest:
            guest.wait("slots: trying A, 2 tries left")
            wait_for_ssh(guest)
            said(guest, key, f"{ENDED}; sync", INSTALL_S)
            qmp = Qmp(guest.qmp)
            qmp.ask("stop")
            qmp.ask("migrate", uri=f"exec:cat >{memory}")
            while (found := qmp.ask("query-migrate").get("status")) not in ("completed", "failed"):
                time.sleep(0.2)
            if found == "failed":
                raise NotSeenError("QEMU cannot keep the machine's memory")
        drive.cut(Fate.KEEP)
    return Kept(card, memory, ports, 0)


@contextmanager
def _resumed(kept: Kept, folder: Path, seed: int) -> Iterator[tuple[Guest, Drive, Path]]:
    """The kept machine, going on, with a copy of its card."""
    card = folder / "cut.img"
    subprocess.run(["cp", "--sparse=always", kept.card, card], check=True)
    with served(card, folder, seed) as drive:
        words = ["-incoming", f"exec:cat {kept.memory}"]
        with powered(drive.url, folder, words, kept.ports) as guest:
            qmp = Qmp(guest.qmp)
            while qmp.ask("query-status").get("status") == "inmigrate":
                time.sleep(0.1)
            qmp.ask("cont")
            yield guest, drive, card


def _whole(kept: Kept, folder: Path, key: Key, url: str) -> int:
    with _resumed(kept, folder, SEED) as (guest, drive, _):
        before = sum(drive.requests[kind] for kind in WRITES)
        ended = ssh(guest, key.path, f"captain update {url}", INSTALL_S)
        if ended.returncode:
            raise NotSeenError(f"the update fails: {ended.stdout + ended.stderr}")
        return sum(drive.requests[kind] for kind in WRITES) - before


def _cut(kept: Kept, folder: Path, key: Key, url: str, at: int, fate: Fate, number: int) -> Seen:
    with _resumed(kept, folder, SEED + number) as (guest, drive, card):
        drive.arm(at, fate)

        def install() -> None:
            with suppress(subprocess.SubprocessError):
                ssh(guest, key.path, f"captain update {url}", INSTALL_S)

        working = threading.Thread(target=install, daemon=True)
        working.start()
        # Where the last writes are merged there are fewer of them than in the run that was counted.
        while working.is_alive() and not drive.is_cut.wait(1.0):
            pass
        if not drive.is_cut.is_set():
            drive.cut(fate)
        lost = drive.loss
        guest.cut()
        working.join(60)
    return _after(card, folder, f"{lost}")


def _after(card: Path, folder: Path, lost: str) -> Seen:
    """It starts by itself, and its station beats."""
    counters = _counters(card)
    began = time.monotonic()
    try:
        with powered(card, folder) as guest:
            slot = guest.wait(r"slots: trying ([AB]), ").group(1)
            with user(guest.ports) as one:
                beats = one.heartbeat(), one.heartbeat()
    except NotSeenError as error:
        return Seen("-", str(error).splitlines()[0][:60], False)
    words = f"{slot}, heartbeats {beats[0]}, {beats[1]} after {time.monotonic() - began:.0f} s; {counters}"
    return Seen(slot, words, beats[1] == beats[0] + 1)


def _counters(card: Path) -> str:
    description = read(bundles.PROJECT / "image/image.toml").disk
    place = next(place for place in disk.places(description) if place.partition.name == "state")
    with card.open("rb") as file:
        file.seek(place.offset)
        found = state.newest(file.read(state.APART + state.SIZE))
    if found is None:
        return "no counters"
    return f"order {' '.join(found.order)}, left {found.a_left} {found.b_left}, new {found.new}"


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
