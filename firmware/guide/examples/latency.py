# latency.py COUNT [STATION]
import sys
from argparse import ArgumentParser
from contextlib import suppress
from statistics import mean

from captain_client import Station, StationError

MOST = 1000  # messages that wait for their second reception
parser = ArgumentParser()
parser.add_argument("count", type=int)
parser.add_argument("station", nargs="?", default="")
asked = parser.parse_args()
later_ms: list[float] = []
waiting: dict[str, dict[str, int]] = {}  # times of reception by digest, then by interface
try:
    with suppress(KeyboardInterrupt), Station(asked.station) as box:
        for reception in box.indications("cam"):
            times = waiting.pop(reception["digest"], {}) | {reception["interface"]: reception["received_ns"]}
            if "g5" in times and "v2n" in times:
                later_ms.append((times["v2n"] - times["g5"]) / 1e6)
            elif len(waiting) < MOST:
                waiting[reception["digest"]] = times
            else:
                waiting.clear()
            if len(later_ms) == asked.count:
                print(f"v2n is {mean(later_ms):.1f} ms later than g5: mean of {len(later_ms)} messages")
                break
except StationError as error:
    sys.exit(f"captain: {error}")
