"""User's program at a station of the demo: sends CAMs and DENMs, counts received messages."""

import time

import zmq

from board.runtime.errors import StationError
from board.time.scales import nearest_its_time_ms
from drivers.message import Position
from drivers.sim import messages
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
# Start of each user's vehicle. Both drive near each other with the speed and heading in messages.cam, and start again
# after 40 s.
START = {"A": Position(487_660_000, 114_310_000), "B": Position(487_650_000, 114_300_000)}
NORTH, EAST = 1355, 1851  # 1e-7 degree per second: 20.3 m/s at 42 degrees
AGAIN_S = 40.0


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
        """Send a CAM, and a DENM with every tenth one."""
        its_ms = nearest_its_time_ms(time.time())
        position = position_of(self.name, its_ms)
        self._publish("cam", messages.cam(self.station_id, its_ms, position))
        if self._cams % CAMS_PER_DENM == 0:
            self._publish("denm", messages.denm(self.station_id, its_ms, position, self._cams // CAMS_PER_DENM))
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


def position_of(name: str, its_ms: int) -> Position:
    """Return the position of the vehicle of a station's user; its_ms: ITS time in ms."""
    start, driven_s = START[name], its_ms / 1000 % AGAIN_S
    return Position(start.latitude + round(NORTH * driven_s), start.longitude + round(EAST * driven_s))
