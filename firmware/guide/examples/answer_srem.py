# answer_srem.py INTERSECTION [STATION]
import sys
from argparse import ArgumentParser
from contextlib import suppress
from typing import Any

from captain_client import Station, StationError

SIGNAL = "ssm.status[0].sigStatus[0]"

parser = ArgumentParser()
parser.add_argument("intersection", type=int)
parser.add_argument("station", nargs="?", default="")
asked = parser.parse_args()
try:
    with suppress(KeyboardInterrupt), Station(asked.station) as box:
        for srem in box.listen("srem"):
            if srem.error or srem.get("intersection") != asked.intersection:
                continue
            answer: dict[str, Any] = {
                f"{SIGNAL}.inboundOn.lane": srem.get("in_lane") or 0,
                f"{SIGNAL}.requester.id.stationID": srem.station,
                f"{SIGNAL}.requester.request": srem.get("request"),
                f"{SIGNAL}.requester.sequenceNumber": srem.get("sequence_number") or 0,
            }
            sent = box.send("ssem", intersection=asked.intersection, status="granted", **answer)
            print(f"station {srem.station}: granted by {', '.join(sent.confirmed().sent)}", flush=True)
except StationError as error:
    sys.exit(f"captain: {error}")
