"""Day in virtual time: pulses and messages through Pairing and Estimator.

Seconds are those of the day; true time is ITS time. A message arrives when a loop would read it: late if its line or
the loop is late.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from heapq import heappop, heappush
from random import Random

from board.time.leaps import BUILT_IN
from board.time.scales import Fix, TimeMark
from pps.chain import SECOND_NS
from pps.model import LATENCY_NS
from pps.pulse import Clocks, Pulse
from pps.quality import HOLDOVER_S, Estimator
from pps.sim.interrupts import Edges, Interrupts
from pps.sim.machine import Machine
from pps.sim.oscillator import START_NS, Crystal, Oscillator
from pps.sim.temperature import Temperature
from pps.timemark import Acquired, Event, Pairing, Second
from tests.pps.days.account import HOLDOVER, PULSES, RECOVERY_S, WHOSE, Account
from tests.pps.days.fed import Fed
from tests.pps.days.trouble import HARMFUL, Kind, Trouble
from tests.pps.days.words import Leaping, Words

DAY_S = 86_400

FIX_S, MARK_S = 0.055, 0.075  # after the pulse, and up to SPREAD_S more
SPREAD_S = 0.06
END_S = 0.95  # of a second: when samples are taken

SAMPLE_S = 10
STEP_NS = 250_000_000  # after a pulse: a step of the system's clock, before that

FORGOTTEN_S = 200  # pulses of so long ago are not asked for any more


@dataclass(frozen=True)
class Plan:
    """What a day is made of.

    base_ns   the shortest path of an interrupt; drawn from all that boards have where it is not given.
    wander_ns, latency_ns  what moves slowly in it, and the most that is expected of both together.
    is_wired  whether the receiver's pulses reach the machine.
    word_ns   what the system says of its clock is right within that, and said every 10 s; None: it says nothing.
    """

    name: str
    seed: int
    troubles: tuple[Trouble, ...] = ()
    crystal: Crystal = field(default_factory=Crystal)
    temperature: Temperature = field(default_factory=Temperature)
    base_ns: float | None = None
    loads: tuple[tuple[float, float], ...] = ()
    start_s: int = START_NS // SECOND_NS
    leaping: Leaping = field(default_factory=Leaping)
    seconds: int = DAY_S
    is_wired: bool = True
    word_ns: int | None = None
    wander_ns: float = 0.0
    latency_ns: int = LATENCY_NS


class Day:
    """One plan, played."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.account = Account()
        self._random = Random(f"{plan.name} {plan.seed}")
        self._oscillator = Oscillator(plan.crystal, plan.temperature, plan.seed, plan.start_s * SECOND_NS)
        self._machine = Machine(self._oscillator, system_error_ns=self._random.randrange(-(10**10), 10**10))
        interrupts = Interrupts(self._random.randrange(10**9), plan.base_ns, plan.loads, plan.wander_ns)
        self._edges = Edges(self._machine, interrupts, plan.seed)
        self._pairing, self._estimator = Pairing(), Estimator(plan.latency_ns)
        self._words = Words(plan.leaping)
        self._fed = Fed() if any(one.kind is Kind.STEP for one in plan.troubles) else None
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
            if self._troubles or self._queue or not self.plan.is_wired:
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
        fix = self._words.fix(its_s, pulse.monotonic + FIX_S + spread)
        if second % SAMPLE_S == 0:
            raw_ns = pulse.raw_ns + round((FIX_S + spread) * 1e9)
            self._estimator.fix(fix, Clocks(pulse.system_ns, raw_ns, fix.monotonic))
        told += pairing.fix(fix)
        told += pairing.mark(self._words.mark(its_s + 1, pulse.monotonic + MARK_S + spread))
        if told:
            self._tell(told)

    def _troubled(self, second: int) -> None:
        plan, troubles = self.plan, self._troubles
        its_s = plan.start_s + second
        has_pulse = plan.is_wired and self._words.has_pulse(second, troubles)
        is_clean = has_pulse and not self._queue and not any(one.kind in HARMFUL for one in troubles)
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
                    off_s = random.uniform(5e-6, 300e-6)
                    times.append(-off_s if trouble.amount < 0 else off_s)
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
                case Kind.STALL:
                    self._stalled_s = max(self._stalled_s, trouble.end + self._random.random())
        for trouble in self._troubles:
            if trouble.kind is Kind.STEP and trouble.at == second:  # before the pulse is confirmed, or after
                self._machine.step(its_ns + self._random.randrange(STEP_NS), round(trouble.amount * 1e9))

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
            clocks = self._machine.clocks(self._its_ns(max(at_s, self._stalled_s)))
            now = clocks.monotonic
            if at_s < self._stalled_s:
                self._turn = now
            self._expire(now)
            self._turn = now
            if isinstance(word, Pulse):
                self._tell(self._pairing.pulse(word), clocks)
            elif isinstance(word, Fix):
                word = word._replace(monotonic=now)
                self._estimator.fix(word, clocks)
                self._tell(self._pairing.fix(word), clocks)
            else:
                self._tell(self._pairing.mark(word._replace(monotonic=now)), clocks)
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

    def _tell(self, events: Iterable[Event], clocks: Clocks | None = None) -> None:
        account = self.account
        for event in events:
            if isinstance(event, Second):
                self._estimator.second(event)
                account.passed += 1
                if self._fed is not None and clocks is not None:
                    self._feed(self._fed, event, clocks)
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

    def _feed(self, fed: Fed, second: Second, clocks: Clocks) -> None:
        """A sample for chronyd, which it takes for one of the clock that it has now.

        An edge that is not the receiver's (Account.false) is off by itself; a clock that is slewed goes on since the edge.
        """
        offset_ns = fed.second(second, BUILT_IN.unix_ns(second.its_s * SECOND_NS), clocks)
        if offset_ns is None:
            return
        self.account.fed += 1
        pulse = second.pulse
        slewed_ppb = sum(abs(one.amount) for one in self._troubles if one.kind is Kind.SLEW)
        slewed_ns = slewed_ppb * (clocks.raw_ns - pulse.raw_ns) / 1e9
        within_ns = (600_000 if self.plan.loads else 100_000) + slewed_ns
        true_ns = self._machine.system_offset_ns(self._oscillator.its_ns(clocks.raw_ns))
        off_ns = self._truth[pulse.sequence] - second.its_s * SECOND_NS
        self.account.misled += abs(offset_ns + off_ns - true_ns) > within_ns

    def _sample(self, second: int) -> None:
        account, its_ns = self.account, self._its_ns(second + END_S)
        clocks, true_ns = self._machine.clocks(its_ns), self._machine.system_offset_ns(its_ns)
        known = self._estimator.estimate(clocks.raw_ns)
        if known is None:
            account.blind += 1
        else:
            state = PULSES if second - self._followed < HOLDOVER_S else HOLDOVER
            account.known[state].add(known[0] - its_ns, known[1])
        quality = self._estimator.quality(clocks)
        if quality.offset_ns is not None and quality.uncertainty_ns is not None:
            account.told[WHOSE[quality.state]].add(true_ns - quality.offset_ns, quality.uncertainty_ns)
        word_ns = self.plan.word_ns
        if word_ns is not None:
            said_ns = true_ns + self._random.randint(-word_ns, word_ns)
            self._estimator.system(said_ns, word_ns, clocks.raw_ns)
