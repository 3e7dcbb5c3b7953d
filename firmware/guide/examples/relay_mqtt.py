# relay_mqtt.py TYPE BROKER_PORT [STATION]
import json
import sys
from argparse import ArgumentParser
from contextlib import suppress

import paho.mqtt.client as mqtt
from paho.mqtt.enums import CallbackAPIVersion

from captain_client import Station, StationError

parser = ArgumentParser()
parser.add_argument("type")
parser.add_argument("broker_port", type=int)
parser.add_argument("station", nargs="?", default="")
asked = parser.parse_args()
broker = mqtt.Client(CallbackAPIVersion.VERSION2)
try:
    with suppress(KeyboardInterrupt), Station(asked.station) as box:
        broker.connect("localhost", asked.broker_port)
        broker.loop_start()  # paho's thread sends in the background and reconnects
        for message in box.listen(asked.type):
            if not message.error:
                broker.publish(f"v2x/{asked.type}/{message.station}", json.dumps(message.plain))
except OSError as error:
    sys.exit(f"MQTT broker at port {asked.broker_port}: {error}")
except StationError as error:
    sys.exit(f"captain: {error}")
