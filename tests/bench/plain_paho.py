"""Peer of the V2N benchmark: plain paho-mqtt between a broker and ZeroMQ.

usage: python -m tests.bench.plain_paho FROM_USERS TO_USERS PORT QOS AUTHORITY CERTIFICATE KEY

user -> broker: two frames; the PDU leaves as the text of the contract, section 4. broker -> user: that text becomes two
frames. No table of types, no check of a length, no counter, no queue of its own, no lifetimes, no status.
"""

import base64
import signal
import sys
import threading

import paho.mqtt.client as mqtt
import zmq
from paho.mqtt.enums import CallbackAPIVersion
from paho.mqtt.subscribeoptions import SubscribeOptions

HOST = "plain"


def main() -> int:
    from_users, to_users, port, qos = map(int, sys.argv[1:5])
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    pub = context.socket(zmq.PUB)
    client = mqtt.Client(CallbackAPIVersion.VERSION2, client_id=HOST, protocol=mqtt.MQTTv5)
    authority, certificate, key = sys.argv[5:8]
    client.tls_set(authority, certificate, key)

    def deliver(_client: object, _userdata: object, message: mqtt.MQTTMessage) -> None:
        start = message.payload.index(b"<") + 1
        pub.send(b"v2x.cam.", zmq.SNDMORE)
        pub.send(base64.b64decode(message.payload[start : message.payload.index(b">", start)], validate=True))

    def subscribe(*_: object) -> None:
        client.subscribe("v2x/btp/+", options=SubscribeOptions(qos=qos, noLocal=True))

    # Nothing is bound before the broker has the subscription: who can connect here is at the whole way.
    subscribed = threading.Event()
    client.on_message, client.on_connect = deliver, subscribe
    client.on_subscribe = lambda *_: subscribed.set()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    client.connect("localhost", port)
    client.loop_start()
    subscribed.wait()
    sub = context.socket(zmq.SUB)
    sub.subscribe(b"")
    pub.bind(f"tcp://127.0.0.1:{to_users}")
    sub.bind(f"tcp://127.0.0.1:{from_users}")
    while True:
        pdu = sub.recv_multipart()[1]
        client.publish("v2x/btp/2001", b"%s(2001): <%s>" % (HOST.encode(), base64.b64encode(pdu)), qos)


if __name__ == "__main__":
    sys.exit(main())
