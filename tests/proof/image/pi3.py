"""The same card in an emulated Raspberry Pi 3, by the Pi's own U-Boot: screen and `captain status` over serial.

No QEMU of today emulates a Pi 4's card or network; of a Pi 3 it has neither Wi-Fi nor Ethernet.
"""

import os
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

from tests.proof.image.machine import Guest, Ports, owned, partition_offset, powered
from tests.proof.image.rows import Options, Row
from tests.proof.image.screen import ALLOWED, HEAD, PROMPT, Screen

LOADER, TREE = "u-boot.bin", "bcm2837-rpi-3-b.dtb"
# QEMU's mini UART sends what sets its speed: of 400 MHz * 2 / 16 / 115200 the lower octet, b2, which is no UTF-8.
DIVISOR = "\ufffd"
LIMIT_S = 600.0  # four emulated processors on two: the screen, which is waited for longest, comes within 340 s
# What a Pi does in a second takes this machine up to a minute: nothing is given up for that.
PATIENT = "systemd.default_timeout_start_sec=3600 systemd.service_watchdogs=no systemd.watchdog_sec=0"
SHELLS = 10
FAILED = "echo failed: $(systemctl --failed --plain --no-legend | cut -d ' ' -f 1)"


def rows(card: Path, folder: Path, _options: Options) -> Iterator[Row]:
    own = owned(card, folder, {})
    size = own.stat().st_size
    is_power = size & size - 1 == 0
    yield Row("the card's size", f"{size >> 20} MiB", "a power of two: QEMU's cards are", is_power)
    for name in (LOADER, TREE):
        _taken(own, name, folder)

    def machine(card: Path, _: Ports) -> list[str]:
        return [
            *("-M", "raspi3b", "-kernel", str(folder / LOADER), "-dtb", str(folder / TREE)),
            *("-drive", f"file={card},if=sd,format=raw", "-serial", "null", "-serial", "chardev:con"),
        ]

    with powered(own, folder, machine=machine) as guest:
        yield from _started(guest)


def _started(guest: Guest) -> Iterator[Row]:
    guest.stop_loader(PATIENT)
    guest.wait("slots: trying A, 2 tries left", LIMIT_S)
    guest.wait("Starting kernel", LIMIT_S)
    yield Row("the Pi's U-Boot starts slot A", f"{time.monotonic() - guest.began:.0f} s after power", "", True)
    screen = Screen(guest, DIVISOR)
    screen.wait(HEAD, LIMIT_S)
    after_s = time.monotonic() - guest.began
    screen.settle()  # a code may have come in part
    is_plain = ALLOWED.fullmatch(screen.sent) is not None
    yield Row("the station's screen over serial", f"{after_s:.0f} s after power", "ASCII, VT100", is_plain)
    screen.type("s")
    screen.wait(PROMPT, LIMIT_S)
    found = screen.run("captain status | head -n 20", r"(?m)^.*\bup \d+.*$", LIMIT_S)
    yield Row("captain status, typed there", found.group().strip()[:40], "answers", True)
    for _ in range(SHELLS):  # QEMU's mini UART falls silent for good when it is set up while an octet is under way
        screen.forget()
        screen.type("exit\r")
        screen.wait(HEAD, LIMIT_S)
        screen.forget()
        screen.type("s")
        screen.wait(PROMPT, LIMIT_S)
    yield Row("shells left and opened again", str(SHELLS), "one after the other", True)
    state = screen.run("systemctl is-system-running --wait", "(?m)^(running|degraded|starting)", LIMIT_S).group()
    failed = screen.run(FAILED, "(?m)^failed:(.*)$", LIMIT_S).group(1).strip()
    yield Row("systemd", state, "running", state == "running")
    yield Row("units that have failed", failed or "none", "none", not failed)
    model = screen.run("tr '\\0' '\\n' </proc/device-tree/model; echo", "(?m)^Raspberry.*$", LIMIT_S).group()
    yield Row("the machine, as its device tree says", model, "a Raspberry Pi 3", "Pi 3" in model)


def _taken(card: Path, name: str, folder: Path) -> None:
    """A file of the boot partition: what the Pi's firmware would load."""
    words = ["mcopy", "-o", "-i", f"{card}@@{partition_offset(card)}", f"::{name}", str(folder / name)]
    subprocess.run(words, check=True, env={**os.environ, "MTOOLS_SKIP_CHECK": "1"})
