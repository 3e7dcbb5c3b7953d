"""The data partition in trouble: what the early boot makes of it, what the station says, and how much is written at rest."""

import json
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import NamedTuple

from image.description import read
from image.filesystem.disk import MIB
from tests.proof.image.drive import FLUSH
from tests.proof.image.login import new_key
from tests.proof.image.machine import NotSeenError, Ports, owned, powered, virt
from tests.proof.image.power import FOUND, QUICK_S, Power
from tests.proof.image.quick import MADE, PROJECT, Quick, offset
from tests.proof.image.root_shell import EXTRA, RootShell
from tests.proof.image.rows import Options, Row
from tests.proof.image.user import user

SEED = 6
BLOCK = 4096
# A card of 32 GB takes some 10 TB before it is worn out (a cell is written 300 times at least), and writes up to 50 octets
# for one where they come in small pieces: 2 MiB an hour are ten years.
MOST_MIB_PER_HOUR = 2.0
SEEN_S = 90.0  # the station looks every ten seconds
# What is done once: modules that are not there are powered three times and given up; after a quarter of an hour systemd
# clears old temporary files. Then the measure is as long as what is done again and again: the time is kept so often.
SETTLED_S, SHORT_SETTLED_S = 1200.0, 300.0
REST_S, SHORT_REST_S = 900.0, 60.0


class Trouble(NamedTuple):
    """What is done to the data partition of a fresh card, and what then has to be mounted in its place.

    kind  of the file system. says: of the early boot.
    """

    what: str
    do: Callable[["Partition"], None]
    kind: str
    says: str
    options: str = ""


class Partition:
    """The data partition of a card that is switched off."""

    def __init__(self, card: Path) -> None:
        description = read(PROJECT / "image/image.toml")
        self._card = card
        self._offset = offset(description, "data")
        self.size = description.disk.partition("data").size_mib * MIB

    def write(self, octets: bytes, at: int = 0) -> None:
        with self._card.open("r+b") as file:
            file.seek(self._offset + at)
            file.write(octets)

    def fill(self, octets: bytes) -> None:
        for at in range(0, self.size, len(octets)):
            self.write(octets, at)

    def blocks(self, question: str) -> list[int]:
        """Numbers that debugfs answers."""
        tools = MADE / "tools"
        loader = next(tools.glob("usr/lib/*/ld-linux*.so.*"))
        words: list[str | Path] = [loader, "--library-path", loader.parent, tools / "usr/sbin/debugfs", "-R", question]
        said = subprocess.run(
            [*words, f"{self._card}?offset={self._offset}"], capture_output=True, text=True, check=True
        ).stdout
        return [int(word) for word in said.replace(":", " ").replace(",", " ").split() if word.isdecimal()]


def _nothing(_: Partition) -> None: ...


def _superblock(partition: Partition) -> None:
    partition.write(bytes(BLOCK))


def _journal(partition: Partition) -> None:
    for block in partition.blocks("blocks <8>"):
        partition.write(bytes(BLOCK), block * BLOCK)


def _inodes(partition: Partition) -> None:
    """The first inodes, the root folder's among them."""
    block = partition.blocks("imap <2>")[-1]
    partition.write(Random(SEED).randbytes(4 * BLOCK), block * BLOCK)


def _first_group(partition: Partition) -> None:
    partition.write(Random(SEED).randbytes(8 * MIB))


def _garbage(partition: Partition) -> None:
    partition.fill(Random(SEED).randbytes(8 * MIB))


def _zeros(partition: Partition) -> None:
    partition.fill(bytes(8 * MIB))


def _erased(partition: Partition) -> None:
    partition.fill(b"\xff" * 8 * MIB)


def _one_file(partition: Partition) -> None:
    """Blank, but for a file of somebody's that no file system is left of."""
    _zeros(partition)
    partition.write(b"a letter", 128 * MIB)


def _none(partition: Partition) -> None:
    partition.write(bytes(64), 446 - MIB)  # its row in the table that lies before it


TROUBLES = (
    Trouble("nothing is wrong", _nothing, "ext4", ""),
    Trouble("its superblock is gone", _superblock, "ext4", "repair"),
    Trouble("its journal is zeros", _journal, "ext4", "repair"),
    Trouble("its first inodes are random octets", _inodes, "ext4", "repair"),
    Trouble("its first 8 MiB are random octets", _first_group, "ext4", "repair"),
    Trouble("all of it is random octets", _garbage, "tmpfs", "cannot be mounted: changes are in memory"),
    Trouble("it was never formatted: zeros", _zeros, "ext4", "is blank: formatting"),
    Trouble("it was never formatted: erased", _erased, "ext4", "is blank: formatting"),
    Trouble("blank, but for somebody's octets", _one_file, "tmpfs", "cannot be mounted"),
    Trouble("there is no such partition", _none, "tmpfs", "no partition 6"),
    Trouble("the card takes no writes", _nothing, "overlay", "takes no writes", ",readonly=on"),
)
SHORT = ("its journal is zeros", "all of it is random octets", "the card takes no writes")


def rows(card: Path, folder: Path, options: Options) -> Iterator[Row]:
    for trouble in TROUBLES:
        if not options.is_short or trouble.what in SHORT:
            yield _repaired(card, folder, trouble)
    yield from _told(card, folder)
    yield from _at_rest(card, folder, *((SHORT_SETTLED_S, SHORT_REST_S) if options.is_short else (SETTLED_S, REST_S)))


