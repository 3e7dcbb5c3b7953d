# relay_mqtt.py TYPE BROKER_PORT [STATION]
import json
import sys

import paho.mqtt.client as mqtt
from paho.mqtt.enums import CallbackAPIVersion

from captain_client import Station

kind, port, *where = sys.argv[1:]
broker = mqtt.Client(CallbackAPIVersion.VERSION2)
broker.connect("localhost", int(port))
broker.loop_start()  # paho's thread sends in the background and reconnects
with Station(*where) as box:
    for message in box.listen(kind):
        if not message.error:
            broker.publish(f"v2x/{kind}/{message.station}", json.dumps(message.plain))
