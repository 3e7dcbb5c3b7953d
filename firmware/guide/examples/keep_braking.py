# keep_braking.py [STATION]
import sys
from contextlib import suppress

from captain_client import Station, StationError

HARD_M_S2 = -4.0

try:
    with suppress(KeyboardInterrupt), Station(*sys.argv[1:]) as box:
        for cam in box.listen("cam"):
            if cam.error:
                continue
            acceleration = cam.get("acceleration")
            if isinstance(acceleration, int | float) and acceleration <= HARD_M_S2:  # text: unavailable
                box.trigger(f"braking of station {cam.station}")
                print(f"station {cam.station} brakes at {acceleration} m/s2", flush=True)
except StationError as error:
    sys.exit(f"captain: {error}")
