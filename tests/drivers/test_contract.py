"""Contract of drivers (drivers/contract.py): each driver fulfils it."""

import gc
import os
import resource

import pytest

from board.runtime.errors import InterfaceError, RequestError
from drivers import DRIVERS
from drivers.contract import Can, Sent
from drivers.message import RxInfo
from tests.drivers.bench import ModuleBench
from tests.drivers.benches import BENCHES, MODULES
from tests.drivers.host import CAM, DENM, requests, told

pytestmark = pytest.mark.namespace

every = pytest.mark.parametrize("kind", BENCHES)
carrying = pytest.mark.parametrize("kind", [kind for kind in BENCHES if kind not in MODULES])  # messages

PDUS = [CAM, DENM, CAM + bytes(300), bytes(range(256))]


def pdus(bench):
    return [pdu[: bench.driver.capabilities.max_payload] for pdu in PDUS]


@pytest.fixture
def bench(loop, kind, tmp_path):
    # Each test calls plug() itself, because the network namespace is that of the test and not of the fixture.
    return BENCHES[kind](loop, tmp_path)


def descriptors():
    return {name: os.readlink(f"/proc/self/fd/{name}") for name in os.listdir("/proc/self/fd") if _is_open(name)}


def open_before():
    """Return the open descriptors after a garbage collection, which would otherwise close some of them later."""
    gc.collect()
    return descriptors()


def _is_open(name):
    return os.path.lexists(f"/proc/self/fd/{name}") and "/fd" not in os.readlink(f"/proc/self/fd/{name}")


def sources(loop):
    return len(loop._sources)


def send_all(loop, host, driver, pdus):
    """Send PDUs as a host does: after BUSY, wait for writable()."""
    for wanted in requests(pdus):
        while (outcome := driver.send(wanted)) is Sent.BUSY:
            before = host.times_writable
            loop.run_until(lambda before=before: host.times_writable > before)
        if outcome is Sent.LATER:
            loop.run_until(lambda wanted=wanted: (wanted, None) in host.confirms)


def exchange(bench, loop, host):
    """Exchange one message in each direction, or wait for the service of a module without messages."""
    if isinstance(bench, ModuleBench):
        told(loop, lambda: bench.has_served(host), bench.patience_s)
        return
    bench.say(DENM)
    send_all(loop, host, bench.driver, [CAM])
    heard = []
    told(loop, lambda: (heard.extend(bench.heard()) or heard) and host.pdus, bench.patience_s)
    assert (heard, host.pdus) == ([CAM], [DENM])


def start(bench, loop, host):
    """Start and wait for the link."""
    before = len(host.links)
    bench.driver.start(host)
    told(loop, lambda: len(host.links) > before and host.is_up, bench.patience_s)


def stop(bench, loop, before, others):
    """Stop the driver and wait for the end of its processes. Check that no descriptor or process is left."""
    bench.driver.stop()
    told(loop, lambda: (descriptors(), sources(loop)) == (before, others), bench.patience_s)


@every
def test_its_link_is_up_when_start_returns(bench, loop, host):
    bench.plug()
    bench.driver.start(host)
    if bench.has_process:
        told(loop, lambda: host.links, bench.patience_s)
    if bench.is_brought_up:
        assert not host.links[0][0]
        told(loop, lambda: host.is_up, bench.patience_s)
        host.links = [link for link in host.links if link[0]]
    assert [is_up for is_up, _ in host.links] == [True]
    assert host.links[0][1]


@carrying
def test_it_indicates_what_the_other_end_says(bench, loop, host):
    bench.plug()
    start(bench, loop, host)
    for pdu in pdus(bench):
        bench.say(pdu)
    told(loop, lambda: host.count == len(PDUS), bench.patience_s)
    assert sorted(host.pdus) == sorted(pdus(bench))
    assert host.drops == {}
    assert all(received_ns > 1_600_000_000 * 10**9 for _, received_ns, _ in host.indications)


@carrying
def test_it_fills_only_the_metadata_that_it_declares(bench, loop, host):
    bench.plug()
    start(bench, loop, host)
    bench.say(CAM)
    told(loop, lambda: host.indications, bench.patience_s)
    nothing, found = RxInfo(), host.indications[0][2]
    filled = {name for name in RxInfo._fields if getattr(found, name) != getattr(nothing, name)}
    assert filled <= bench.driver.capabilities.metadata


@carrying
def test_it_sends_requests_unchanged_and_confirms_them(bench, loop, host):
    bench.plug()
    start(bench, loop, host)
    send_all(loop, host, bench.driver, pdus(bench))
    heard = []
    told(loop, lambda: heard.extend(bench.heard()) or len(heard) == len(PDUS), bench.patience_s)
    assert heard == pdus(bench)
    assert host.failures == []


