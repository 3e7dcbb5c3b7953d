# losses.py COUNT SENDER RECEIVER
import time
from argparse import ArgumentParser

from captain_client import Station

PAUSE, PATIENCE = 0.01, 1.0  # s
CAR = 900001  # stationID

parser = ArgumentParser()
parser.add_argument("count", type=int)
parser.add_argument("sender")
parser.add_argument("receiver")
asked = parser.parse_args()
with (
    Station(asked.receiver) as receiver,
    receiver.listen("cam", timeout_s=PATIENCE) as messages,
    Station(asked.sender) as sender,
):
    speeds = {number / 10 for number in range(asked.count)}  # the speed tells the messages apart
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
