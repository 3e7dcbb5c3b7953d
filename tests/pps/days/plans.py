"""A day for every fault, and days of all of them together as chance has it."""

from collections.abc import Callable, Iterable
from random import Random

from board.time.scales import EPOCH, LeapEvent
from pps.sim.interrupts import SHORTEST_NS
from pps.sim.oscillator import START_NS, drawn
from pps.sim.temperature import Ramp, Temperature, clouds, engine, fan
from tests.pps.days.day import DAY_S, SECOND_NS, Plan
from tests.pps.days.trouble import Kind, Trouble
from tests.pps.days.words import WEEK_S, Leaping

HOUR = 3600
NOON_2016 = 410_270_404  # ITS second of 2016-12-31T12:00:00Z
START = START_NS // SECOND_NS

# A receiver that is wrong has been told by satellites after one frame of GPS, in which leap seconds come once.
WRONG_S = 750
# Without pulses for longer than this nothing can tell, and the receiver has to be right.
TOLD_S = 3_000
# And this is when a pairing does not ask it to.
LOST_S = 4_000
# Seconds without trouble between two that concern the receiver: 4 to agree, and some more.
REST_S = 60
AROUND_S = 15 * HOUR  # from noon to after midnight


def train(kind: Kind, every_s: int, seconds: tuple[int, int], amounts: Iterable[float], seed: int) -> list[Trouble]:
    """Trouble all day, of a length that varies, with one amount after the other."""
    random, amounts = Random(f"{kind} {seed}"), list(amounts)
    begins = range(every_s // 2, DAY_S - max(seconds) - REST_S, every_s)
    return [Trouble(at, random.randint(*seconds), kind, amounts[n % len(amounts)]) for n, at in enumerate(begins)]


def _labels() -> list[Trouble]:
    """One second too many or too few, by either message and by both, out of the blue and on return."""
    alone = [
        *train(Kind.MARK, 7_200, (1, WRONG_S), (1, -1), 1),
        *(one._replace(at=one.at + 1_000) for one in train(Kind.EPOCH, 7_200, (1, WRONG_S), (1, -1), 2)),
        *(one._replace(at=one.at + 2_000) for one in train(Kind.BOTH, 7_200, (1, WRONG_S), (1, -1, 2, -37), 3)),
    ]
    back = []
    for number, one in enumerate(train(Kind.LOSS, 7_200, (20, 2_000), (0,), 4)):
        lost = one._replace(at=one.at + 2_900)
        wrong = (1, -1)[number % 2]
        back += [lost, Trouble(lost.end, 100 + 15 * number, (Kind.BOTH, Kind.MARK, Kind.EPOCH)[number % 3], wrong)]
    return alone + back


def _steps() -> list[Trouble]:
    """By chronyd at its start, by an operator, by a battery-backed clock that comes late."""
    amounts = (
        0.3,
        -0.3,
        0.000_5,
        -0.005,
        1.0,
        -1.0,
        3600.0,
        -3600.0,
        0.002,
        -0.05,
        86_400.0,
        -5 * 86_400.0,
        0.999_9,
        -0.128,
    )
    return train(Kind.STEP, 900, (1, 1), amounts, 5)


def _outages() -> list[Trouble]:
    lengths = (5, 20, 45, 90, 300, 900, 2_400, 7_200, 15_000)
    at, found = 2_000, []
    for length in lengths:
        found.append(Trouble(at, length, Kind.LOSS))
        at += length + 5_000
    return found


def _missed() -> list[Trouble]:
    return [
        *train(Kind.MISSED, 3_000, (200, 900), (0.05, 0.5, 0.9), 6),
        *(one._replace(at=one.at + 1_200) for one in train(Kind.MISSED, 6_000, (2, 1_000), (1.0,), 7)),
    ]


def _noise() -> list[Trouble]:
    return [
        *train(Kind.NOISE, 7_200, (300, 1_200), (0.05, 0.5, 1.0), 8),
        *(one._replace(at=one.at + 2_400) for one in train(Kind.BOUNCE, 7_200, (300, 1_200), (1, -1), 9)),
        *(one._replace(at=one.at + 300) for one in train(Kind.TRAILING, 7_200, (600, 1_500), (0,), 10)),
    ]


def _returns() -> list[Trouble]:
    """Satellites are lost and seen again while an edge of noise comes in each second, or pulses have two ends."""
    found = []
    for number, at in enumerate(range(1_000, DAY_S - 2_000, 1_500)):
        noise = Trouble(at, 900, (Kind.NOISE, Kind.NOISE, Kind.TRAILING)[number % 3], 1.0)
        found += [noise, Trouble(at + 200, 20 + 15 * (number % 30), Kind.LOSS)]
    return found


def _epochs() -> list[Trouble]:
    """What messages alone may say: other seconds, nothing, and the free time of a receiver without satellites."""
    return [
        *train(Kind.EPOCH, 7_200, (1, WRONG_S), (1, -1, 2, -1024 * WEEK_S), 17),
        *(one._replace(at=one.at + 2_000) for one in train(Kind.RESTART, 7_200, (12, 750), (0,), 18)),
        *(one._replace(at=one.at + 3_500) for one in train(Kind.LOSS, 7_200, (20, 2_000), (0,), 19)),
        *(one._replace(at=one.at + 1_000) for one in train(Kind.STEP, 3_600, (1, 1), (0.3, -1.0, 3600.0, 5e-4), 20)),
    ]


def _restarts() -> list[Trouble]:
    """12.5 minutes are one frame of GPS: leap seconds come once in it."""
    return train(Kind.RESTART, 4_800, (12, 750), (0,), 11) + [
        one._replace(at=one.at + 1_800) for one in train(Kind.VAGUE, 4_800, (1, 1_200), (1_001, 5e3, 1e9), 12)
    ]


def days(seed: int = 1) -> list[Plan]:
    """One for each."""
    lively = drawn(seed + 4)
    sun = Temperature(diurnal_k=8.0, ramps=[*clouds(seed, 7 * HOUR, 18 * HOUR), *fan(seed, 10 * HOUR, 17 * HOUR)])
    drive = Temperature(ramps=[*engine(5 * HOUR), *engine(19 * HOUR, kelvin=25.0), *clouds(seed, 8 * HOUR, 17 * HOUR)])
    loads = tuple((at, at + 900.0) for at in range(1_800, DAY_S, 3_600))
    return [
        Plan("engine and sun", seed, crystal=drawn(seed + 7), temperature=drive),
        Plan("interrupts", seed, loads=loads),
        Plan("missed pulses", seed, tuple(_missed())),
        Plan("false edges", seed, tuple(_noise())),
        Plan("back amid noise", seed, tuple(_returns())),
        Plan("outages", seed, tuple(_outages()), crystal=lively, temperature=sun),
        Plan("labels", seed, tuple(_labels())),
        Plan("clock stepped", seed, tuple(_steps())),
        Plan("clock slewed", seed, tuple(train(Kind.SLEW, 3_600, (10, 1_800), (83_333_000.0, -83_333_000.0), 13))),
        Plan("late words", seed, tuple(train(Kind.LATE, 3_600, (30, 1_200), (0.5, 1.5, 5.0), 14))),
        Plan("stalled loop", seed, tuple(train(Kind.STALL, 700, (0, 30), (0,), 15))),
        Plan("restarts", seed, tuple(_restarts())),
        leaping_day("leap second inserted", seed, 1),
        leaping_day("leap second deleted", seed, -1),
        leaping_day("leap second unsaid", seed, 1, is_announced=False),
        _week(seed),
        Plan("messages alone", seed, tuple(_epochs()), is_wired=False),
        Plan("the system's word", seed, tuple(_restarts()), is_wired=False, word_ns=5_000_000),
    ]


def emulated() -> Plan:
    """A machine in a machine: stamps are 0.4 ms late, and that wanders by 50 us; the crystal is as the host's."""
    outages = tuple(Trouble(at, 600, Kind.LOSS) for at in range(HOUR, 8 * HOUR, 2 * HOUR))
    return Plan("emulated", 1, outages, base_ns=400_000, wander_ns=50_000, latency_ns=800_000, seconds=8 * HOUR)


def leaping_day(name: str, seed: int, change: int, is_announced: bool = True) -> Plan:
    """From noon on 31 December 2016 to the morning; what was inserted then may as well have been left out."""
    midnight_s = NOON_2016 + 12 * HOUR
    event = LeapEvent(midnight_s - (change < 0), change)
    around = (Trouble(6 * HOUR, 900, Kind.LOSS), Trouble(12 * HOUR + 600, 300, Kind.RESTART))
    leaping = Leaping(17, event, is_announced)
    return Plan(name, seed, around, start_s=NOON_2016, leaping=leaping, seconds=AROUND_S)


def _week(seed: int) -> Plan:
    """From noon on a Saturday over the end of GPS week 2421; and a receiver that takes its week for another."""
    saturday = 1_780_747_200 - EPOCH + 5  # 2026-06-06T12:00:00Z
    wrong = train(Kind.BOTH, 9_000, (10, WRONG_S), (1024 * WEEK_S, -1024 * WEEK_S, WEEK_S), 16)
    wrong = [one for one in wrong if one.end < AROUND_S - REST_S]
    return Plan("week", seed, tuple(wrong), start_s=saturday, seconds=AROUND_S)


# The days of a year


def random_day(seed: int) -> Plan:
    """A crystal, a climate and troubles that nobody chose."""
    random = Random(f"day {seed}")
    ramps: list[Ramp] = []
    if random.random() < 0.5:
        ramps += clouds(seed, 7 * HOUR, 18 * HOUR, kelvin=random.uniform(1, 8))
    if random.random() < 0.4:
        ramps += fan(seed, 9 * HOUR, 18 * HOUR, kelvin=random.uniform(2, 8))
    if random.random() < 0.4:
        ramps += engine(random.uniform(4, 18) * HOUR, kelvin=random.uniform(5, 30))
    temperature = Temperature(random.uniform(15, 55), random.uniform(1, 10), ramps=ramps)
    loads = tuple(
        (at, at + random.uniform(10, 2_000)) for at in sorted(random.sample(range(DAY_S), random.randint(0, 12)))
    )
    base_ns = random.uniform(*SHORTEST_NS)
    start_s = START + random.randrange(365) * DAY_S + random.randrange(DAY_S)
    troubles = (*_receiver_troubles(random), *_other_troubles(random))
    return Plan(f"day {seed}", seed, troubles, drawn(seed), temperature, base_ns, loads, start_s)


def _receiver_troubles(random: Random) -> list[Trouble]:
    """One after the other, with some rest between."""
    found: list[Trouble] = []
    at = random.randint(REST_S, 10_000)
    while at < DAY_S - 2 * HOUR:
        choice: Callable[[Random, int], list[Trouble]] = random.choice(_CHOICES)
        found += choice(random, at)
        at = found[-1].end + REST_S + round(random.expovariate(1 / 6_000))
    return [one for one in found if one.end < DAY_S - REST_S]


def _lost(random: Random, at: int) -> list[Trouble]:
    """Satellites; for seconds or for hours alike. Back again, the receiver may be wrong, unless it was long gone."""
    lost = Trouble(at, round(10 ** random.uniform(0.5, 4.3)), Kind.LOSS)
    if lost.seconds > TOLD_S or random.random() < 0.6:
        return [lost]
    wrong = _wrong(random, lost.end)
    return [lost, *wrong]


def _wrong(random: Random, at: int) -> list[Trouble]:
    kind = random.choice((Kind.MARK, Kind.EPOCH, Kind.BOTH))
    amount = random.choice((1, 1, -1, -1, 2, -3, 18, -1024 * WEEK_S))
    return [Trouble(at, random.randint(1, WRONG_S), kind, amount)]


_CHOICES: tuple[Callable[[Random, int], list[Trouble]], ...] = (
    _lost,
    _lost,
    _wrong,
    lambda random, at: [Trouble(at, random.randint(12, 750), Kind.RESTART)],
    lambda random, at: [Trouble(at, random.randint(1, 1_500), Kind.VAGUE, random.choice((1_001, 1e5, 4e9)))],
    lambda random, at: [Trouble(at, random.randint(5, 600), Kind.LATE, random.uniform(0.2, 4))],
    lambda random, at: [Trouble(at, random.randint(1, 40), Kind.STALL)],
    lambda random, at: [Trouble(at, random.randint(1, 900), Kind.MISSED, random.uniform(0.05, 1))],
)


def _other_troubles(random: Random) -> list[Trouble]:
    """What does not keep a pulse from being good."""
    found = []
    for _ in range(random.randint(0, 6)):
        at, seconds = random.randrange(60, DAY_S - 4_000), random.randint(1, 3_600)
        kind = random.choice((Kind.NOISE, Kind.BOUNCE, Kind.TRAILING, Kind.STEP))
        if kind is Kind.STEP:
            seconds = 1
        amount = random.uniform(0.01, 1) if kind is Kind.NOISE else random.choice((-1, 1)) * 10 ** random.uniform(-3, 5)
        found.append(Trouble(at, seconds, kind, amount))
    if random.random() < 0.4:
        at = random.randrange(60, DAY_S - 4_000)
        found.append(Trouble(at, random.randint(10, 1_800), Kind.SLEW, random.uniform(-83.3e6, 83.3e6)))
    return found
