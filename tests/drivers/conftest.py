"""Fixtures for drivers: loops, hosts, and network namespaces for tests with devices."""

import os
import sys
import traceback
from contextlib import ExitStack, closing

import pytest

from tests.drivers.gnss import receiver
from tests.drivers.host import Host
from tests.drivers.sim8202g import modem
from tests.network import isolate
from tests.ptys import PtyLoop, Ptys


@pytest.fixture
def loop(request, monkeypatch):
    # A thread of the kernel moves frames across a veth pair, so the loop waits a moment of real time. Test files
    # without such devices set PATIENCE_S.
    with closing(PtyLoop(Ptys(monkeypatch), getattr(request.module, "PATIENCE_S", 0.02))) as loop:
        yield loop


@pytest.fixture
def host(loop):
    return Host(loop)


@pytest.fixture
def at_end():
    """Return a function that registers calls for the end of the test; the last one is called first."""
    with ExitStack() as stack:
        yield stack.callback


@pytest.fixture
def make_modem(loop, tmp_path, at_end):
    """Return a function that creates a modem's interface with given options over a simulated modem."""

    def make(**options):
        bench = modem.Bench(loop, tmp_path, **options)
        at_end(bench.close)
        return bench

    return make


@pytest.fixture
def make_receiver(loop, at_end):
    """Return a function that creates an interface over a simulated receiver, with given habits and options."""

    def make(habits=None, **options):
        bench = receiver.Bench(loop, habits, **options)
        at_end(bench.close)
        return bench

    return make


def pytest_configure(config):
    config.addinivalue_line("markers", "namespace: runs in a network namespace of its own, made without privileges")


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem):
    """Run a test marked `namespace` in a child process, in a network namespace with only the loopback."""
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
