# lamp.py INTERSECTION SIGNAL_GROUP [STATION]
import sys
from argparse import ArgumentParser
from contextlib import suppress

from captain_client import Station, StationError

RED = ("stop-And-Remain", "stop-Then-Proceed")
# On a box, in place of print(): request.set_value(LINE, Value(was_red)) of gpiod.

parser = ArgumentParser()
parser.add_argument("intersection", type=int)
parser.add_argument("signal_group", type=int)
parser.add_argument("station", nargs="?", default="")
asked = parser.parse_args()
was_red = False
try:
    with suppress(KeyboardInterrupt), Station(asked.station) as box:
        for spatem in box.listen("spatem"):
            if spatem.error:
                continue
            for one in spatem.plain["spat"]["intersections"]:
                states = one["states"] if one["id"]["id"] == asked.intersection else []
                for state in states:
                    is_red = state["state-time-speed"][0]["eventState"] in RED
                    if state["signalGroup"] == asked.signal_group and is_red != was_red:
                        print("lamp on" if (was_red := is_red) else "lamp off", flush=True)
except StationError as error:
    sys.exit(f"captain: {error}")
