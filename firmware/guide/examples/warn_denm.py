# warn_denm.py [STATION]
import math
import sys
import time
from contextlib import suppress
from typing import Any

from captain_client import Station, StationError

NEAR_M, AHEAD_DEG, FRESH_S = 300.0, 45.0, 0.5  # in 0.5 s, a car at 30 m/s drives 15 m
own: dict[str, Any] = {}
asked = -math.inf
try:
    with suppress(KeyboardInterrupt), Station(*sys.argv[1:]) as box:
        for denm in box.listen("denm"):
            if time.monotonic() > asked + FRESH_S:
                own, asked = box.status()["position"], time.monotonic()
            if denm.error or denm.get("termination") or own.get("heading_deg") is None:
                continue  # a cancelled event, or a standing station, which does not know its heading
            latitude, longitude = denm.get("latitude"), denm.get("longitude")
            if not isinstance(latitude, int | float) or not isinstance(longitude, int | float):
                continue  # text: unavailable
            north = (latitude - own["latitude"]) * 111_320  # metres
            east = (longitude - own["longitude"]) * 111_320 * math.cos(math.radians(own["latitude"]))
            distance_m = math.hypot(north, east)
            aside_deg = (math.degrees(math.atan2(east, north)) - own["heading_deg"] + 180) % 360 - 180
            if distance_m <= NEAR_M and abs(aside_deg) <= AHEAD_DEG:
                print(f"station {denm.station}: cause {denm.get('cause')}, {distance_m:.0f} m ahead", flush=True)
except StationError as error:
    sys.exit(f"captain: {error}")