@carrying
def test_it_carries_the_longest_pdu_that_it_declares(bench, loop, host):
    size = bench.driver.capabilities.max_payload
    longest, other = CAM.ljust(size, b"\xa5"), DENM.ljust(size, b"\x5a")
    bench.plug()
    start(bench, loop, host)
    send_all(loop, host, bench.driver, [longest])
    bench.say(other)
    heard = []
    told(loop, lambda: (heard.extend(bench.heard()) or heard) and host.pdus, bench.patience_s)
    assert (heard, host.pdus) == ([longest], [other])


@pytest.mark.parametrize("kind", sorted(MODULES))
def test_without_transmit_it_refuses_every_request(bench, loop, host):
    assert Can.TRANSMIT not in bench.driver.capabilities.can
    bench.plug()
    start(bench, loop, host)
    for wanted in requests([CAM, DENM]):
        with pytest.raises(RequestError, match="sends no"):
            bench.driver.send(wanted)
    assert host.failures == []


@every
def test_it_fails_when_its_device_disappears_and_serves_again_when_it_is_back(bench, loop, host):
    bench.plug()
    start(bench, loop, host)
    bench.unplug()
    told(loop, lambda: host.failures, bench.patience_s)
    assert isinstance(host.failures[0], InterfaceError)
    bench.driver.stop()
    before = open_before()
    for _ in range(3):
        with pytest.raises(InterfaceError):
            bench.driver.start(host)
    assert descriptors() == before
    bench.plug()
    start(bench, loop, host)
    exchange(bench, loop, host)
    assert len(host.failures) == 1


@every
def test_it_may_be_stopped_before_it_was_started(bench):
    bench.driver.stop()
    bench.driver.stop()


@every
def test_stopped_it_leaves_no_descriptor_no_source_and_no_timer(bench, loop, host):
    bench.plug()
    before, others = open_before(), sources(loop)
    start(bench, loop, host)
    exchange(bench, loop, host)
    stop(bench, loop, before, others)
    bench.driver.stop()
    bench.close()
    loop.run_for(1)
    assert loop.delay() is None


@every
def test_stopped_it_says_nothing_more(bench, loop, host, kind):
    bench.plug()
    bench.driver.start(host)
    bench.driver.stop()
    told = len(host.links)
    if kind not in MODULES:
        bench.say(CAM)
    loop.run_for(10)
    assert (host.total, len(host.links), host.failures) == (0, told, [])


@carrying
def test_it_may_be_stopped_by_what_it_indicates(bench, loop, host):
    bench.plug()
    start(bench, loop, host)
    host.on_indication = bench.driver.stop
    for pdu in pdus(bench):
        bench.say(pdu)
    told(loop, lambda: host.count, bench.patience_s)
    loop.run_for(10)
    assert (host.count, host.failures) == (1, [])


@pytest.mark.parametrize("free", range(8))
@every
def test_a_start_that_fails_half_way_closes_what_it_had_opened_and_may_be_repeated(bench, loop, host, kind, free):
    bench.plug()
    before, others = open_before(), sources(loop)
    bench.driver.start(host)  # the first start imports modules, which may open files
    stop(bench, loop, before, others)
    highest = max(map(int, before))
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    holes = [os.open("/dev/null", os.O_RDONLY) for _ in range(highest - len(before) + 2)]
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(highest, *holes) + 1 + free, hard))
    try:
        bench.driver.start(host)
    except InterfaceError:
        assert not host.failures
        bench.driver.refresh()
        bench.driver.stop()
    else:
        assert free or kind == "morse"  # morse opens a file only to send
        bench.driver.stop()
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
        for hole in holes:
            os.close(hole)
    stop(bench, loop, before, others)
    bench.driver.start(host)


def test_every_driver_has_a_bench():
    assert {name.partition("-")[0] for name in BENCHES} == set(DRIVERS), "tests/drivers/benches.py: BENCHES"


@every
def test_bench_of_driver_has_its_class_capabilities_and_described_options(bench, kind):
    driver = DRIVERS[kind.partition("-")[0]]
    assert isinstance(bench.driver, driver)
    assert bench.driver.capabilities.can == bench.can
    assert driver.Options.__doc__


@pytest.mark.parametrize("kind", MODULES)
def test_a_driver_without_transmit_refuses_a_message(bench, loop, host):
    bench.plug()
    bench.driver.start(host)
    (wanted,) = requests([CAM])
    with pytest.raises(RequestError):
        bench.driver.send(wanted)
    bench.driver.stop()
    bench.close()
