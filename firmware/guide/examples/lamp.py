# lamp.py SIGNAL_GROUP [STATION]
import sys

from captain_client import Station

RED = ("stop-And-Remain", "stop-Then-Proceed")


def lamp(on: bool) -> None:
    print("lamp on" if on else "lamp off", flush=True)  # on a box: request.set_value(LINE, Value(on)) of gpiod


was_red = False
with Station(*sys.argv[2:]) as box:
    for spatem in box.listen("spatem"):
        if spatem.error:
            continue
        for intersection in spatem.plain["spat"]["intersections"]:
            for state in intersection["states"]:
                is_red = state["state-time-speed"][0]["eventState"] in RED
                if state["signalGroup"] == int(sys.argv[1]) and is_red != was_red:
                    lamp(was_red := is_red)
