# time_bound.py LIMIT_MS [STATION]
import sys
from argparse import ArgumentParser
from contextlib import suppress

from captain_client import Station, StationError

parser = ArgumentParser()
parser.add_argument("limit_ms", type=float)
parser.add_argument("station", nargs="?", default="")
asked = parser.parse_args()
limit_ns = asked.limit_ms * 1e6
was_good = None
try:
    with suppress(KeyboardInterrupt), Station(asked.station) as box:
        while True:
            now = box.time()
            is_good = now["error_ns"] is not None and now["error_ns"] <= limit_ns
            bound = "unknown" if now["error_ns"] is None else f"{now['error_ns'] / 1e6:.3f} ms"
            if is_good != was_good:
                print("good:" if is_good else "not good:", f"{now['state']}, error at most {bound}", flush=True)
            was_good = is_good
except StationError as error:
    sys.exit(f"captain: {error}")
