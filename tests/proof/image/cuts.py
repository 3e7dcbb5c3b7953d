"""Power cuts during writes, updates and starts, on a drive that loses data.

Most starts are quick: the card's own kernel, early boot, root and data. In place of systemd runs a workload that
writes by the station's own code (workload.py). U-Boot and the whole system have their share.
"""

import itertools
import json
import statistics
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from random import Random
from typing import NamedTuple

from tests.proof.image.machine import NotSeenError
from tests.proof.image.medium import Fate, Loss
from tests.proof.image.power import Look, Power
from tests.proof.image.rows import Options, Row

SEED = 20_261_122
COUNT, SHORT = 100, 10
MOST_LOST_S = 1.0
LIARS = 6  # cuts at a drive that ignores what it is told to flush
FATES = (Fate.DROP, Fate.SHUFFLE, Fate.TEAR, Fate.DROP, Fate.SHUFFLE, Fate.TEAR, Fate.TEAR, Fate.SHUFFLE, Fate.KEEP)


class Kind(NamedTuple):
    """Where a cut comes, and by which start it is looked at.

    share     of 100.
    is_quick  a matter of seconds, emulated: the short form has these alone.
    """

    what: str
    cut: str
    look: str
    share: int
    is_quick: bool = True


KINDS = (
    Kind("while the station writes", "cut_work", "look_quick", 74),
    Kind("while the early boot repairs", "cut_start", "look_quick", 10),
    Kind("while U-Boot counts", "cut_loader", "look_loader", 10),
    Kind("while the whole system starts", "cut_full_start", "look_full", 3, is_quick=False),
    Kind("while the whole system runs", "cut_full_run", "look_full", 3, is_quick=False),
)
ALWAYS = "recording"  # goes on in every cut of the workload
# Shares of the workload's cuts: a third of what two runs had, 44 and 49 of 74, 13 and 9. Of few cuts none may meet an update.
LEAST = {"configuration": 0.2, "update": 0.05}
NAMES = {"owner": "configuration", "state": "configuration", "session": "state", "counters": "update", "slot": "update"}


class Cut(NamedTuple):
    """One cut and the start after it."""

    kind: Kind
    fate: Fate
    during: tuple[str, ...]
    loss: Loss
    look: Look
    took_s: float

    @property
    def words(self) -> str:
        found = "; ".join(self.look.troubles) or "clean"
        return f"{self.kind.what}, a drive that {self.fate}: {found} ({self.took_s:.0f} s)"


def rows(card: Path, folder: Path, options: Options) -> Iterator[Row]:
    count = options.count or (SHORT if options.is_short else COUNT)
    began = time.monotonic()
    cuts: list[Cut] = []
    power = Power(card, folder, SEED)
    try:
        first = power.look_quick()
        if first.troubles:
            raise NotSeenError(f"before any cut: {'; '.join(first.troubles)}")
        for cut in _cuts(power, plan(count, options.is_short)):
            cuts.append(cut)
            _keep(folder / "cuts.log", cut)
            print(f"        cut {len(cuts)} of {count}, {cut.words}", file=sys.stderr, flush=True)
    finally:
        power.close()
    yield from _clean(cuts)
    yield from _kept(cuts)
    yield Row("seconds for a cut and the start after it", _spread([cut.took_s for cut in cuts]), "", True)
    yield Row("all of it", f"{(time.monotonic() - began) / 60:.0f} min", "", True)
    if not options.is_short:
        yield _liar(card, folder)


def plan(count: int, is_short: bool = False) -> list[tuple[Kind, Fate]]:
    """Every kind by its share, one of each at least, in a mixed order that is always the same."""
    taken = [kind for kind in KINDS if kind.is_quick or not is_short]
    shares = [max(1, round(kind.share * count / 100)) for kind in taken]
    shares[0] = max(1, count - sum(shares[1:]))
    kinds = [kind for kind, share in zip(taken, shares, strict=True) for _ in range(share)][:count]
    Random(SEED).shuffle(kinds)
    fates = {kind: itertools.cycle(FATES) for kind in KINDS}
    return [(kind, next(fates[kind])) for kind in kinds]


