"""The link meter against the kernel's netem, and against captures of both ends: loss, copies, order and each delay."""

import statistics
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen
from typing import NamedTuple

import pytest

from board.runtime.errors import ProtocolError
from firmware.client import client
from firmware.endpoint.report import digest_of
from firmware.lab import netns
from firmware.lab.laboratory import NamespaceDevice, Seat, bench
from firmware.meter.delay import link
from firmware.meter.fate import Fate, Settled
from firmware.meter.meter import Meter
from firmware.meter.session import Session, TimeLine
from firmware.recordings import capture, layers
from pps.delay import Delay
from tests.proof.kernel.checks.kernel import Seen, load, run

RATE_HZ, COUNT = 20.0, 120  # emulated, a station takes some ms for a message
CONFIRMS_S = 60.0
GRACE_S = 2.0
# Netem's timer, and the emulated processor that wakes for it: not what is measured.
NETEM_NS = 1_000_000

# What netem does to all that goes from A to B.
CASES = {
    "nothing": "",
    "10 ms": "delay 10ms",
    "50 ms": "delay 50ms",
    "10 ms, jitter, loss": "delay 10ms 5ms loss 10%",
    "50 ms, jitter beyond the spacing, loss, copies": "delay 50ms 45ms loss 20% duplicate 5%",
}


class Captured(NamedTuple):
    """A frame of the capture of one end."""

    digest: str
    when_ns: int


class Case(NamedTuple):
    """One run: what left A and what came to B by the captures, and what the meter says."""

    left: list[Captured]
    came: list[Captured]
    settled: list[Settled]


@pytest.fixture(scope="module")
def cases() -> Iterator[dict[str, Case]]:
    """Two stations, each in a namespace, a bridge in a third between them, and netem on the bridge's way to B."""
    for module in ("veth", "bridge", "sch_netem"):
        load(module)
    for namespace in "amb":
        run("ip", "netns", "add", namespace)
        run("ip", "netns", "exec", namespace, "sysctl", "-qw", "net.ipv6.conf.all.disable_ipv6=1")
        run("ip", "-n", namespace, "link", "set", "lo", "up")
    run("ip", "-n", "m", "link", "add", "bridge", "type", "bridge", "mcast_snooping", "0")
    for end in "ab":
        run("ip", "-n", "m", "link", "add", f"to-{end}", "type", "veth", "peer", "name", "air", "netns", end)
        run("ip", "-n", "m", "link", "set", f"to-{end}", "master", "bridge", "up")
        run("ip", "-n", end, "link", "set", "air", "up")
    run("ip", "-n", "m", "link", "set", "bridge", "up")
    with bench("devices", 0.0, None, [NamespaceDevice(end, "air") for end in "ab"]) as made:
        yield {name: _measured(made.seats[0], made.seats[1], words) for name, words in CASES.items()}
    for namespace in "amb":
        run("ip", "netns", "del", namespace)


def _measured(a: Seat, b: Seat, netem: str) -> Case:
    if netem:
        run("tc", "-n", "m", "qdisc", "add", "dev", "to-b", "root", "netem", *netem.split())
    settled: list[Settled] = []
    with ExitStack() as ending, _captured("a") as at_a, _captured("b") as at_b:
        session = Session(Meter(1.0, GRACE_S), TimeLine())
        settle = session.meter.settle

        def kept(now_s: float) -> list[Settled]:
            found = settle(now_s)
            settled.extend(found)
            return found

        session.meter.settle = kept  # type: ignore[method-assign]
        for seat, namespace in ((a, "a"), (b, "b")):
            # The threads of a context are made with its first socket, in the namespace of this moment.
            with netns.named(namespace).inside():
                session.watch(seat.name, seat.place, ending.enter_context(client.session()))
        session.begin()
        start = time.monotonic()
        for turn in range(COUNT):
            session.serve(max(0.0, start + turn / RATE_HZ - time.monotonic()))
            a.send_pdu(bytes([2, 2]) + (1337).to_bytes(4) + time.time_ns().to_bytes(8) + turn.to_bytes(2))
        session.wait_for(a.name, COUNT, CONFIRMS_S)
        session.end()
    if netem:
        run("tc", "-n", "m", "qdisc", "del", "dev", "to-b", "root")
    mac = run("ip", "netns", "exec", "a", "cat", "/sys/class/net/air/address").strip()
    ours = [one for one in settled if one.way.sender == a.name]
    return Case(_frames(at_a, mac), _frames(at_b, mac), ours)


@contextmanager
def _captured(namespace: str) -> Iterator[Path]:
    """What dumpcap sees meanwhile; its file."""
    path = Path(f"/run/{namespace}.pcapng")
    command = ("ip", "netns", "exec", namespace, "dumpcap", "-q", "-i", "air", "-w", str(path))
    with Popen(command, stdout=DEVNULL, stderr=PIPE, text=True) as process:
        assert process.stderr is not None
        heard = next((line for line in process.stderr if line.startswith("File:")), "")
        assert heard, "dumpcap did not begin"
        try:
            yield path
        finally:
            process.terminate()
            process.stderr.read()


