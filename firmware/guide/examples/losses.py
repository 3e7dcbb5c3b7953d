# losses.py COUNT SENDER RECEIVER
import sys
import time

from captain_client import Station

PAUSE, PATIENCE = 0.01, 1.0  # s
CAR = 900001  # stationID

with (
    Station(sys.argv[3]) as receiver,
    receiver.listen("cam", timeout_s=PATIENCE) as messages,
    Station(sys.argv[2]) as sender,
):
    speeds = {number / 10 for number in range(int(sys.argv[1]))}  # the speed tells the messages apart
    waiting = []
    for speed in sorted(speeds):
        waiting.append(sender.send("cam", station=CAR, latitude=48.7668, longitude=11.432, speed=speed))
        time.sleep(PAUSE)
    sent = sum(1 for one in waiting if one.confirmed().sent)
    end = time.monotonic() + PATIENCE  # other stations may never be silent
    for cam in messages:
        if cam.station == CAR and not cam.error:
            speeds.discard(cam.get("speed"))
        if not speeds or time.monotonic() > end:
            break
    on_the_way = len(speeds) - receiver.missed
    print(f"sent {sent}, lost on the way {on_the_way}, missed by this program {receiver.missed}")
