# gpx_cams.py FILE [STATION]
import math
import sys
import time
from contextlib import suppress
from datetime import datetime
from itertools import pairwise
from xml.etree import ElementTree

from captain_client import Station, StationError

path, *where = sys.argv[1:] or [""]
try:
    points = ElementTree.parse(path).findall(".//{*}trkpt[{*}time]")
    times = [datetime.fromisoformat(one.findtext("{*}time", "").replace("Z", "+00:00")).timestamp() for one in points]
    track = {t: (float(p.attrib["lat"]), float(p.attrib["lon"])) for t, p in zip(times, points, strict=True)}
    start = time.time() - min(track) if len(track) > 1 else sys.exit(f"{path}: fewer than two track points with a time")
    with suppress(KeyboardInterrupt), Station(*where) as box:
        for (time0, (lat0, lon0)), (time1, (lat1, lon1)) in pairwise(sorted(track.items())):
            north, east = (lat1 - lat0) * 111_320, (lon1 - lon0) * 111_320 * math.cos(math.radians(lat0))  # metres
            speed, heading = math.hypot(north, east) / (time1 - time0), math.degrees(math.atan2(east, north)) % 360
            for step in range(steps := round((time1 - time0) * 10)):  # ten a second
                time.sleep(max(0.0, start + time0 + step / 10 - time.time()))
                latitude, longitude = lat0 + step / steps * (lat1 - lat0), lon0 + step / steps * (lon1 - lon0)
                box.send("cam", latitude=latitude, longitude=longitude, speed=speed, heading=heading).confirmed()
except (OSError, SyntaxError, KeyError, ValueError) as error:
    sys.exit(f"usage: gpx_cams.py FILE [STATION]; {path}: {error}")
except StationError as error:
    sys.exit(f"captain: {error}")
