"""Without a battery for its clock: the box begins at its build's date or at the time it has kept, whichever is later."""

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.proof.image.machine import powered
from tests.proof.image.root_shell import EXTRA, RootShell
from tests.proof.image.rows import Options, Row

KEPT = "/data/identity/clock"
DAY = 86_400
START_S = 1800  # from there to the first look at the clock, at most: emulated, on a busy machine
LATER = "2040-06-01T00:00:00"
LATER_S = 2_222_121_600


def rows(card: Path, folder: Path, options: Options) -> Iterator[Row]:
    own = folder / "card.img"
    subprocess.run(["cp", "--sparse=always", card, own], check=True)
    with _running(own, folder, "1970-01-01T00:00:00") as root:
        built_s = _number(root, "stat -c %Y /usr/lib/clock-epoch")
        yield _begins("power-on in 1970", _now(root), built_s, "the build's date")
        kept_s = built_s + 40 * DAY
        _set(root, kept_s)
        _set(root, kept_s - 10 * DAY)
        found_s = _number(root, f"sync; stat -c %Y {KEPT}")
        yield Row("the time that is kept, once the clock was set back by 10 days", _days(found_s - kept_s, ""),
                  "not before", 0 <= found_s - kept_s < START_S)  # fmt: skip
    with _running(own, folder, "1970-01-01T00:00:00") as root:  # its power was cut
        yield _begins("power-on in 1970, once 40 days were kept", _now(root), kept_s, "the time kept")
    if options.is_short:
        return
    with _running(own, folder, LATER) as root:
        yield _begins("with a clock that is later than either", _now(root), LATER_S, "that clock")


@contextmanager
def _running(card: Path, folder: Path, date: str) -> Iterator[RootShell]:
    shell = RootShell(folder)
    with powered(card, folder, [*shell.words, "-rtc", f"base={date}"]) as guest:
        guest.stop_loader(EXTRA)
        shell.open()
        shell.run("systemctl is-system-running --wait")
        yield shell
        shell.close()


def _now(root: RootShell) -> int:
    return _number(root, "date +%s")


def _number(root: RootShell, command: str) -> int:
    """Behind it there is nothing; before it may be what a shell asks with."""
    return int(root.run(command).split()[-1])


def _set(root: RootShell, at_s: int) -> None:
    """The clock, and what is then kept."""
    root.run(f"date -s @{at_s}; systemctl start captain-keep-clock.service")


def _begins(what: str, now_s: int, expected_s: int, name: str) -> Row:
    return Row(
        f"clock at {what}", _days(now_s - expected_s, name), f"{name}, or later", 0 <= now_s - expected_s < START_S
    )


def _days(later_s: int, name: str) -> str:
    return f"{name}, and {later_s} s" if abs(later_s) < DAY else f"{later_s / DAY:.1f} days from {name}"
