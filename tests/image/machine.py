"""QEMU's virt with the very card: U-Boot, the boot script, the slot. What it says is waited for, never a time."""

import os
import re
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from board.child import die_with_parent

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


class NotSeenError(Exception):
    """What was waited for did not come; with the last words of the console."""


class Guest:
    """A running machine with a serial console.

    began  when it was started, on the monotonic clock.
    """

    def __init__(self, card: Path, folder: Path, ports: Ports) -> None:
        self.ports = ports
        self.log = folder / "console.log"
        self._seen = ""
        self._from = 0
        console = folder / "console"
        console.unlink(missing_ok=True)
        self.log.unlink(missing_ok=True)
        self.began = time.monotonic()
        self._process = subprocess.Popen(
            _command(card, console, folder / "qmp", self.log, ports),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=(folder / "qemu.log").open("wb"),
            preexec_fn=die_with_parent(signal.SIGKILL),  # noqa: PLW1509 - there is one thread
        )
        self._console = _connected(console, self._process)

    def wait(self, pattern: str, limit_s: float = LIMIT_S) -> re.Match[str]:
        """The next time that the console says it. Raises NotSeenError."""
        ends = time.monotonic() + limit_s
        while not (found := re.search(pattern, self._seen[self._from :])):
            self._console.settimeout(max(0.1, ends - time.monotonic()))
            try:
                octets = self._console.recv(65_536)
            except TimeoutError:
                octets = b""
            if not octets:
                raise NotSeenError(f"{pattern!r} was not seen; the console's last words:\n{self._seen[-1500:]}")
            self._seen += octets.decode("utf-8", "replace")
        self._from += found.end()
        return found

    def type(self, text: str) -> None:
        self._console.sendall(text.encode())

    def cut(self) -> None:
        """Take away its power; idempotent."""
        self._process.kill()
        self._process.wait()
        self._console.close()


@contextmanager
def powered(card: Path, folder: Path, ports: Ports | None = None) -> Iterator[Guest]:
    guest = Guest(card, folder, ports or free_ports())
    try:
        yield guest
    finally:
        guest.cut()


def owned(image: Path, folder: Path, files: dict[str, str]) -> Path:
    """A copy of a card with files on the partition that its owner may edit."""
    card = folder / "card.img"
    subprocess.run(["cp", "--sparse=always", image, card], check=True)
    for name, text in files.items():
        source = folder / name
        source.write_text(text)
        offset = int.from_bytes(_read(card, 446 + 8, 4), "little") * 512
        words = ["mcopy", "-o", "-i", f"{card}@@{offset}", str(source), f"::{name}"]
        subprocess.run(words, check=True, env={**os.environ, "MTOOLS_SKIP_CHECK": "1"})
    return card


def free_ports() -> Ports:
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in GUEST]
    found = Ports(*(each.getsockname()[1] for each in sockets))
    for each in sockets:
        each.close()
    return found


def _command(card: Path, console: Path, qmp: Path, log: Path, ports: Ports) -> list[str]:
    forwards = ",".join(f"hostfwd=tcp:127.0.0.1:{own}-:{its}" for own, its in zip(ports, GUEST, strict=True))
    return [
        *("qemu-system-aarch64", "-nodefaults", "-no-user-config", "-display", "none"),
        *("-M", "virt", "-cpu", "cortex-a72", "-smp", "2", "-m", "1024", "-accel", "tcg,thread=multi"),
        *("-bios", str(LOADER), "-drive", f"file={card},format=raw,if=virtio"),
        *("-netdev", f"user,id=eth0,{forwards}", "-device", "virtio-net-pci,netdev=eth0,romfile="),
        *("-chardev", f"socket,id=con,path={console},server=on,wait=off,logfile={log}", "-serial", "chardev:con"),
        *("-qmp", f"unix:{qmp},server=on,wait=off", "-device", "virtio-rng-pci"),
    ]


def _connected(path: Path, process: "subprocess.Popen[bytes]") -> socket.socket:
    made = socket.socket(socket.AF_UNIX)
    while process.poll() is None:
        try:
            made.connect(str(path))
        except OSError:
            time.sleep(0.05)  # QEMU makes it in some 100 ms
        else:
            return made
    raise NotSeenError(f"QEMU has ended with {process.returncode}: {path.parent}/qemu.log")


def _read(path: Path, offset: int, size: int) -> bytes:
    with path.open("rb") as file:
        file.seek(offset)
        return file.read(size)


def key_pair(folder: Path) -> tuple[Path, str]:
    """A key for ssh: the private one's path, and the public one's line."""
    path = folder / "key"
    shutil.rmtree(path, ignore_errors=True)
    for name in ("key", "key.pub"):
        (folder / name).unlink(missing_ok=True)
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", "bench", "-f", path], check=True)
    return path, (folder / "key.pub").read_text()


def ssh(guest: Guest, key: Path, command: str, limit_s: float = 120.0) -> "subprocess.CompletedProcess[str]":
    """A command by ssh, as operator."""
    options = ["StrictHostKeyChecking=no", "UserKnownHostsFile=/dev/null", "LogLevel=ERROR", "ConnectTimeout=60"]
    words = ["ssh", "-p", str(guest.ports.ssh), "-i", str(key), "-o", "BatchMode=yes", "-o", "IdentitiesOnly=yes"]
    words += [word for option in options for word in ("-o", option)]
    return subprocess.run(
        [*words, "operator@127.0.0.1", command], capture_output=True, text=True, timeout=limit_s, check=False
    )
