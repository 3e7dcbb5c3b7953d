# gpx_cams.py FILE [STATION]
import math
import sys
import time
from datetime import datetime
from itertools import pairwise
from xml.etree import ElementTree

from captain_client import Station

PER_SECOND, METRES_PER_DEGREE = 10, 111_320

path, *where = sys.argv[1:] or [""]
try:
    found = ElementTree.parse(path).findall(".//{*}trkpt[{*}time]")
    places = [(float(point.attrib["lat"]), float(point.attrib["lon"])) for point in found]
    times = [datetime.fromisoformat(point.findtext("{*}time", "").replace("Z", "+00:00")) for point in found]
except (OSError, SyntaxError, KeyError, ValueError) as error:
    sys.exit(f"usage: gpx_cams.py FILE [STATION]; {path}: {error}")
track = sorted({when.timestamp(): place for when, place in zip(times, places, strict=True)}.items())
if len(track) < 2:
    sys.exit(f"{path}: fewer than two track points with a time")
with Station(*where) as box:
    start = time.time() - track[0][0]  # the track begins now
    for (time0, (lat0, lon0)), (time1, (lat1, lon1)) in pairwise(track):
        north = (lat1 - lat0) * METRES_PER_DEGREE
        east = (lon1 - lon0) * METRES_PER_DEGREE * math.cos(math.radians(lat0))
        speed, heading = math.hypot(north, east) / (time1 - time0), math.degrees(math.atan2(east, north)) % 360
        steps = round((time1 - time0) * PER_SECOND)
        for part in (step / steps for step in range(steps)):
            time.sleep(max(0.0, start + time0 + part * (time1 - time0) - time.time()))
            latitude, longitude = lat0 + part * (lat1 - lat0), lon0 + part * (lon1 - lon0)
            box.send("cam", latitude=latitude, longitude=longitude, speed=speed, heading=heading).confirmed()
