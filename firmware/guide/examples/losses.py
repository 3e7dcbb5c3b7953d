# losses.py COUNT SENDER RECEIVER
import sys
import time
from argparse import ArgumentParser
from contextlib import suppress

from captain_client import Station, StationError

PAUSE, PATIENCE, CAR = 0.01, 1.0, 900001  # seconds, seconds, stationID
parser = ArgumentParser()
parser.add_argument("count", type=int)
parser.add_argument("sender")
parser.add_argument("receiver")
asked = parser.parse_args()
try:
    with suppress(KeyboardInterrupt), Station(asked.receiver) as receiver, Station(asked.sender) as sender:
        messages = receiver.listen("cam", timeout_s=PATIENCE)
        waiting = []
        for number in range(asked.count):  # the speed differs; a CAM has at most 163.82 m/s
            speed = number % 1639 / 10
            waiting.append(sender.send("cam", station=CAR, latitude=48.7668, longitude=11.432, speed=speed))
            time.sleep(PAUSE)
        sent = sum(1 for one in waiting if one.confirmed().sent)
        received, end = 0, time.monotonic() + PATIENCE  # other stations may never be silent
        while received < sent and time.monotonic() < end and (cam := next(messages, None)):
            received += cam.station == CAR
        print(f"sent {sent}, received {received}; this program missed {receiver.missed} CAMs of all stations")
except StationError as error:
    sys.exit(f"captain: {error}")
