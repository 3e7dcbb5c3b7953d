"""One measurement each: a flow at a rate, the highest loss-free rate, processor time, memory, start."""

import json
import struct
import subprocess
import time
from statistics import median
from typing import Any

from tests.bench import programs
from tests.bench.subject import Subject

WAYS = ("interface-user", "user-interface")
Flow = dict[str, Any]

# A rate is loss-free when everything arrives and the last message is not later than this: a queue that grows
# for as long as messages come is a loss that has not happened yet.
LATE_MS = 20.0
PROBE_S = 0.4
LOWEST, HIGHEST = 2_000.0, 400_000.0
RESOLUTION, FINE = 1.06, 1.03  # the last step is at most 9 %, and 4.5 %
TRIES = 5  # what else runs on the machine spoils some of them, for the floor as for the station


def flow(subject: Subject, way: str, *, prefix: bytes = b"", watched: bool = False, **words: float) -> Flow:
    """Send one way through a subject; words are those of load.h. Returns what the program flow prints.

    watched  somebody also reads `raw.` and all reports.
    """
    ports = subject.ports
    arguments = {
        "way": way,
        "from_users": ports.pull if words.get("push") else ports.from_users,
        "to_users": ports.to_users,
        "listen": ports.listen,
        "peer": ports.peer,
        "prefix": prefix.hex(),
        **({"raw": 1, "report": ports.report} if watched else {}),
        **words,
    }
    limit = 30 + words.get("duration", 10) + words.get("grace", 1)
    command = [programs.path("flow"), *(f"{name}={value}" for name, value in arguments.items() if value != "")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=limit, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr)
    result: Flow = json.loads(done.stdout)
    return result


def latency(subject: Subject, way: str, rate: int, count: int, **how: Any) -> Flow:
    """Latencies at a rate, with the processor time that the subject spent on them."""
    before, start = subject.cpu_s(), time.monotonic()
    result = flow(subject, way, rate=rate, count=count, duration=2 * count / rate + 1, **how)
    elapsed = time.monotonic() - start
    cpu = subject.cpu_s() - before
    return result | {"cpu_us": 1e6 * cpu / count, "cpu_percent": 100 * cpu / elapsed}


def loss_free(subject: Subject, way: str, resolution: float = RESOLUTION, **how: Any) -> float:
    """The highest rate, messages per second, at which nothing is lost for PROBE_S."""
    best, rate, worst = 0.0, 16_000.0, HIGHEST
    while rate < worst / resolution:
        tries = (_passes(subject, way, rate, **how) for _ in range(TRIES))
        reached = next((passed for passed in tries if passed), 0.0)
        if reached:
            best = max(best, reached)
            if reached < 0.9 * rate:  # the generator is at its end, not the subject
                return best
            rate = 2 * rate if worst == HIGHEST else (rate * worst) ** 0.5
        else:
            worst = rate
            rate = (max(best, LOWEST) * worst) ** 0.5
    return best


def idle_percent(subject: Subject, duration: float) -> float:
    """Processor time of a quiet interval, percent of one core."""
    before = subject.cpu_s()
    time.sleep(duration)
    return 100 * (subject.cpu_s() - before) / duration


def first_message_s(subject: Subject) -> float:
    """From the start of the process until the first message at a plain subscriber. The subject must not run."""
    ports = subject.ports
    words = [f"listen={ports.listen}", f"to_users={ports.to_users}"]
    command = [programs.path("first"), *words, "--", *subject.command()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=20, check=True)
    return float(done.stdout)


def ratio_of_medians(pairs: list[tuple[float, float]]) -> float:
    """The median of what the second of each pair is to the first."""
    return float(median(second / first for first, second in pairs if first))


def ethernet_prefix(pdu_octets: int) -> bytes:
    """Ethernet, GeoNetworking (single hop broadcast, EN 302 636-4-1 V1.4.1, clause 9) and BTP-B in front of a PDU."""
    mac = bytes.fromhex("02000000beef")
    ethernet = bytes.fromhex("ffffffffffff") + mac + b"\x89\x47"
    basic = bytes((0x11, 0, 0x1A, 1))  # version 1, common header next; lifetime 60 s; one hop
    common = struct.pack(">BBBBHBB", 0x20, 0x50, 2, 0x80, 4 + pdu_octets, 1, 0)  # BTP-B; SHB; DCC profile 2; mobile
    position = struct.pack(">H6sIiiHH", 0x1400, mac, 0, 487668616, 114320680, 0x8000, 0)
    return ethernet + basic + common + position + bytes(4) + struct.pack(">HH", 2001, 0)


def _passes(subject: Subject, way: str, rate: float, **how: Any) -> float:
    """The rate that was really sent when all of it arrived in time, else 0."""
    one = flow(subject, way, rate=rate, duration=PROBE_S, grace=5 * LATE_MS / 1000, **how)
    is_whole = one["received"] + one["sink_drops"] >= one["sent"] and one["lag_ms"] <= LATE_MS
    return float(one["rate"]) if is_whole else 0.0
