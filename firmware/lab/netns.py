"""Network namespaces: two joined by a virtual Ethernet cable, made without root where allowed; or named ones."""

import ctypes
import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from board.errors import StationError

CLONE_NEWUSER = 0x10000000  # unshare(2)
CLONE_NEWNET = 0x40000000
HERE = Path("/proc/thread-self/ns/net")
NAMED = Path("/run/netns")  # ip-netns(8)
HINT = "user namespaces may be off here (sysctl kernel.unprivileged_userns_clone); try as root, or without --veth"

_libc = ctypes.CDLL(None, use_errno=True)


class Namespace:
    """A network namespace by its path; unless that is given, the one that the calling thread was in at this moment."""

    def __init__(self, path: Path = HERE) -> None:
        self._descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)

    @contextmanager
    def inside(self) -> Iterator[None]:
        """Sockets, threads and children made meanwhile belong to it, and stay in it."""
        before = Namespace()
        self._enter()
        try:
            yield
        finally:
            before._enter()
            before.close()

    def _enter(self) -> None:
        if _libc.setns(self._descriptor, CLONE_NEWNET):
            raise _failure("enter a network namespace")

    def close(self) -> None:
        os.close(self._descriptor)


def named(name: str) -> Namespace:
    """A namespace of `ip netns`. Raises StationError when there is none of that name, or it is not ours to enter."""
    try:
        return Namespace(NAMED / name)
    except OSError as error:
        raise StationError(f"network namespace {name}: {error.strerror}", "`ip netns` lists them") from error


def cable(first: str, second: str) -> tuple[Namespace, Namespace]:
    """Two new namespaces, each with its loopback up and one end of a cable: network devices of these names.

    The calling process is left in the first; as a plain user it is root of a new user namespace from then on.
    Raises StationError when the kernel does not allow it.
    """
    _leave_for_new_network(as_user=os.geteuid() != 0)
    here = Namespace()
    _leave_for_new_network(as_user=False)
    there = Namespace()
    # `ip` takes the far namespace as the number of a process in it: this one does nothing else.
    with subprocess.Popen(["cat"], stdin=subprocess.PIPE) as placeholder:
        with here.inside():
            _ip("link", "add", first, "type", "veth", "peer", "name", second, "netns", str(placeholder.pid))
        placeholder.communicate()
    for end, device in ((here, first), (there, second)):
        with end.inside():
            _ip("link", "set", "lo", "up")
            _ip("link", "set", device, "up")
    here._enter()
    return here, there


def _leave_for_new_network(as_user: bool) -> None:
    user, group = os.geteuid(), os.getegid()
    if _libc.unshare(CLONE_NEWNET | (CLONE_NEWUSER if as_user else 0)):
        raise _failure("make a network namespace")
    if as_user:
        # user_namespaces(7): a group map needs setgroups to be given up first.
        for name, text in (("setgroups", "deny"), ("uid_map", f"0 {user} 1"), ("gid_map", f"0 {group} 1")):
            Path("/proc/self", name).write_text(text)


def _ip(*arguments: str) -> None:
    try:
        subprocess.run(["ip", *arguments], check=True, capture_output=True, text=True)
    except FileNotFoundError as error:
        raise StationError("the program `ip` is missing", "install the package iproute2") from error
    except subprocess.CalledProcessError as error:
        raise StationError(f"ip {' '.join(arguments)}: {error.stderr.strip()}", HINT) from error


def _failure(what: str) -> StationError:
    return StationError(f"cannot {what}: {os.strerror(ctypes.get_errno())}", HINT)