def _frames(path: Path, mac: str) -> list[Captured]:
    """Messages of a sender, by when they passed: two processors may have put them into the file the other way round."""
    found = []
    with path.open("rb") as stream:
        for frame in capture.frames(stream.read(4), stream):
            try:
                carried = layers.open_frame(frame.link, frame.octets)
            except ProtocolError:
                continue
            if isinstance(carried, layers.Carried) and frame.octets[6:12].hex(":") == mac:
                assert frame.when_ns is not None
                found.append(Captured(digest_of(carried.pdu), frame.when_ns))
    return sorted(found, key=lambda one: one.when_ns)


@pytest.mark.parametrize("name", CASES)
def test_what_was_lost_and_what_came_twice_is_what_the_captures_say(
    cases: dict[str, Case], seen: Seen, name: str
) -> None:
    case = cases[name]
    assert len(case.left) == COUNT
    told = Counter(one.fate for one in case.settled)
    came = Counter(one.digest for one in case.came)
    lost = {one.digest for one in case.left} - set(came)
    seen(", ".join(f"{count} {fate.value}" for fate, count in told.items()))
    assert {one.sent.what.digest for one in case.settled if one.fate is Fate.LOST and one.sent} == lost
    assert {one.sent.what.digest for one in case.settled if one.fate is Fate.ARRIVED and one.sent} == set(came)
    assert told[Fate.DUPLICATE] == came.total() - len(came)
    assert not told.keys() - {Fate.ARRIVED, Fate.LOST, Fate.DUPLICATE}
    seen(
        f"netem {CASES[name] or '-'}: {COUNT} sent, {len(lost)} lost, {told[Fate.DUPLICATE]} twice: the meter's as well"
    )


@pytest.mark.parametrize("name", CASES)
def test_the_order_is_that_of_the_captures(cases: dict[str, Case], seen: Seen, name: str) -> None:
    case = cases[name]
    arrived = [one for one in case.settled if one.fate is Fate.ARRIVED]
    firsts = list(dict.fromkeys(one.digest for one in case.came))
    assert [one.sent.what.digest for one in arrived if one.sent] == firsts
    place = {one.digest: at for at, one in enumerate(case.left)}
    numbers = [place[digest] for digest in firsts]
    late = [any(later > number for later in numbers[:at]) for at, number in enumerate(numbers)]
    assert [one.is_reordered for one in arrived] == late
    seen(f"{sum(late)} of {len(late)} out of order")


@pytest.mark.parametrize("name", CASES)
def test_each_delay_is_that_of_the_captures_within_what_is_stated(
    cases: dict[str, Case], seen: Seen, name: str
) -> None:
    case = cases[name]
    left = {one.digest: one.when_ns for one in case.left}
    came: dict[str, int] = {}
    for one in case.came:
        came.setdefault(one.digest, one.when_ns)
    off, stated = [], []
    for settled in case.settled:
        if settled.sent is None or settled.received is None:
            continue
        digest = settled.sent.what.digest
        delay = link(settled.sent, settled.received)
        assert delay is not None
        off.append(delay.ns - (came[digest] - left[digest]))
        stated.append(delay.uncertainty_ns)
    outside = [one for one, bound in zip(off, stated, strict=True) if abs(one) > bound]
    seen(
        f"{len(off) - len(outside)} of {len(off)} within +- {statistics.median(stated) / 1000:.0f} us (median), "
        f"off by {statistics.median(map(abs, off)) / 1000:.0f} us (median), {max(map(abs, off)) / 1000:.0f} us at most"
    )
    assert not outside


@pytest.mark.parametrize(("name", "injected_ns"), [("10 ms", 10_000_000), ("50 ms", 50_000_000)])
def test_a_delay_is_longer_by_what_was_injected(
    cases: dict[str, Case], seen: Seen, name: str, injected_ns: int
) -> None:
    """The median, by as much as by the captures; and the least, by what was injected.

    Netem lets a frame go when its timer wakes it: on an emulated processor that others use that is late at times.
    """
    plain, longer = cases["nothing"], cases[name]
    by_captures = statistics.median(_between_ns(longer)) - statistics.median(_between_ns(plain))
    by_meter = statistics.median(one.ns for one in _links(longer)) - statistics.median(one.ns for one in _links(plain))
    least = min(_between_ns(longer)) - min(_between_ns(plain))
    seen(
        f"injected {injected_ns / 1e6:g} ms: the median is {by_meter / 1e6:.3f} ms longer, by the captures "
        f"{by_captures / 1e6:.3f} ms; the least by the captures {least / 1e6:.3f} ms"
    )
    (low, high), (plain_low, plain_high) = _median_ns(longer), _median_ns(plain)
    assert low - plain_high <= by_captures <= high - plain_low
    assert abs(least - injected_ns) <= NETEM_NS


def _median_ns(case: Case) -> tuple[float, float]:
    """Between what the median of the delays is, by what the meter states of each."""
    bounds = [(one.ns - one.uncertainty_ns, one.ns + one.uncertainty_ns) for one in _links(case)]
    return statistics.median(low for low, _ in bounds), statistics.median(high for _, high in bounds)


def _links(case: Case) -> list[Delay]:
    found = [link(one.sent, one.received) for one in case.settled if one.sent is not None and one.received is not None]
    return [one for one in found if one is not None]


def _between_ns(case: Case) -> list[int]:
    """The same by the captures."""
    left = {one.digest: one.when_ns for one in case.left}
    return [one.when_ns - left[one.digest] for one in {one.digest: one for one in reversed(case.came)}.values()]
