"""A card at a drive that loses power: started in several ways, cut at chosen moments, and looked at after each cut."""

import json
import subprocess
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from random import Random
from typing import NamedTuple

from board.runtime import boot_counters
from image.description import Description, read
from tests.proof.image.drive import FLUSH, MIB, Drive, served
from tests.proof.image.ledger import Ledger
from tests.proof.image.machine import Guest, Machine, NotSeenError, powered, virt
from tests.proof.image.medium import Fate, Loss
from tests.proof.image.quick import PROJECT, Quick, offset
from tests.proof.image.user import user
from tests.proof.image.workload import SLOT_OCTETS

FOUND = r"@found (\{[^\r\n]*\})\r?\n|Kernel panic"
COUNTERS = r"slots: state of copy (\w+), order ([AB ]+), tries left: A (\w+), B (\w+)"
MEMORY = "changes are in memory"  # message of the early boot without usable data partition
# Bounds of what comes in a few seconds where nobody else wants the processors, and where many do in minutes: only a machine
# that has stopped for good meets them.
ON_S = 300.0  # until QEMU has found the drive
LARGER = 128 << 20  # octets: a card on which the early boot finds room to use
MANY, FEW = 64, 8  # tries of slot A: none of these starts is to be the last one
QUICK_S = 900.0  # a quick start
FULL_S = 1800.0  # a start of the whole system
WORK_S = 900.0  # until the cut that was asked for comes


class Look(NamedTuple):
    """What was found after a cut.

    troubles   in words; none: a clean start.
    lost_s     of the recording; is_torn: its last message was there in part.
    notes      of the early boot.
    """

    troubles: tuple[str, ...] = ()
    lost_s: float = 0.0
    is_torn: bool = False
    notes: tuple[str, ...] = ()


