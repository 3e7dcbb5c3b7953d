"""Program that tests start as the MQTT process of a station."""

import sys

from board.runtime.worker import child
from drivers.mqtt.client.process import serve

if __name__ == "__main__":
    sys.exit(child(sys.argv, {"mqtt": lambda: serve}))
