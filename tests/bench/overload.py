"""Overload: more than the station can take, both ways. DENMs pass, every loss is counted, memory stays flat.

usage: python -m tests.bench.overload     DURATION (10) seconds and CAPTAIN, the command, from the environment
The binary is measured where it is built: its memory is what counts on a box.
"""

import os
import sys
import threading
from collections.abc import Mapping
from typing import Any

from tests.bench import measure, programs
from tests.bench.subject import BINARY, SOURCE, Station

DENM_RATE = 10.0
DENM_GOAL_MS = 50.0
MEMORY_GOAL_KB = 40_000
SAMPLES = 60  # of memory, at most one each second
# Slope of resident memory that a run may show after its first half: what an allocator does, no leak.
FLAT_KB_PER_MIN = 100.0
SETTLED_S = 60.0  # a shorter run shows how its queues fill, not what grows


class MemoryWatch:
    """Samples a station's resident memory beside a flow that blocks."""

    def __init__(self, station: Station, duration: float) -> None:
        self.samples: list[tuple[float, int]] = []
        self._station = station
        self._step = max(0.25, duration / SAMPLES)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._sample)

    def __enter__(self) -> "MemoryWatch":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def slope_kb_per_min(self) -> float:
        """Of a straight line through the second half: by then every queue has its greatest length."""
        half = self.samples[len(self.samples) // 2 :]
        mean_t = sum(t for t, _ in half) / len(half)
        mean_kb = sum(kb for _, kb in half) / len(half)
        spread = sum((t - mean_t) ** 2 for t, _ in half)
        return 60 * sum((t - mean_t) * (kb - mean_kb) for t, kb in half) / spread if spread else 0.0

    def _sample(self) -> None:
        at = 0.0
        while not self._over.wait(self._step):
            at += self._step
            self.samples.append((at, self._station.memory_kb()))


def report(captain: str = "", duration: float = 10.0) -> dict[str, Any]:
    """Run both ways for so many seconds each, print what came of it, return all figures."""
    captain = captain or (BINARY if os.path.exists(BINARY) else SOURCE)
    result = {way: run(captain, duration) for way, run in (("interface-user", flood_in), ("user-interface", flood_out))}
    for way, one in result.items():
        print(f"\noverload {way}, {duration:g} s, {os.path.relpath(captain, programs.ROOT)}")
        print("\n".join(f"  {key:34}{value}" for key, value in one.items() if key != "memory"))
    return result


def flood_in(captain: str, duration: float) -> dict[str, Any]:
    """CAMs as fast as datagrams go, and 10 DENMs per second among them."""
    with Station(captain=captain) as station, MemoryWatch(station, duration) as memory:
        flow = measure.flow(station, "interface-user", rate=0, duration=duration, grace=3, denm_rate=DENM_RATE, count=0)
        status = station.status()
        kernel, other = drops_at(status, "bench")
        handed = status["endpoint"]["published"]
        received = sum(status["interfaces"]["bench"]["received"].values())
        slow = status["endpoint"]["slow_count"]
    return {
        "sent_per_s": flow["rate"],
        "published_per_s": round(handed / flow["elapsed_s"]),
        "sent": flow["sent"],
        "received_by_the_interface": received,
        "published": handed,
        "kernel_drops": kernel,
        "other_drops": other,
        "sum_is_exact": flow["sent"] == received + kernel and received == handed + other,
        "reached_the_user": flow["received"],
        "slow_subscriber_seen": slow,
        "denms_sent": flow["denms_sent"],
        "denms_received": flow["denm"]["count"],
        "denm_median_ms": flow["denm"]["median_us"] / 1000,
        "denm_max_ms": flow["denm"]["max_us"] / 1000,
        "denms_within_50_ms": flow["denm"]["count"] == flow["denms_sent"]
        and flow["denm"]["max_us"] <= 1000 * DENM_GOAL_MS,
    } | _memory(memory, duration)


def flood_out(captain: str, duration: float) -> dict[str, Any]:
    """Requests through PULL as fast as it takes them: nothing is lost before it."""
    with Station(captain=captain) as station, MemoryWatch(station, duration) as memory:
        flow = measure.flow(station, "user-interface", push=1, rate=0, duration=duration, grace=3, count=0)
        status = station.status()
        kernel, dropped = drops_at(status, "bench")
        refused = sum(drops_at(status, "pull"))
        requests = status["endpoint"]["requests"]
        sent = sum(status["interfaces"]["bench"]["sent"].values())
    return {
        "sent_per_s": flow["rate"],
        "requests_sent": flow["sent"],
        "requests": requests,
        "sent_by_the_interface": sent,
        "drops": dropped + refused,
        "sum_is_exact": flow["sent"] == requests == sent + dropped + refused + kernel,
        "arrived": flow["received"],
        "drops_of_the_sink": flow["sink_drops"],
        "arrivals_are_exact": flow["received"] + flow["sink_drops"] == sent,
    } | _memory(memory, duration)


def drops_at(status: Mapping[str, Any], where: str) -> tuple[int, int]:
    """Of one place: what the kernel dropped, and everything else."""
    rows = [row for row in status["drops"] if row["where"] == where]
    kernel = sum(row["count"] for row in rows if row["reason"] == "kernel-queue")
    return kernel, sum(row["count"] for row in rows) - kernel


def _memory(memory: MemoryWatch, duration: float) -> dict[str, Any]:
    slope = memory.slope_kb_per_min()
    return {
        "memory_kb_first_last_most": (memory.samples[0][1], memory.samples[-1][1], max(kb for _, kb in memory.samples)),
        "memory_slope_kb_per_min": round(slope, 1),
        "memory_below_40_MB": max(kb for _, kb in memory.samples) < MEMORY_GOAL_KB,
        "memory_is_flat": slope < FLAT_KB_PER_MIN if duration >= SETTLED_S else "too short to tell",
        "memory": memory.samples,
    }


if __name__ == "__main__":
    programs.build()
    report(os.environ.get("CAPTAIN", ""), float(os.environ.get("DURATION", "10")))
    sys.exit(0)