def _cuts(power: Power, planned: Sequence[tuple[Kind, Fate]]) -> Iterator[Cut]:
    for kind, fate in planned:
        began = time.monotonic()
        try:
            getattr(power, kind.cut)(fate)
            during = tuple(power.ledger.in_progress) if kind is KINDS[0] else ()
            loss = power.drive.loss
            look = getattr(power, kind.look)()
        except NotSeenError as error:
            power.off()
            during, loss, look = (), power.drive.loss, Look((str(error)[-500:],))
        yield Cut(kind, fate, during, loss, look, time.monotonic() - began)


def _clean(cuts: Sequence[Cut]) -> Iterator[Row]:
    yield _share("power cuts, and clean starts after them", cuts)
    shares = [(kind.what, [cut for cut in cuts if cut.kind is kind]) for kind in KINDS]
    shares += [(f"a drive that {fate}", [cut for cut in cuts if cut.fate is fate]) for fate in Fate]
    yield from (_share(what, its) for what, its in shares if its)
    work = [cut for cut in cuts if cut.kind is KINDS[0]]
    during = Counter(NAMES[name.partition("-")[0]] for cut in work for name in set(cut.during))
    seen = ", ".join(f"{what} {number}" for what, number in sorted(during.items()))
    least = {what: int(share * len(work)) for what, share in LEAST.items()}
    goal = ", ".join(f"{what} {number}" for what, number in least.items())
    is_met = bool(work) and all(during[what] >= number for what, number in least.items())
    yield Row("in the middle of", f"{seen}, {ALWAYS} {len(work)}", f"at least {goal}", is_met)
    pending = sum(cut.loss.pending for cut in cuts)
    torn, gone = sum(cut.loss.torn for cut in cuts), sum(cut.loss.gone for cut in cuts)
    yield Row("writes that the cuts met", f"{pending}: {gone} gone, {torn} torn", "", True)


def _kept(cuts: Sequence[Cut]) -> Iterator[Row]:
    troubles = [trouble for cut in cuts for trouble in cut.look.troubles]
    yield Row("torn, lost or changed", "; ".join(troubles)[:300] or "nothing", "nothing", not troubles)
    lost = [cut.look.lost_s for cut in cuts if cut.kind is KINDS[0]]
    if lost:
        worst = max(lost)
        seen = f"{worst:.2f} s at most, median {statistics.median(lost):.2f} s"
        yield Row("lost of a recording", seen, f"{MOST_LOST_S} s", worst <= MOST_LOST_S)
    torn = sum(cut.look.is_torn for cut in cuts)
    yield Row("recordings whose last message was torn", f"{torn} of {len(lost)}", "cut off by the reader", True)
    repaired = sum(any("repair" in note for note in cut.look.notes) for cut in cuts)
    yield Row("starts with a repair beyond the journal", str(repaired), "", True)


def _share(what: str, cuts: Sequence[Cut]) -> Row:
    clean = sum(not cut.look.troubles for cut in cuts)
    return Row(what, f"{len(cuts)} cuts, {clean} clean", "all", clean == len(cuts))


def _spread(seconds: Sequence[float]) -> str:
    return f"{statistics.median(seconds):.0f}, {min(seconds):.0f} to {max(seconds):.0f}" if seconds else ""


def _liar(card: Path, folder: Path) -> Row:
    """Whether the measure sees damage where there has to be some: a drive that keeps nothing it was told to flush."""
    its = folder / "liar"
    its.mkdir()
    power = Power(card, its, SEED, is_honest=False)
    try:
        power.look_quick()
        found = list(_cuts(power, [(KINDS[0], Fate.SHUFFLE)] * LIARS))
    finally:
        power.close()
    noticed = sum(bool(cut.look.troubles) or cut.look.lost_s > MOST_LOST_S for cut in found)
    return Row("damage seen at a drive that ignores flushes", f"{noticed} of {LIARS}", "some", noticed > 0)


def _keep(path: Path, cut: Cut) -> None:
    """All that is known of a cut, beside what the consoles say."""
    told = {**cut._asdict(), "kind": cut.kind.what, "loss": cut.loss._asdict(), "look": cut.look._asdict()}
    with path.open("a") as file:
        file.write(f"{json.dumps(told)}\n")
