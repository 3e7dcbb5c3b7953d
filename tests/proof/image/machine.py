"""An emulated machine with the very card: U-Boot, the boot script, the slot. What it says is waited for, never a time."""

import os
import re
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

from board.runtime.child import die_with_parent
from tests.system import ports as system

LOADER = Path("/usr/lib/u-boot/qemu_arm64/u-boot.bin")
LIMIT_S = 900.0  # emulated on a busy machine; only a machine that never gets there takes so long


class Ports(NamedTuple):
    """Of this machine's loopback that lead to ports of the guest: ssh, and the endpoint's four."""

    ssh: int
    from_users: int
    to_users: int
    pull: int
    report: int


GUEST = Ports(22, 5555, 5556, 5557, 5558)
Machine = Callable[[Path, Ports], list[str]]


class NotSeenError(Exception):
    """What was waited for did not come; with the last words of the console."""


def user_network(ports: Ports, address: str = "") -> str:
    """QEMU's own network, by which this machine reaches the guest's ports. address: the guest's; empty: by its DHCP."""
    forwards = (f"hostfwd=tcp:127.0.0.1:{own}-{address}:{its}" for own, its in zip(ports, GUEST, strict=True))
    return ",".join(("user,id=eth0", *forwards))


def virt(card: Path, ports: Ports, address: str = "") -> list[str]:
    """A board of no maker, with the card at virtio; its U-Boot is QEMU's. address: of its eth0, as user_network has it."""
    return [
        *BARE_VIRT,
        *("-bios", str(LOADER), "-drive", f"file={card},format=raw,if=virtio"),
        *("-netdev", user_network(ports, address), "-device", "virtio-net-pci,netdev=eth0,romfile="),
    ]


BARE_VIRT = (
    *("-M", "virt", "-cpu", "cortex-a72", "-smp", "2", "-m", "1024", "-accel", "tcg,thread=multi"),
    *("-device", "virtio-rng-pci"),
)


class Guest:
    """A running machine with a serial console.

    began  when it was started, on the monotonic clock.
    text   all that the console has said.
    qmp    path of the socket at which QEMU takes commands.
    """

    def __init__(self, words: Sequence[str], folder: Path, ports: Ports) -> None:
        self.ports = ports
        self.text = ""
        self.log = folder / "console.log"
        self.qmp = folder / "qmp"
        self._from = 0
        console = folder / "console"
        console.unlink(missing_ok=True)
        self._log = self.log.open("ab")  # of all starts in this folder
        self.began = time.monotonic()
        self._process = subprocess.Popen(
            [
                *("qemu-system-aarch64", "-nodefaults", "-no-user-config", "-display", "none", *words),
                *("-chardev", f"socket,id=con,path={console},server=on,wait=off"),
                *("-qmp", f"unix:{self.qmp},server=on,wait=off"),
                *(() if "-serial" in words else ("-serial", "chardev:con")),
            ],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=(folder / "qemu.log").open("wb"),
            preexec_fn=die_with_parent(signal.SIGKILL),  # noqa: PLW1509 - it is made by the one thread that forks
        )
        self._console = _connected(console, self._process)
        self._said = threading.Condition()
        self._is_over = False
        # Read whether anybody waits or not: a guest whose console is full stands still.
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def wait(self, pattern: str, limit_s: float = LIMIT_S) -> re.Match[str]:
        """The next time that the console says it. Raises NotSeenError."""
        ends = time.monotonic() + limit_s
        at = self._from
        while not (found := re.search(pattern, self.text[self._from :])):
            if time.monotonic() >= ends or (self._is_over and at == len(self.text)):
                raise NotSeenError(f"{pattern!r} was not seen; the console's last words:\n{self.text[-1500:]}")
            at += len(self.more(at, ends - time.monotonic()))
        self._from += found.end()
        return found

    def more(self, at: int, limit_s: float) -> str:
        """What the console has said behind that place of its text; empty when it says nothing for so long."""
        with self._said:
            self._said.wait_for(lambda: len(self.text) > at or self._is_over, max(0.0, limit_s))
            return self.text[at:]

    def stop_loader(self, extra: str) -> None:
        """At U-Boot's prompt, as who holds the cable may: words for the kernel's command line, then go on."""
        self.wait("Hit any key")
        self.type(" ")
        self.wait("(=|U-Boot)> ")
        self.type(f"setenv extra_args '{extra}'\n")
        self.wait("(=|U-Boot)> ")
        self.type("boot\n")

    def type(self, text: str) -> None:
        self._console.sendall(text.encode())

    def cut(self) -> None:
        """Take away its power; idempotent."""
        self._process.kill()
        self._process.wait()
        self._reader.join()
        self._console.close()
        self._log.close()

    def _read(self) -> None:
        while True:
            try:
                octets = self._console.recv(65_536)
            except OSError:
                octets = b""
            with self._said:
                self._is_over = not octets
                self.text += octets.decode("utf-8", "replace")
                self._said.notify_all()
            if not octets:
                return
            self._log.write(octets)
            self._log.flush()


@contextmanager
def powered(
    card: Path, folder: Path, words: Sequence[str] = (), ports: Ports | None = None, machine: Machine = virt
) -> Iterator[Guest]:
    """A machine with its power on until the block ends. words: of QEMU's command line, beside the machine's."""
    with ExitStack() as opened:
        ports = ports or opened.enter_context(held_ports())
        guest = Guest([*machine(card, ports), *words], folder, ports)
        opened.callback(guest.cut)
        yield guest


def owned(image: Path, folder: Path, files: Mapping[str, str | bytes]) -> Path:
    """A copy of a card with files on the partition that its owner may edit."""
    card = folder / "card.img"
    subprocess.run(["cp", "--sparse=always", image, card], check=True)
    put(card, files)
    return card


def put(card: Path, files: Mapping[str, str | bytes]) -> None:
    """Files on a card's boot partition, as a laptop writes them; a folder in a name is made."""
    offset = partition_offset(card)
    for name, content in files.items():
        octets = content.encode() if isinstance(content, str) else content
        if "/" in name:
            _mtools(["mmd", "-D", "s"], card, offset, f"::{name.rpartition('/')[0]}", check=False)
        _mtools(["mcopy", "-o"], card, offset, "-", f"::{name}", given=octets)


def partition_offset(card: Path) -> int:
    """Of the first partition, the boot one, in octets."""
    with card.open("rb") as file:
        file.seek(446 + 8)
        return int.from_bytes(file.read(4), "little") * 512


def _mtools(words: list[str], card: Path, offset: int, *names: str, given: bytes = b"", check: bool = True) -> None:
    subprocess.run(
        [*words, "-i", f"{card}@@{offset}", *names],
        check=check,
        input=given,
        stderr=None if check else subprocess.DEVNULL,
        env={**os.environ, "MTOOLS_SKIP_CHECK": "1"},
    )


@contextmanager
def held_ports() -> Iterator[Ports]:
    """Until the block ends nobody else is given them; QEMU, which asks for them by number, listens there."""
    held = system.Ports()
    try:
        yield Ports(*(held.take() for _ in GUEST))
    finally:
        held.release()


def _connected(path: Path, process: "subprocess.Popen[bytes]") -> socket.socket:
    made = socket.socket(socket.AF_UNIX)
    while process.poll() is None:
        try:
            made.connect(str(path))
        except OSError:
            time.sleep(0.05)  # QEMU makes it in some 100 ms
        else:
            return made
    raise NotSeenError(f"QEMU has ended with {process.returncode}: {(path.parent / 'qemu.log').read_text()[-500:]}")
