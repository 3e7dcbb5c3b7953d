# csv_stations.py [STATION]
import csv
import sys
from contextlib import suppress

from captain_client import Station, StationError

VALUES = ("latitude", "longitude", "speed", "heading")

try:
    with suppress(KeyboardInterrupt), Station(*sys.argv[1:]) as box:
        rows = csv.writer(sys.stdout)
        rows.writerow(("received_s", "type", "station", *VALUES, "interface", "rssi_dbm"))
        for message in box.listen("cam", "vam"):
            values = [None if message.error else message.get(name) for name in VALUES]
            received_s = message.received_ns / 1e9
            rows.writerow((received_s, message.type, message.station, *values, message.interface, message.rssi_dbm))
            sys.stdout.flush()
except StationError as error:
    sys.exit(f"captain: {error}")
