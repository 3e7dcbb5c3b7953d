"""A start that hangs before systemd looks after it: the watchdog ends it, and the boot loader has counted the try."""

import time
from collections.abc import Iterator
from pathlib import Path

from tests.proof.image.machine import owned, powered
from tests.proof.image.root_shell import EXTRA, RootShell
from tests.proof.image.rows import Options, Row

DEVICE = ("-device", "i6300esb")
HANGS = "init=/usr/bin/cat"  # waits for a word of the console, and never asks the watchdog to wait as well
LIMIT_S = 600  # of early/init
SYSTEMDS_S = 15  # of system.conf.d/captain.conf
KEPT = "cd /sys/class/watchdog/watchdog0 && echo $(cat state timeout)"


def rows(card: Path, folder: Path, _options: Options) -> Iterator[Row]:
    own = owned(card, folder, {})
    shell = RootShell(folder)
    with powered(own, folder, [*shell.words, *DEVICE]) as guest:
        guest.stop_loader(HANGS)
        guest.wait("slots: trying A, 2 tries left")
        began = time.monotonic()
        guest.stop_loader(EXTRA)
        took_s = time.monotonic() - began
        said = f"restarted after {took_s:.0f} s"
        yield Row("a start that hangs before systemd", said, f"{LIMIT_S} s or more", took_s >= LIMIT_S)
        left = guest.wait("slots: trying A, (\\d) tries left").group(1)
        yield Row("tries of its slot", f"{left} left", "1 left", left == "1")
        shell.open()
        state = shell.run("systemctl is-system-running --wait", 900).split()[-1]
        yield Row("the start after it", state, "running", state == "running")
        kept = shell.run(KEPT).splitlines()[-1]
        yield Row("the watchdog then, which systemd has", kept, f"active {SYSTEMDS_S}", kept == f"active {SYSTEMDS_S}")
        shell.close()
