# losses.py COUNT SENDER RECEIVER
import sys
import time
from argparse import ArgumentParser
from contextlib import suppress

from captain_client import Station, StationError

PAUSE, PATIENCE = 0.01, 1.0  # s
CAR = 900001  # stationID

parser = ArgumentParser()
parser.add_argument("count", type=int)
parser.add_argument("sender")
parser.add_argument("receiver")
asked = parser.parse_args()
try:
    with suppress(KeyboardInterrupt), Station(asked.receiver) as receiver, Station(asked.sender) as sender:
        messages = receiver.listen("cam", timeout_s=PATIENCE)
        waiting = []
        for number in range(asked.count):
            speed = number % 1639 / 10  # no two alike in a row; a CAM has at most 163.82 m/s
            waiting.append(sender.send("cam", station=CAR, latitude=48.7668, longitude=11.432, speed=speed))
            time.sleep(PAUSE)
        sent = sum(1 for one in waiting if one.confirmed().sent)
        received, end = 0, time.monotonic() + PATIENCE  # other stations may never be silent
        for cam in messages:
            received += cam.station == CAR
            if received == sent or time.monotonic() > end:
                break
        print(f"sent {sent}, received {received}; this program missed {receiver.missed} CAMs of all stations")
except StationError as error:
    sys.exit(f"captain: {error}")
