"""User's program at a station of the demo: sends CAMs and DENMs, counts received messages."""

import time

import zmq

from board.runtime.errors import StationError
from board.time.scales import nearest_its_time_ms
from drivers.sim import messages
from drivers.sim.circle import Circle
from drivers.sim.track import Point
from firmware.client import client
from firmware.client.received import Pairing
from firmware.client.show.tally import Tally
from firmware.codec.decoding import Decoder
from firmware.codec.identify import Unknown

CAMS_PER_DENM = 10
STATION_ID = {"A": 4201, "B": 4202}  # stationIDs in the users' messages
# Source addresses on the air. They distinguish the messages of a station's users from those of its neighbours.
MAC = {"A": "02:00:00:00:00:0a", "B": "02:00:00:00:00:0b"}
SUBJECTS = ("cam", "denm")
# Path of each user's vehicle: a circle of 400 m radius at 72 km/h.
PATH = {
    "A": Circle(Point(48.7660, 11.4310, 420.0), 400.0, 20.0),
    "B": Circle(Point(48.7650, 11.4300, 420.0), 400.0, 20.0),
}


class User:
    """User's program at a station, as in the README: publishes to port 5555, subscribes to port 5556.

    decoder  checks that received messages decode; None: no check.
    """

    def __init__(self, context: client.Context, name: str, place: client.Address, decoder: Decoder | None) -> None:
        self.name = name
        self.station_id = STATION_ID[name]
        self.tally = Tally()
        self.pairing = Pairing()
        self.subscriber = client.subscribe(context, place, place.to_users, "")
        # XPUB sends like PUB, and also tells when the station has subscribed; earlier messages would be lost.
        self._publisher = context.socket(zmq.XPUB)
        self._publisher.connect(place.url(place.from_users))
        self._decoder = decoder
        self._cams = 0

    def join(self) -> None:
        """Wait until the station has subscribed and sent something: from then on no message is lost.

        Raises StationError if the station does not answer.
        """
        patience_ms = round(client.ANSWER_S * 1000)
        if not self._publisher.poll(patience_ms) or not self.subscriber.poll(patience_ms):
            raise StationError(f"station {self.name} does not answer its user")

    def send(self) -> None:
        """Send a CAM; with every tenth CAM, also send a DENM."""
        its_ms = nearest_its_time_ms(time.time())
        path = PATH[self.name]
        self._publish("cam", messages.cam(self.station_id, its_ms, path.at(its_ms / 1000)))
        if self._cams % CAMS_PER_DENM == 0:
            before = path.before(its_ms / 1000, messages.TRACE)
            self._publish("denm", messages.denm(self.station_id, its_ms, before, self._cams // CAMS_PER_DENM))
        self._cams += 1

    def receive(self, now: float) -> None:
        for frames in client.waiting(self.subscriber):
            message = self.pairing.feed(frames)
            if message is not None:
                self.tally.add(message, now, self._is_bad(message.pdu))

    def has_heard(self, other: "User") -> bool:
        """Whether a CAM and a DENM of the other station's user have arrived."""
        return all(self.tally.count(kind, other.station_id) for kind in SUBJECTS)

    def _is_bad(self, pdu: bytes) -> bool:
        return self._decoder is not None and isinstance(self._decoder.find(pdu, is_quick=True), Unknown)

    def _publish(self, kind: str, pdu: bytes) -> None:
        self._publisher.send_multipart([f"v2x.{kind}.".encode(), pdu], zmq.DONTWAIT)
