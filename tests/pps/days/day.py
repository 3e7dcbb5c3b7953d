"""A day in virtual time: pulses and words go into Pairing, what it passes on into Estimator, and the truth is known.

Seconds are those of the day; true time is ITS time. A word is told at the moment at which a loop would read it: late,
where its line or the loop is.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from heapq import heappop, heappush
from random import Random

from board.time import Fix, TimeMark
from pps.pulse import Pulse
from pps.quality import HOLDOVER_S, Estimator
from pps.sim.interrupts import Edges, Interrupts
from pps.sim.machine import Machine
from pps.sim.oscillator import START_NS, Crystal, Oscillator
from pps.sim.temperature import Temperature
from pps.timemark import Acquired, Event, Pairing, Second
from tests.pps.days.account import HOLDOVER, PULSES, RECOVERY_S, Account
from tests.pps.days.trouble import HARMFUL, NOISY, Kind, Trouble
from tests.pps.days.words import Leaping, Words

DAY_S = 86_400
SECOND_NS = 1_000_000_000

FIX_S, MARK_S = 0.055, 0.075  # after the pulse, and up to SPREAD_S more
SPREAD_S = 0.06
END_S = 0.95  # of a second: when samples are taken

SAMPLE_S = 10

FORGOTTEN_S = 200  # pulses of so long ago are not asked for any more


@dataclass(frozen=True)
class Plan:
    """What a day is made of. base_ns: the shortest path of an interrupt."""

    name: str
    seed: int
    troubles: tuple[Trouble, ...] = ()
    crystal: Crystal = field(default_factory=Crystal)
    temperature: Temperature = field(default_factory=Temperature)
    base_ns: float = 3_000.0
    loads: tuple[tuple[float, float], ...] = ()
    start_s: int = START_NS // SECOND_NS
    leaping: Leaping = field(default_factory=Leaping)
    seconds: int = DAY_S


class Day:
    """One plan, played."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.account = Account()
        self._random = Random(f"{plan.name} {plan.seed}")
        self._oscillator = Oscillator(plan.crystal, plan.temperature, plan.seed, plan.start_s * SECOND_NS)
        self._machine = Machine(self._oscillator, system_error_ns=self._random.randrange(-(10**10), 10**10))
        interrupts = Interrupts(plan.seed, plan.base_ns, plan.loads)
        self._edges = Edges(self._machine, interrupts, plan.seed)
        self._pairing, self._estimator = Pairing(), Estimator()
        self._words = Words(plan.leaping)
        self._coming = sorted(plan.troubles, reverse=True)
        self._troubles: list[Trouble] = []
        self._queue: list[tuple[float, int, Pulse | Fix | TimeMark]] = []
        self._count = 0
        self._line_s = 0.0  # until when the receiver's line is busy with what it has said
        self._stalled_s = 0.0  # until when the loop stands still
        self._turn = 0.0  # the loop's clock at its last turn that mattered
        self._truth: dict[int, int] = {}  # by sequence: true time of an edge, ns
        self._owed: set[int] = set()
        self._clean_s = 0  # seconds without harm up to now
        self._recovering: int | None = 0  # the first of them, while none was passed on
        self._followed = 0  # the last second that was passed on

    def play(self) -> Account:
        for second in range(self.plan.seconds):
            if self._troubles or (self._coming and self._coming[-1].at <= second):
                self._change(second)
            if self._troubles or self._queue:
                self._troubled(second)
            else:
                self._calm(second)
            if second % SAMPLE_S == 0:
                self._sample(second)
        self._deliver(float("inf"))
        self.account.refused = self._pairing.refused
        self._forget(self.plan.seconds + FORGOTTEN_S)
        return self.account

    # Seconds

    def _calm(self, second: int) -> None:
        its_s = self.plan.start_s + second
        self._clean(second, True)
        pulse = self._pulse(its_s * SECOND_NS)
        pairing, random = self._pairing, self._random.random
        if pairing.deadline() is not None:
            self._expire(pulse.monotonic)
        spread = SPREAD_S * random()
        told = pairing.pulse(pulse)
        told += pairing.fix(self._words.fix(its_s, pulse.monotonic + FIX_S + spread))
        told += pairing.mark(self._words.mark(its_s + 1, pulse.monotonic + MARK_S + spread))
        if told:
            self._tell(told)

    def _troubled(self, second: int) -> None:
        plan, troubles = self.plan, self._troubles
        its_s = plan.start_s + second
        has_pulse = self._words.has_pulse(second, troubles)
        is_clean = has_pulse and not self._queue and not any(one.kind in HARMFUL for one in troubles)
        is_noisy = any(one.kind in NOISY for one in troubles)
        if is_noisy and self._clean_s < RECOVERY_S:
            is_clean = False
        self._clean(second, is_clean)
        for at_s in self._edge_times(has_pulse):
            self._later(second + at_s, self._pulse(its_s * SECOND_NS + round(at_s * 1e9)))
        late_s = sum(self._random.uniform(0, one.amount) for one in troubles if one.kind is Kind.LATE)
        spread = SPREAD_S * self._random.random() + late_s
        fix = self._words.troubled_fix(second, its_s, troubles)
        mark = self._words.troubled_mark(second, its_s, troubles)
        self._say(second + FIX_S + spread, fix)
        self._say(second + MARK_S + spread, mark)
        self._deliver(second + 1.0)

    def _edge_times(self, has_pulse: bool) -> list[float]:
        """Of all edges of a second, s after its beginning."""
        random = self._random
        times = [0.0] if has_pulse else []
        for trouble in self._troubles:
            match trouble.kind:
                case Kind.MISSED if random.random() < trouble.amount and times:
                    times.clear()
                    self._edges.skip()
                case Kind.NOISE:
                    if random.random() < trouble.amount:
                        times.append(random.random())
                case Kind.BOUNCE if has_pulse:
                    times.append(random.uniform(5e-6, 300e-6))
                case Kind.TRAILING if has_pulse:
                    times.append(0.1)
        return sorted(times)

    def _change(self, second: int) -> None:
        """End troubles, and begin them."""
        its_ns = (self.plan.start_s + second) * SECOND_NS
        for trouble in self._troubles:
            if trouble.end <= second and trouble.kind is Kind.SLEW:
                self._machine.slew(its_ns - 400_000_000, 0.0)
        self._troubles = [trouble for trouble in self._troubles if trouble.end > second]
        while self._coming and self._coming[-1].at <= second:
            trouble = self._coming.pop()
            self._troubles.append(trouble)
            match trouble.kind:
                case Kind.SLEW:
                    self._machine.slew(its_ns - 300_000_000, trouble.amount)
                case Kind.STEP:
                    self._machine.step(its_ns - 200_000_000, round(trouble.amount * 1e9))
                case Kind.STALL:
                    self._stalled_s = max(self._stalled_s, trouble.end + self._random.random())

    def _clean(self, second: int, is_clean: bool) -> None:
        """Count seconds in which nothing stands against the pulse, and note what is owed."""
        if not is_clean:
            self._clean_s, self._recovering = 0, None
            return
        self._clean_s += 1
        # The announcement of the first was said amid the trouble.
        if self._clean_s == 2:
            self._recovering = second
        if self._clean_s > RECOVERY_S + 1:
            self._owed.add(second)
            if len(self._owed) > FORGOTTEN_S:
                self._forget(second)

    def _forget(self, second: int) -> None:
        """Settle what is owed for longer than anything may take."""
        lost = {one for one in self._owed if one < second - FORGOTTEN_S // 2}
        self.account.refused_good += len(lost)
        self._owed -= lost

    # The way of a word

    def _pulse(self, its_ns: int) -> Pulse:
        pulse = self._edges.edge(its_ns)
        if len(self._truth) > FORGOTTEN_S:
            for sequence in list(self._truth)[: FORGOTTEN_S // 2]:
                del self._truth[sequence]
        self._truth[pulse.sequence] = its_ns
        return pulse

    def _say(self, at_s: float, word: Fix | TimeMark | None) -> None:
        """The receiver says it: a line keeps the order of words."""
        if word is not None:
            self._line_s = max(self._line_s, at_s)
            self._later(self._line_s, word)

    def _later(self, at_s: float, word: Pulse | Fix | TimeMark) -> None:
        self._count += 1
        heappush(self._queue, (at_s, self._count, word))

    def _deliver(self, until_s: float) -> None:
        """Let the loop turn until a second of the day."""
        while self._queue and max(self._queue[0][0], self._stalled_s) < until_s:
            at_s, _, word = heappop(self._queue)
            now = self._monotonic(max(at_s, self._stalled_s))
            if at_s < self._stalled_s:
                self._turn = now
            self._expire(now)
            self._turn = now
            if isinstance(word, Pulse):
                self._tell(self._pairing.pulse(word))
            elif isinstance(word, Fix):
                self._tell(self._pairing.fix(word._replace(monotonic=now)))
            else:
                self._tell(self._pairing.mark(word._replace(monotonic=now)))
        if self._stalled_s < until_s:
            self._expire(self._monotonic(min(until_s, self.plan.seconds + FORGOTTEN_S)))

    def _expire(self, now: float) -> None:
        """Serve timers up to now; none is served before the last turn of the loop, whatever it was set to."""
        while (due := self._pairing.deadline()) is not None and due <= now:
            self._tell(self._pairing.expire(max(due, self._turn)))

    def _monotonic(self, second: float) -> float:
        return self._machine.clocks(self._its_ns(second)).monotonic

    def _its_ns(self, second: float) -> int:
        return self.plan.start_s * SECOND_NS + round(second * 1e9)

    # What comes of it

    def _tell(self, events: Iterable[Event]) -> None:
        account = self.account
        for event in events:
            if isinstance(event, Second):
                self._estimator.second(event)
                account.passed += 1
                account.stepped += event.is_stepped
                off_ns = abs(self._truth[event.pulse.sequence] - event.its_s * SECOND_NS)
                account.false += off_ns > 0
                account.off_ns = max(account.off_ns, off_ns)
                account.wrong += off_ns >= SECOND_NS // 2
                self._followed = second = event.its_s - self.plan.start_s
                self._owed.discard(second)
                if self._recovering is not None and second >= self._recovering:
                    account.back_s = max(account.back_s, second - self._recovering)
                    self._recovering = None
            elif isinstance(event, Acquired):
                account.acquired += 1

    def _sample(self, second: int) -> None:
        its_ns = self._its_ns(second + END_S)
        known = self._estimator.estimate(self._oscillator.raw_ns(its_ns))
        if known is None:
            self.account.blind += 1
            return
        state = PULSES if second - self._followed < HOLDOVER_S else HOLDOVER
        self.account.known[state].add(known[0] - its_ns, known[1])
        quality = self._estimator.quality(self._machine.clocks(its_ns))
        assert quality.offset_ns is not None
        assert quality.uncertainty_ns is not None
        self.account.states[quality.state] += 1
        self.account.told.add(self._machine.system_offset_ns(its_ns) - quality.offset_ns, quality.uncertainty_ns)
