"""Loops and hosts for drivers, and network namespaces for those that need devices of their own."""

import ctypes
import os
import subprocess
import sys
import traceback
from contextlib import ExitStack, closing

import pytest

from tests.drivers import gnss, modem
from tests.drivers.host import Host
from tests.ptys import PtyLoop, Ptys

CLONE_NEWUSER, CLONE_NEWNET = 0x10000000, 0x40000000


@pytest.fixture
def loop(request, monkeypatch):
    # What crosses a veth pair is moved by a thread of the kernel: it is given a moment of real time, but where a file of
    # tests says that nothing does.
    with closing(PtyLoop(Ptys(monkeypatch), getattr(request.module, "PATIENCE_S", 0.02))) as loop:
        yield loop


@pytest.fixture
def host(loop):
    return Host(loop)


@pytest.fixture
def at_end():
    """Takes a call that is made when the test has ended, the last first."""
    with ExitStack() as stack:
        yield stack.callback


@pytest.fixture
def make_modem(loop, tmp_path, at_end):
    """Makes a modem's interface over a simulated modem, by its options."""

    def make(**options):
        bench = modem.Bench(loop, tmp_path, **options)
        at_end(bench.close)
        return bench

    return make


@pytest.fixture
def make_receiver(loop, at_end):
    """Makes a receiver's interface over a simulated receiver, by its habits and options."""

    def make(habits=None, **options):
        bench = gnss.Bench(loop, habits, **options)
        at_end(bench.close)
        return bench

    return make


def pytest_configure(config):
    config.addinivalue_line("markers", "namespace: runs in a network namespace of its own, made without privileges")


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem):
    """A test marked `namespace` runs in a child process that has a network of its own: lo and nothing else."""
    if pyfuncitem.get_closest_marker("namespace") is None:
        return None
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        _run_apart(pyfuncitem, writer)
    os.close(writer)
    with os.fdopen(reader) as report:
        text = report.read()
    _, status = os.waitpid(child, 0)
    if status != 0:
        pytest.fail(text or f"the test's process ended with status {status}", pytrace=False)
    return True


def _run_apart(pyfuncitem, writer):
    status = 1
    try:
        _enter_namespace()
        names = pyfuncitem._fixtureinfo.argnames
        pyfuncitem.obj(**{name: pyfuncitem.funcargs[name] for name in names})
        status = 0
    except BaseException:  # noqa: BLE001 - the parent process raises it again
        os.write(writer, traceback.format_exc().encode())
    finally:
        sys.stdout.flush()
        os._exit(status)


def _enter_namespace():
    user, group = os.getuid(), os.getgid()
    flags = CLONE_NEWNET if user == 0 else CLONE_NEWNET | CLONE_NEWUSER
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.unshare(flags) != 0:
        raise OSError(ctypes.get_errno(), "unshare: this machine lets nobody make a network namespace")
    if user != 0:
        _write("/proc/self/setgroups", "deny")
        _write("/proc/self/uid_map", f"0 {user} 1")
        _write("/proc/self/gid_map", f"0 {group} 1")
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)


def _write(path, text):
    with open(path, "w") as file:
        file.write(text)
