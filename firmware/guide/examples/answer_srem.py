# answer_srem.py INTERSECTION [STATION]
import sys
from typing import Any

from captain_client import Station

SIGNAL = "ssm.status[0].sigStatus[0]"

with Station(*sys.argv[2:]) as box:
    for srem in box.listen("srem"):
        if srem.error or srem.get("intersection") != int(sys.argv[1]):
            continue
        answer: dict[str, Any] = {
            f"{SIGNAL}.inboundOn.lane": srem.get("in_lane") or 0,
            f"{SIGNAL}.requester.id.stationID": srem.station,
            f"{SIGNAL}.requester.request": srem.get("request"),
            f"{SIGNAL}.requester.sequenceNumber": srem.get("sequence_number") or 0,
        }
        sent = box.send("ssem", intersection=int(sys.argv[1]), status="granted", **answer)
        print(f"station {srem.station}: granted by {', '.join(sent.confirmed().sent)}", flush=True)
