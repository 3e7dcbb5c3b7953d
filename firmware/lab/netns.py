"""Network namespaces: two new ones joined by a virtual cable, or existing ones."""

import ctypes
import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from board.runtime.errors import StationError

CLONE_NEWUSER = 0x10000000  # unshare(2)
CLONE_NEWNET = 0x40000000
HERE = Path("/proc/thread-self/ns/net")
NAMED = Path("/run/netns")  # ip-netns(8)
HINT = "user namespaces may be off here (sysctl kernel.unprivileged_userns_clone); try as root, or without --veth"

_libc = ctypes.CDLL(None, use_errno=True)


class Namespace:
    """Network namespace, given by its path; by default the present one of the calling thread."""

    def __init__(self, path: Path = HERE) -> None:
        self._descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)

    @contextmanager
    def inside(self) -> Iterator[None]:
        """Enter the namespace for the duration of the context. Sockets, threads and children created there stay in it.

        Raises StationError if the kernel refuses to enter or to leave.
        """
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
    """Return a namespace of `ip netns`. Raises StationError if it does not exist or may not be entered."""
    try:
        return Namespace(NAMED / name)
    except OSError as error:
        raise StationError(f"network namespace {name}: {error.strerror}", "`ip netns` lists them") from error


def cable(first: str, second: str) -> tuple[Namespace, Namespace]:
    """Return two new namespaces, each with its loopback up and one end of a virtual cable.

    first, second  names of the two network devices.

    The calling process ends up in the first namespace; as a plain user it becomes root of a new user namespace. Raises
    StationError if the kernel does not permit it.
    """
    _leave_for_new_network(as_user=os.geteuid() != 0)
    here = Namespace()
    _leave_for_new_network(as_user=False)
    there = Namespace()
    # `ip` takes the other namespace as the id of a process in it; `cat` only serves as that process.
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
        # user_namespaces(7): before writing a group map, setgroups must be denied.
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
