"""Guest with the card: U-Boot, boot script, kernel, units and programs.

Words on the kernel's command line give process 1 a unit of the bench: root's agent, which comes with the project's
files by 9p. They are typed at the boot loader's prompt, as anyone with the cable may. On the card only the owner's
files are changed.
"""

import base64
import select
import socket
import subprocess
import time
from dataclasses import dataclass, field
from pathlib import Path

from tests.proof.clock.files import BOARD, captain
from tests.proof.clock.machine import COMPILED, MADE, PROJECT, Guest, LateError
from tests.proof.image.machine import LOADER, put

INSIDE = "/run/bench"  # the project's files in the guest
RECEIVER_PLACE = "1-1"  # of USB
TOLD_S = 60.0  # until the boot loader says its next word: a second on a quiet machine
LINE = 400  # octets that U-Boot takes at once: it drops what is beyond 511
STATION = ("chrony.service", "captain.service")

_SHARE = "trans=virtio,version=9p2000.L,ro,cache=loose,msize=1048576"
_UNIT = f"""\
[Unit]
After=local-fs.target
[Service]
ExecStartPre=/bin/mkdir -p {INSIDE}
ExecStartPre=/sbin/modprobe -a 9pnet_virtio 9p
ExecStartPre=/bin/mount -t 9p -o {_SHARE} bench {INSIDE}
ExecStart=/bin/sh {INSIDE}/tests/proof/clock/guest/on_card
"""
_CREDENTIAL = "systemd.set_credential_binary=systemd.extra-unit.bench.service"
WORDS = f"{_CREDENTIAL}:{base64.b64encode(_UNIT.encode()).decode()} systemd.wants=bench.service systemd.default_device_timeout_sec=600"


def prepare() -> None:
    """Make the bench's Python for the guest, and the device tree, where they are not."""
    subprocess.run([PROJECT / ".ci/clock"], check=True)


@dataclass(frozen=True)
class Card:
    """What such a guest is made of.

    image        a card, of which each guest gets a copy.
    device_tree  of QEMU's machine with a pulse, in place of the one that it makes.
    owned        further files of its owner, by name.
    """

    image: Path
    device_tree: Path = MADE / "pps.dtb"
    owned: dict[str, str] = field(default_factory=dict)
    boot_s: float = 400.0  # 50 on a quiet machine
    lead_s: int = 330
    python: tuple[str, ...] = (f"{INSIDE}/build/clock/root/usr/bin/python3.13",)

    def words(self, folder: Path, name: str, date: str, console: Path) -> list[str]:
        card = folder / f"{name}.img"
        if not card.exists():  # else it had power before
            subprocess.run(["cp", "--sparse=always", self.image, card], check=True)
        place = f'usb = "{RECEIVER_PLACE}"'
        put(card, {"captain.toml": captain(name, place), "board.toml": BOARD} | self.owned)
        return [
            *("-M", "virt,acpi=off", "-cpu", "cortex-a72", "-smp", "1", "-m", "1024", "-accel", "tcg,thread=multi"),
            *("-dtb", str(self.device_tree), "-rtc", f"base={date}", "-device", "virtio-rng-pci"),
            *("-bios", str(LOADER), "-drive", f"file={card},format=raw,if=virtio"),
            *("-chardev", f"socket,id=con,path={folder / name}.con,server=on,wait=off,logfile={console}"),
            *("-serial", "chardev:con", "-device", "qemu-xhci,id=usb"),
            *_shared("bench", PROJECT, ",readonly=on"),
            *_shared("compiled", COMPILED, ""),
        ]

    def has_power(self, folder: Path, name: str) -> None:
        """Talk to its boot loader. Raises LateError."""
        with _Dialog(folder / f"{name}.con") as dialog:
            dialog.wait("Hit any key")
            for line in (" ", *typed(WORDS)):
                dialog.say(line)
                dialog.wait("=> ")
            dialog.say("boot\n")
            dialog.wait("Starting kernel")

    def receiver(self, path: str) -> list[str]:
        """A receiver's port: a serial port at USB."""
        return ["-chardev", f"serial,id=gnss,path={path}", "-device", "usb-serial,chardev=gnss,bus=usb.0,port=1"]

    def hold(self, guest: Guest) -> None:
        """Stop what it has started by itself."""
        guest.run(["systemctl", "stop", *STATION], _nobody)

    def start(self, guest: Guest, name: str, interfaces: str) -> None:
        assert not interfaces, "a card has one network"
        guest.run(["systemctl", "start", "--no-block", *STATION], _nobody)
        units = (word for unit in STATION for word in ("-u", unit))
        guest.start("captain", "journalctl", "--follow", "--lines=0", "--output=cat", *units)


def typed(words: str) -> list[str]:
    """Lines for the boot loader, which add words to those of the kernel's command line."""
    pieces = [words[at : at + LINE] for at in range(0, len(words), LINE)]
    return [f'setenv extra_args "${{extra_args}}{piece}"\n' for piece in pieces]


class _Dialog:
    """With a boot loader, word by word: nothing else goes on meanwhile."""

    def __init__(self, path: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX)
        self._heard = ""
        ends = time.monotonic() + TOLD_S
        while self._socket.connect_ex(str(path)):
            if time.monotonic() > ends:
                raise LateError(f"{path}: QEMU does not make it")
            time.sleep(0.01)  # U-Boot waits 2 s for a key, and what it says before is lost

    def __enter__(self) -> "_Dialog":
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()  # what is said from now on goes to the file alone

    def say(self, text: str) -> None:
        self._socket.sendall(text.encode())

    def wait(self, word: str) -> None:
        while word not in self._heard:
            is_readable, _, _ = select.select([self._socket], [], [], TOLD_S)
            octets = self._socket.recv(4096) if is_readable else b""
            if not octets:
                raise LateError(f"the boot loader does not say {word!r}, but:\n{self._heard[-1000:]}")
            self._heard += octets.decode(errors="replace")
        self._heard = self._heard.partition(word)[2]


def _shared(tag: str, path: Path, mode: str) -> list[str]:
    return ["-virtfs", f"local,path={path},mount_tag={tag},security_model=none,multidevs=remap{mode}"]


def _nobody(answer: object) -> None: ...
