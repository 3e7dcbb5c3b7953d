"""Loops and hosts for drivers, and network namespaces for those that need devices of their own."""

import os
import sys
import traceback
from contextlib import ExitStack, closing

import pytest

from tests.drivers import gnss, modem
from tests.drivers.host import Host
from tests.network import isolate
from tests.ptys import PtyLoop, Ptys


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
        isolate(as_root=True)
        names = pyfuncitem._fixtureinfo.argnames
        pyfuncitem.obj(**{name: pyfuncitem.funcargs[name] for name in names})
        status = 0
    except BaseException:  # noqa: BLE001 - the parent process raises it again
        os.write(writer, traceback.format_exc().encode())
    finally:
        sys.stdout.flush()
        os._exit(status)