class Power:
    """One card and its drive. Each cut_...() takes its power away, each look_...() starts it after that.

    card    is copied.
    ledger  of what the workload has been told.
    """

    def __init__(self, card: Path, folder: Path, seed: int, is_honest: bool = True) -> None:
        self._folder = folder
        self._card = folder / "card.img"
        subprocess.run(["cp", "--sparse=always", card, self._card], check=True)
        self._description: Description = read(PROJECT / "image/image.toml")
        self._quick = Quick(self._card, folder)
        self._ending = ExitStack()
        self.drive: Drive = self._ending.enter_context(served(self._card, folder, seed, is_honest))
        self._random = Random(seed)
        self.ledger = Ledger()
        self._power = ExitStack()
        self._guest: Guest | None = None
        self._looked: Callable[[], Look] | None = None  # what it was started for
        self._is_slot_bad = False
        # Of its console: how much has been looked at, and what of that has not ended yet.
        self._heard = 0
        self._rest = ""

    def close(self) -> None:
        self.off()
        self._ending.close()

    def cut_work(self, fate: Fate) -> None:
        """In the middle of what the station writes: at a write, at a flush, or after something was acknowledged."""
        guest = self._ready(self.look_quick)
        random = self._random
        numbers = dict(self.ledger.begun)
        guest.type(f"go {json.dumps({'seed': random.getrandbits(32), 'numbers': numbers})}\n")
        way = random.randrange(5)
        if way < 3:
            self.drive.arm(random.randrange(5, 250), fate)
        elif way < 4:
            self.drive.arm(random.randrange(3, 80), fate, FLUSH)
        acknowledged = random.randrange(1, 30) if way == 4 else 1 << 30
        begun = sum(self.ledger.done.values())
        self._listen(guest, lambda: sum(self.ledger.done.values()) - begun >= acknowledged, WORK_S)
        self._cut(fate)

    def cut_start(self, fate: Fate) -> None:
        """While the early boot makes the data partition larger, repairs it and mounts it."""
        self.off()
        self.drive.medium.grow(LARGER)
        self.drive.arm(self._random.randrange(1, 16), fate)
        guest = self._on(self._quick.machine())
        self._listen(guest, lambda: "@found" in guest.text, QUICK_S)
        self._cut(fate)

    def cut_loader(self, fate: Fate) -> None:
        """While U-Boot counts a try down."""
        self.off()
        self._refill()
        self._settle_counters()
        first = offset(self._description, "state")
        self.drive.arm(1, fate, within=range(first, first + boot_counters.APART + boot_counters.SIZE))
        guest = self._on(virt)
        self._listen(guest, lambda: "Starting kernel" in guest.text, QUICK_S)
        self._cut(fate)

    def cut_full_start(self, fate: Fate) -> None:
        """Anywhere in a start of the whole system, whose data grow on the way."""
        self.off()
        self._refill()
        self.drive.medium.grow(LARGER)
        self.drive.arm(self._random.randrange(2, 400), fate)
        guest = self._on(virt)
        guest.wait("Starting kernel", QUICK_S)
        with user(guest.ports) as reader:
            self._listen(guest, lambda: bool(reader.received.poll(0)), FULL_S)
        self._cut(fate)

    def cut_full_run(self, fate: Fate) -> None:
        """While the whole system runs: its counters are put back, its journal and its clock are written."""
        guest = self._ready(self.look_full)
        self.drive.arm(self._random.randrange(1, 120), fate)
        ends = time.monotonic() + self._random.uniform(0, 20)
        self._listen(guest, lambda: time.monotonic() > ends, 30.0)
        self._cut(fate)

    def look_quick(self) -> Look:
        """After a cut, by the early boot and the workload; the machine stays on."""
        guest = self._on(self._quick.machine())
        try:
            told = json.loads(guest.wait(FOUND, QUICK_S)[1] or "null")
        except NotSeenError as error:
            return Look((f"it does not start: {str(error)[-300:]}",))
        if told is None:
            self.off()
            return Look(("it does not start: the kernel panics",))
        kept = {**told["kept"], **self._kept_by_loader()}
        records = kept.pop("records")
        troubles = self.ledger.troubles(kept)
        troubles += [f"e2fsck: {told['fsck']}"] if told["fsck"] else []
        troubles += [note for note in told["notes"] if MEMORY in note]
        lost_s = self.ledger.lost_s(records["made_ns"], self.drive.cut_s)
        if records["gaps"]:
            troubles.append(f"records: {records['gaps']} gaps")
        self.ledger.settle(kept)
        self._looked = self.look_quick
        return Look(tuple(troubles), lost_s, bool(records["torn"]), tuple(told["notes"]))

    def look_loader(self) -> Look:
        """After a cut, by U-Boot alone: its counters are those of before or of after, and a kernel starts."""
        before = self.counters()
        guest = self._on(virt)
        try:
            copy, order, a_left, _ = guest.wait(COUNTERS, QUICK_S).groups()
            guest.wait("Starting kernel", QUICK_S)
        except NotSeenError as error:
            return Look((f"it does not start: {str(error)[-300:]}",))
        finally:
            self.off()
        expected = self.ledger.begun.get("counters")
        self._settle_counters()
        if copy == "none" or before is None:
            return Look(("neither copy of the counters is whole",))
        is_known = expected is None or int(a_left, 16) in (expected, expected - 1)
        return Look(() if is_known else (f"tries left: {a_left}, and {expected:x} before; order {order}",))

    def look_full(self) -> Look:
        """After a cut, by the whole system: the endpoint answers. The machine stays on."""
        guest = self._on(virt)
        try:
            copy = guest.wait(COUNTERS, QUICK_S)[1]
            with user(guest.ports) as reader:
                self._listen(guest, lambda: bool(reader.received.poll(0)), FULL_S)
                reader.heartbeat()
        except NotSeenError as error:
            self.off()
            return Look((f"it does not start: {str(error)[-300:]}",))
        troubles = ["neither copy of the counters is whole"] if copy == "none" else []
        troubles += [f"the console says: {MEMORY}"] if MEMORY in guest.text else []
        # This system will change the counters, and has put the set of the boot partition in force.
        self._settle_counters(is_known=False)
        self.ledger.forget("owner")
        self._looked = self.look_full
        return Look(tuple(troubles))

    def counters(self) -> boot_counters.State | None:
        first = offset(self._description, "state")
        octets = self.drive.medium.read(first, boot_counters.APART + boot_counters.SIZE)
        return boot_counters.newest(boot_counters.copies_in(octets))

    def octets(self, name: str) -> int:
        """Written to a partition."""
        first = offset(self._description, name) // MIB
        size = self._description.disk.partition(name).size_mib
        return sum(octets for at, octets in self.drive.octets.items() if first <= at < first + size)

    def _ready(self, look: Callable[[], Look]) -> Guest:
        """A machine that was started for a look and has been idle since; else one that is started for it."""
        if self._guest is None or self._looked != look:
            found = look()
            if self._guest is None or found.troubles:
                raise NotSeenError("; ".join(found.troubles))
        return self._guest

    def _kept_by_loader(self) -> dict[str, object]:
        """The counters, and the slot that an update writes: marked bad, or written whole."""
        found = self.counters()
        if found is None:
            return {"counters": "neither copy is whole", "slot": "neither copy is whole"}
        return {"counters": found.a_left, "slot": self._kept_slot(found.b_left)}

    def _kept_slot(self, b_left: int) -> object:
        before = self.ledger.done.get("slot", 0)
        if b_left == 0:
            self._is_slot_bad |= "slot" in self.ledger.in_progress
            return before if self._is_slot_bad else "counts as bad, and no update was begun"
        self._is_slot_bad = False
        size = self._description.disk.partition("root-b").size_mib * MIB
        octets = self.drive.medium.read(offset(self._description, "root-b") + size - SLOT_OCTETS, SLOT_OCTETS)
        is_whole = octets == octets[:8] * (SLOT_OCTETS // 8)
        if is_whole and int.from_bytes(octets[:8], "big") == b_left:
            return b_left
        return "counts as good, and is not written whole" if before else 0

    def _settle_counters(self, is_known: bool = True) -> None:
        """They are what they are now, or nobody knows what they will be."""
        found = self.counters() if is_known else None
        self.ledger.forget("counters")
        if found is not None:
            self.ledger.begun["counters"] = self.ledger.done["counters"] = found.a_left

    def _on(self, machine: Machine) -> Guest:
        self.off()
        self._heard, self._rest = 0, ""
        self._looked = None
        self._guest = self._power.enter_context(powered(self.drive.url, self._folder, machine=machine))
        if not self.drive.is_powered.wait(ON_S):
            raise NotSeenError("QEMU does not come to its drive")
        return self._guest

    def _refill(self) -> None:
        """Tries, where few are left: a start that is cut takes one and gives none back."""
        found = self.counters()
        if found is not None and found.a_left < FEW:
            first = offset(self._description, "state")
            for at, number in ((0, 1), (boot_counters.APART, 0)):
                self.drive.medium.write(
                    first + at, boot_counters.packed(found._replace(a_left=MANY), number), is_durable=True
                )
            self._settle_counters()

    def off(self) -> None:
        """Of a machine that does nothing: no cut that counts."""
        if self._guest is not None:
            self.drive.cut(Fate.DROP)
            self._power.close()
            self._guest = None

    def _listen(self, guest: Guest, is_done: Callable[[], bool], limit_s: float) -> None:
        """Until it is done, or the power has gone."""
        ends = time.monotonic() + limit_s
        while not (self.drive.is_cut.is_set() or is_done()):
            if time.monotonic() > ends:
                raise NotSeenError(f"nothing came within {limit_s:.0f} s: {guest.text[-800:]}")
            self._hear(guest)

    def _hear(self, guest: Guest) -> bool:
        text = guest.more(self._heard, 0.05)
        self._heard += len(text)
        self._rest = self.ledger.hear(self._rest + text, time.monotonic())
        return bool(text)

    def _cut(self, fate: Fate) -> Loss:
        loss = self.drive.cut(fate)
        guest = self._guest
        assert guest is not None
        ends = time.monotonic() + 1.0  # a kernel without a drive may complain for ever
        while self._hear(guest) and time.monotonic() < ends:
            pass
        self._power.close()
        self._guest = None
        return loss
