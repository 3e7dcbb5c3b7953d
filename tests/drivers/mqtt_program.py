"""A program with the MQTT worker, started by tests of it as the station starts itself."""

import sys

from board.worker import child
from drivers.mqtt_client import serve

if __name__ == "__main__":
    sys.exit(child(sys.argv, {"mqtt": lambda: serve}))
