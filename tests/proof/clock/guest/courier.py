"""In the guest: a user of the station who sends a CAM now and again, and says when by the system's clock."""

import itertools
import json
import time
from hashlib import sha256

import zmq

PULL = "tcp://127.0.0.1:5557"
PERIOD_S = 0.23
HEADER = bytes.fromhex("020200000539")  # version 2, CAM, station 1337: what routing looks at
DIGITS = 16  # of a digest, as reports have them


def main() -> None:
    context = zmq.Context()
    station: zmq.Socket[bytes] = context.socket(zmq.PUSH)
    station.connect(PULL)
    for number in itertools.count():
        time.sleep(PERIOD_S)
        now_ns = time.time_ns()
        pdu = HEADER + number.to_bytes(8, "big") + now_ns.to_bytes(8, "big")
        sent_ns = time.time_ns()
        station.send_multipart([b"v2x.cam.", pdu])
        print(json.dumps({"digest": sha256(pdu).hexdigest()[:DIGITS], "sent_ns": sent_ns}), flush=True)


if __name__ == "__main__":
    main()
