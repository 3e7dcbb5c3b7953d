"""The guest: an emulated computer that boots Debian's kernel and has this machine's files, which it cannot change."""

import os
import subprocess
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

PROJECT = Path(__file__).resolve().parents[3]
BENCH = PROJECT / "build/kernel"
CONSOLE = BENCH / "console.log"

# Where the guest is virtualised itself, a kernel may never get past its boot loader, whatever /dev/kvm promises: it is
# given this long for its first word, and what came of it is written down.
KVM_S = 10.0
ACCELERATOR = BENCH / "accelerator"
KVM = ("-accel", "kvm", "-cpu", "host,-arch-capabilities")
EMULATED = ("-accel", "tcg,thread=multi", "-cpu", "max")


class Guest(NamedTuple):
    """A running guest: what it says, line by line, and how to end it."""

    process: subprocess.Popen[str]

    def lines(self, silence_s: float) -> Iterator[str]:
        """What comes out of its second serial port, until it is off; one that says nothing for so long is."""
        assert self.process.stdout is not None
        line = "\n"
        while line:
            alarm = threading.Timer(silence_s, self.kill)
            alarm.start()
            line = self.process.stdout.readline()
            alarm.cancel()
            yield line.strip()

    def kill(self) -> None:
        """Take away its power; idempotent."""
        self.process.kill()
        self.process.wait()


@contextmanager
def booted(checks: Sequence[str]) -> Iterator[Guest]:
    """A guest that runs checks, options of pytest."""
    guest = Guest(_start(_accelerator(), checks))
    try:
        yield guest
    finally:
        guest.kill()


def _accelerator() -> Sequence[str]:
    """KVM where a guest was seen to start with it, else emulation."""
    if not ACCELERATOR.exists():
        ACCELERATOR.write_text("kvm" if _starts_with_kvm() else "emulated")
    return KVM if ACCELERATOR.read_text() == "kvm" else EMULATED


def _starts_with_kvm() -> bool:
    if not os.access("/dev/kvm", os.R_OK | os.W_OK):
        return False
    guest = Guest(_start(KVM, ["--collect-only"]))
    try:
        return next(guest.lines(KVM_S)) != ""
    finally:
        guest.kill()


def _start(accelerator: Sequence[str], checks: Sequence[str]) -> subprocess.Popen[str]:
    # What the kernel does not know itself it hands to the first program, as its environment.
    given = {"PROJECT": str(PROJECT), "CHECKS": " ".join(checks)}
    # A kernel that has met a mistake of its own is off at once: what it would do from there on is nobody's.
    # Level 5: with its own account of a mistake, which is of level 4.
    words = ["console=ttyS0", "loglevel=5", "oops=panic", "panic=-1"]
    words += [f'{name}="{value}"' for name, value in given.items()]
    command = [
        *("qemu-system-x86_64", "-nodefaults", "-no-user-config", "-display", "none", "-no-reboot"),
        *(*accelerator, "-smp", "2", "-m", "1024"),
        *("-kernel", str(BENCH / "vmlinuz"), "-initrd", str(BENCH / "initrd"), "-append", " ".join(words)),
        *("-serial", f"file:{CONSOLE}", "-serial", "stdio"),
        *("-virtfs", "local,path=/,mount_tag=host,security_model=none,readonly=on,multidevs=remap"),
    ]
    return subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace"
    )
