# relay_mqtt.py TYPE BROKER_PORT [STATION]
import json
from argparse import ArgumentParser

import paho.mqtt.client as mqtt
from paho.mqtt.enums import CallbackAPIVersion

from captain_client import Station

parser = ArgumentParser()
parser.add_argument("type")
parser.add_argument("broker_port", type=int)
parser.add_argument("station", nargs="?", default="")
asked = parser.parse_args()
broker = mqtt.Client(CallbackAPIVersion.VERSION2)
broker.connect("localhost", asked.broker_port)
broker.loop_start()  # paho's thread sends in the background and reconnects
with Station(asked.station) as box:
    for message in box.listen(asked.type):
        if not message.error:
            broker.publish(f"v2x/{asked.type}/{message.station}", json.dumps(message.plain))