def _repaired(card: Path, folder: Path, trouble: Trouble) -> Row:
    its = folder / "trouble"
    its.mkdir(exist_ok=True)
    copy = owned(card, its, {})
    quick = Quick(copy, its)
    trouble.do(Partition(copy))
    what = f"data: {trouble.what}"
    with powered(copy, its, machine=quick.machine(options=trouble.options)) as guest:
        try:
            told = json.loads(guest.wait(FOUND, QUICK_S)[1] or "null")
        except NotSeenError as error:
            return Row(what, str(error).splitlines()[-1], "starts", False)
    if told is None:
        return Row(what, "the kernel panics", "starts", False)
    notes = "; ".join(note for note in told["notes"] if note.startswith("data:"))
    is_clean = trouble.kind != "ext4" or not told["fsck"]
    is_ok = told["fs"] == trouble.kind and trouble.says in notes and is_clean
    return Row(what, f"{told['fs']}: {notes or 'nothing is said'}", f"{trouble.kind}: {trouble.says}", is_ok)


def _told(card: Path, folder: Path) -> Iterator[Row]:
    """By a whole system, which goes on in each case."""
    its = folder / "told"
    its.mkdir()
    copy = owned(card, its, {"authorized_keys": new_key(its).line})
    with _station(copy, its) as (shell, ports):
        shell.run("cat /dev/zero >/data/fill; cat /dev/zero >>/data/fill; df /data")
        yield _state(shell, ports, "data is full", "full", "No space left")
        shell.run("rm /data/fill; sync")
        yield _state(shell, ports, "and has room again", "kept", "")
        # The shell looks for files of a pattern among words, not behind >.
        shell.run("for at in /sys/fs/ext4/*6/trigger_fs_error; do echo 1 >$at; done; touch /data/x")
        # Since Linux 6.12 the mount stays as it is, and what is written is refused.
        yield _state(shell, ports, "the file system has failed", "kept", "Input/output error")
    with _station(copy, its) as (shell, ports):
        yield _state(shell, ports, "after a restart it is repaired", "kept", "")
        shell.run("systemctl stop captain; umount -l /var/lib/captain /data; systemctl start captain")
        yield _state(shell, ports, "data was unmounted", "memory", "")
    Partition(copy).write(bytes(64), 446 - MIB)
    with _station(copy, its) as (shell, ports):
        yield _state(shell, ports, "there is no data partition", "memory", "")


class _station:  # noqa: N801 - used as a function
    """A started system with a shell of root."""

    def __init__(self, card: Path, folder: Path) -> None:
        self._shell = RootShell(folder)
        self._powered = powered(card, folder, self._shell.words, machine=virt)

    def __enter__(self) -> tuple[RootShell, Ports]:
        guest = self._powered.__enter__()
        guest.stop_loader(EXTRA)
        self._shell.open()
        with user(guest.ports) as reader:
            reader.heartbeat()
        return self._shell, guest.ports

    def __exit__(self, *_: object) -> None:
        self._shell.close()
        self._powered.__exit__(None, None, None)


def _state(shell: RootShell, ports: Ports, what: str, state: str, refusal: str) -> Row:
    """What status says of a station that was started in this, and whether it speaks."""
    shell.run("systemctl restart captain")
    with user(ports) as reader:
        reader.heartbeat()
    ends = time.monotonic() + SEEN_S
    told: dict[str, object] = {}
    while time.monotonic() < ends and told.get("state") != state:
        said = shell.run("captain status --json")
        told = json.loads(said[said.index("{") :]).get("storage", {}) if "{" in said else {}
    has_trouble = state != "kept" or bool(refusal)
    is_told = refusal in str(told.get("last_refusal")) and bool(told.get("hint")) == has_trouble
    seen = f"{told.get('state')}, {told.get('refused')} refused: {told.get('hint') or 'nothing to do'}"
    goal = f"answers, {state}, {refusal}{' and a hint' if has_trouble else ''}"
    return Row(f"station: {what}", seen, goal, told.get("state") == state and is_told)


def _at_rest(card: Path, folder: Path, settled_s: float, rest_s: float) -> Iterator[Row]:
    """What a station that does nothing writes to its card."""
    its = folder / "rest"
    its.mkdir()
    power = Power(card, its, SEED)
    try:
        look = power.look_full()
        _pass(settled_s)
        before, flushes = power.octets("data"), power.drive.requests[FLUSH]
        began = time.monotonic()
        _pass(rest_s)
        hours = (time.monotonic() - began) / 3600
        mib = (power.octets("data") - before) / MIB / hours
        per_hour = (power.drive.requests[FLUSH] - flushes) / hours
    finally:
        power.close()
    is_ok = mib <= MOST_MIB_PER_HOUR and not look.troubles
    yield Row(
        "written to the card at rest",
        f"{mib:.2f} MiB an hour, {per_hour:.0f} flushes",
        f"{MOST_MIB_PER_HOUR:g} MiB",
        is_ok,
    )


def _pass(seconds: float) -> None:
    """A time that is the measure itself."""
    time.sleep(seconds)
