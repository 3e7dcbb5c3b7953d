"""A guest with a whole station in it: a simulated receiver at its serial port, pulses, chronyd, `captain run`."""

import json
from bisect import bisect_left
from collections import deque
from collections.abc import Sequence
from typing import Any, NamedTuple

import zmq

from drivers.sim.receiver.receiver import Receiver
from pps.pulse import Clocks, Pulse
from tests.proof.clock.bench import Bench, Struck
from tests.proof.clock.machine import MADE, Guest, Kind
from tests.proof.clock.truth import Span
from tests.system.ports import Ports

GPS_LEAD = 756_950_413  # GPS time less ITS time, s

EXCHANGE_S = 0.1  # between two looks at the guest's clocks
LOOK_S = 0.02  # between two looks for what the station reports
LOOKS = 20  # before the ruler is believed
PULSE_SEEN_S = 0.6  # after a pulse, when the kernel is asked for it
STEP_NS = 50_000_000  # chronyd steps by no less than 0.1 s
STALE_S = 2.3  # what is reported is of the second before, and may be of the one before that

PORTS = {"to_users": 5556, "pull": 5557, "report": 5558}


class Sample(NamedTuple):
    """How wrong the guest's system clock is, less the truth, ns, at a moment of the truth's clock."""

    at_s: float
    system_ns: int
    raw_ns: int


class Report(NamedTuple):
    """What the station reported, when it came."""

    at_s: float
    said: dict[str, Any]


