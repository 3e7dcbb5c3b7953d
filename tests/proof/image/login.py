"""A way into a guest by ssh, with a key that lies on its boot partition."""

import socket
import subprocess
import time
from pathlib import Path
from typing import NamedTuple

from tests.proof.image.machine import LIMIT_S, Guest, NotSeenError

NAME = "operator"
OPTIONS = {
    "StrictHostKeyChecking": "no",
    "UserKnownHostsFile": "/dev/null",
    "LogLevel": "ERROR",
    "ConnectTimeout": "60",
    "BatchMode": "yes",
    "IdentitiesOnly": "yes",
}


class Key(NamedTuple):
    """path: of the private one. line: of the public one, for authorized_keys."""

    path: Path
    line: str


def new_key(folder: Path, name: str = "key") -> Key:
    path = folder / name
    for old in (path, path.with_suffix(".pub")):
        old.unlink(missing_ok=True)
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", "bench", "-f", path], check=True)
    return Key(path, path.with_suffix(".pub").read_text())


def ssh(
    guest: Guest, key: Path, command: str, limit_s: float = 120.0, given: Path = Path("/dev/null")
) -> "subprocess.CompletedProcess[str]":
    """A command by ssh, as operator; Path("/dev/null") is no key. given: what it has as its input."""
    with given.open("rb") as file:
        return subprocess.run(
            words(guest, key, command), stdin=file, capture_output=True, text=True, timeout=limit_s, check=False
        )


def words(guest: Guest, key: Path, command: str, *options: str) -> list[str]:
    """Of this machine's command line, for a command as operator. options: of ssh."""
    own = (word for name, value in OPTIONS.items() for word in ("-o", f"{name}={value}"))
    return ["ssh", "-p", str(guest.ports.ssh), "-i", str(key), *own, *options, f"{NAME}@127.0.0.1", command]


def said(guest: Guest, key: Key, command: str, limit_s: float = 120.0) -> str:
    """What a command prints, without the last end of line."""
    return ssh(guest, key.path, command, limit_s).stdout.strip()


def wait_for_ssh(guest: Guest, limit_s: float = LIMIT_S) -> None:
    """Until its server says its first words. QEMU takes connections before the guest does, and closes them."""
    ends = time.monotonic() + limit_s
    while time.monotonic() < ends:
        with socket.create_connection(("127.0.0.1", guest.ports.ssh), 30) as made:
            made.settimeout(30)
            try:
                if made.recv(4) == b"SSH-":
                    return
            except OSError:
                continue  # it was closed again
        time.sleep(0.5)
    raise NotSeenError(f"nobody answers at port 22 of the guest within {limit_s:.0f} s")


def host_key(guest: Guest) -> str:
    """The public key by which the guest's ssh says who it is."""
    words = ["ssh-keyscan", "-t", "ed25519", "-T", "60", "-p", str(guest.ports.ssh), "127.0.0.1"]
    found = subprocess.run(words, capture_output=True, text=True, check=True).stdout.split()
    if not found:
        raise NotSeenError("ssh-keyscan: the guest tells no key")
    return found[-1]
