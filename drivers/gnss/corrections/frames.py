"""RTCM 3 frames of a source of corrections: splits octets into frames and counts them."""

from collections.abc import Callable

from drivers.contract import Host
from drivers.reason import Reason
from drivers.wire.garbage import Garbage
from drivers.wire.gnss.stream import GnssStream
from drivers.wire.rtcm import RtcmFrame

Take = Callable[[bytes], None]

BATCH = 1024  # octets read in one turn


class Frames:
    """Splits octets into RTCM frames, counts them, and passes only complete ones on.

    take     called with each frame.
    count    number of frames.
    garbage  number of octets since the last frame that belong to no frame.
    last     time of the last frame, by the loop's clock; None before the first.
    """

    def __init__(self, host: Host, take: Take) -> None:
        self.count = 0
        self.garbage = 0
        self.last: float | None = None
        self._host = host
        self._take = take
        self._stream = GnssStream()

    def receive(self, octets: bytes) -> None:
        now = self._host.loop.clock()
        for event in [*self._stream.expire(now), *self._stream.receive(octets, now)]:
            if isinstance(event, RtcmFrame):
                self.count += 1
                self.garbage, self.last = 0, now
                self._take(event.octets)
            elif isinstance(event, Garbage):
                self.garbage += event.octets
                self._host.drop(event.reason, event.sample)
            else:
                self._host.drop(Reason.FRAMING)

    def details(self) -> dict[str, object]:
        since = None if self.last is None else round(self._host.loop.clock() - self.last, 1)
        return {"frames": self.count, "last_s": since}