class Station:
    """On a bench: booted by bench.wait_for_guests(), its programs started by start().

    receiver  made before the truth began: what it says is by that clock, from 0 on.
    interfaces  of captain.toml, beside the receiver. devices: of QEMU, for them.
    samples, reports  all of them, in their order. log: lines of captain and chronyd.
    heard    messages that it reports to have received, by digest.
    struck   pulses that it was given. late_ns: by how much their stamps are behind.
    """

    def __init__(
        self,
        on: Bench,
        made: Kind,
        name: str,
        date: str,
        receiver: Receiver,
        interfaces: str = "",
        devices: Sequence[str] = (),
    ) -> None:
        self.name = name
        self.heard: dict[str, Report] = {}
        self.samples: list[Sample] = []
        self.reports: deque[Report] = deque()
        self.struck: list[Struck] = []
        self.late_ns: list[int] = []
        self.log: list[tuple[float, str]] = []
        self._on = on
        self._made = made
        self._interfaces = interfaces
        self.receiver = receiver
        self.receiver.power(True)
        on.until(lambda: self.receiver.path, 10, "the receiver's port")
        self._held = Ports()
        self.ports = {place: self._held.take() for place in PORTS}
        forwards = ",".join(f"hostfwd=tcp:127.0.0.1:{self.ports[place]}-:{port}" for place, port in PORTS.items())
        own = [
            *made.receiver(self.receiver.path),
            *("-netdev", f"user,id=users,{forwards}", "-device", "virtio-net-pci,netdev=users,romfile="),
        ]
        self.guest = Guest(on.loop, made, name, on.folder, date, [*own, *devices])
        on.boot(self.guest)
        self._context = zmq.Context()
        self._reports: zmq.Socket[bytes] = self._context.socket(zmq.SUB)
        self._reports.setsockopt(zmq.HANDSHAKE_IVL, 5000)  # QEMU takes the connection before the station does
        self._reports.subscribe(b"time.")
        if interfaces:
            self._reports.subscribe(b"indication.")
        self.guest.told["captain"] = self.guest.told["chronyd"] = lambda line: self.log.append((on.loop.clock(), line))

    def pulsed(self, struck: Struck) -> None:
        """It was given a pulse."""
        self.struck.append(struck)
        self._on.loop.after(PULSE_SEEN_S, self._look_at_pulse)

    def wrong_by(self, ns: int) -> None:
        """Put the system's clock wrong by so much, to a fraction of a millisecond."""
        for _ in range(LOOKS):
            self.look()
        self.guest.step(ns - self.error_ns(self.samples[-1]))
        self.samples.clear()
        self.look()

    def look(self) -> None:
        """A sample of now, waited for."""
        count = len(self.samples)
        self.guest.clocks(self._sampled)
        self._on.until(lambda: len(self.samples) > count, 30, "the guest's clocks")

    def watch(self) -> None:
        """Samples and reports from now on."""
        self._reports.connect(f"tcp://127.0.0.1:{self.ports['report']}")
        self._look_at_clocks()
        self._look_at_reports()

    def hold(self) -> None:
        """No chronyd and no station from now on."""
        self._made.hold(self.guest)

    def start(self) -> None:
        """chronyd, and the station."""
        self._made.start(self.guest, self.name, self._interfaces)

    def now_s(self) -> float:
        """The clock that samples and reports have."""
        return self._on.loop.clock()

    def is_up(self) -> bool:
        """It reports."""
        return bool(self.reports)

    def close(self) -> None:
        self.guest.kill()
        self._held.release()
        self._write_log()
        self._reports.close(0)
        self._context.term()
        self.receiver.unplug()

    def _write_log(self) -> None:
        """What its programs said, and how wrong it was each second, for who wants to know why."""
        lines = [f"{at_s:8.2f} {line}" for at_s, line in self.log]
        lines += [
            f"{at.at_s:8.2f} wrong by {self.error_ns(at) / 1000:.0f} us"
            for at in self.samples[:: round(1 / EXCHANGE_S)]
        ]
        lines += [f"{report.at_s:8.2f} reports {json.dumps(report.said)}" for report in self.reports]
        lines += self.guest.trouble
        (MADE / f"station-{self.name}.log").write_text("\n".join([*sorted(lines), ""]))

    # What is known of it

    def truth_ns(self, raw_ns: int) -> Span:
        """ITS time of a moment of its oscillator."""
        at = self.guest.ruler.host(raw_ns)
        return Span(self._on.truth.its_ns(at.earliest), self._on.truth.its_ns(at.latest))

    def error_ns(self, sample: Sample) -> int:
        """Of its system's clock against the truth; known to ruler.host(0).half."""
        its_ns = self.truth_ns(sample.raw_ns).middle
        return sample.system_ns - self._on.truth.unix_ns(its_ns)

    def report_at(self, at_s: float) -> Report:
        """The last one before a moment, or the first."""
        return next((report for report in reversed(self.reports) if report.at_s <= at_s), self.reports[0])

    def off_ns(self, at_s: float) -> int:
        """By how much its system's clock was wrong at a moment: between the two samples about it, as a line has it."""
        before, behind, *_ = [*self.between(at_s, at_s), self.samples[-1]]
        part = (at_s - before.at_s) / (behind.at_s - before.at_s) if behind.at_s > before.at_s else 0.0
        first, last = self.error_ns(before), self.error_ns(behind)
        return first + round((last - first) * min(1.0, max(0.0, part)))

    def errors_ns(self, since_s: float) -> list[int]:
        """Of its system's clock, from a moment on."""
        return [self.error_ns(sample) for sample in self.between(since_s, self._on.loop.clock())]

    def between(self, earliest_s: float, latest_s: float) -> list[Sample]:
        """Samples of a time, with the one before it and the one behind."""
        first = max(0, bisect_left(self.samples, earliest_s, key=_moment) - 1)
        return self.samples[first : bisect_left(self.samples, latest_s, key=_moment) + 1]

    def _sampled(self, clocks: Clocks) -> None:
        self.samples.append(Sample(self._on.loop.clock(), clocks.system_ns, clocks.raw_ns))

    def _look_at_clocks(self) -> None:
        def sampled(clocks: Clocks) -> None:
            self._sampled(clocks)
            self._on.loop.after(EXCHANGE_S, lambda: self.guest.clocks(sampled))

        self.guest.clocks(sampled)

    def _look_at_pulse(self) -> None:
        """What the kernel stamped is behind its cause: the ruler learns from it, unless its clock was stepped since."""
        struck = self.struck[-1] if self.struck else None

        def seen(pulse: Pulse) -> None:
            if struck is None or struck is not self.struck[-1] or pulse.sequence != len(self.struck):
                return
            late_ns = self.guest.ruler.host(pulse.raw_ns).middle - struck.at_ns.earliest
            if abs(late_ns) < STEP_NS:
                self.guest.ruler.after(struck.at_ns.earliest, pulse.raw_ns)
                self.late_ns.append(late_ns)
                self.log.append(
                    (self.now_s(), f"pulse {pulse.sequence} was stamped {late_ns / 1000:.0f} us after its moment")
                )

        self.guest.pulse(seen)

    def _look_at_reports(self) -> None:
        self._on.loop.after(LOOK_S, self._look_at_reports)
        while self._reports.poll(0):
            topic, said = self._reports.recv_multipart()
            report = Report(self._on.loop.clock(), json.loads(said))
            if topic == b"time.":
                self.reports.append(report)
            else:
                self.heard[report.said["digest"]] = report


def _moment(sample: Sample) -> float:
    return sample.at_s
