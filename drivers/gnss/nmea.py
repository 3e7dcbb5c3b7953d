"""NMEA 0183 receiver, which is not configured: reports position and time of day, but no time marks."""

import re

from board.machine import Machine
from board.runtime.errors import InterfaceError, ProtocolError, RequestError
from drivers.gnss.options import GnssOptions
from drivers.gnss.port import SerialLine
from drivers.gnss.receiver import SILENT_S, ReceiverHost
from drivers.reason import Reason
from drivers.wire.garbage import Garbage
from drivers.wire.gnss.nmea import Sentence, decode
from drivers.wire.gnss.nmea_epochs import NmeaEpochs
from drivers.wire.gnss.stream import GnssStream

GIVE_UP_S = 15.0  # a receiver that is silent for this time is absent, or has another baud rate
# Start of a sentence: talker and formatter, then fields. Garbage that has it was received at the correct baud rate.
_SENTENCE_LIKE = re.compile(rb"\$[A-Z]{5},[ -~]*")


class NmeaReceiver:
    """Receiver that only listens to NMEA sentences."""

    def __init__(self, options: GnssOptions, machine: Machine, above: ReceiverHost) -> None:
        loop = above.host.loop
        self._options = options
        self._above = above
        self._loop = loop
        self._port = SerialLine(loop, options, machine, self._received, above.failed)
        self._stream = GnssStream()
        self._epochs = NmeaEpochs()
        self._talker = ""
        self._is_known = False
        self._garbage = self._unread = 0
        self._refusal = ""  # reason why the last sentence was refused; empty if it was valid, or before the first
        self._heard_at = float("-inf")  # time of the last valid sentence

    def start(self) -> None:
        self._port.open(self._options.rate_baud)
        self._above.host.starting(f"listening at {self._port.path}, {self._options.rate_baud} baud")

    def stop(self) -> None:
        self._port.close()

    def silent(self, seconds: float) -> None:
        if not self._port.is_open:
            return
        self._is_known = False
        self._above.host.link(False, f"{self._port.path}: no epoch for {SILENT_S:.0f} s")
        if seconds >= GIVE_UP_S:
            self._above.failed(self._silence(self._port.path))

    def correct(self, frame: bytes) -> None:
        """Ignore the frame: only a receiver that the station configures accepts corrections."""

    def reset(self, kind: str) -> None:
        """Refuse a reset. Always raises RequestError, because NMEA 0183 has no reset."""
        raise RequestError("a receiver of kind nmea cannot be reset", "power-cycle its slot: `captain slot cycle`")

    def details(self) -> dict[str, object]:
        return {
            "port": self._port.path if self._port.is_open else "",
            "talker": self._talker,
            "unread": self._unread,
            "garbage_octets": self._garbage,
        }

    def _received(self, octets: bytes) -> None:
        now = self._loop.clock()
        for event in [*self._stream.expire(now), *self._stream.receive(octets, now)]:
            if not self._port.is_open:
                return
            match event:
                case Sentence():
                    self._take(event, now)
                case Garbage():
                    self._garbage += event.octets
                    self._above.host.drop(event.reason, event.sample)
                    if found := _SENTENCE_LIKE.search(event.sample):
                        self._refusal = f"{event.reason}: {found[0].decode('ascii')}"

    def _take(self, sentence: Sentence, now: float) -> None:
        try:
            message = decode(sentence)
        except ProtocolError as error:
            self._unread += 1
            self._refusal = str(error)
            self._above.host.drop(Reason.FRAMING, sentence.body.encode("ascii"), detail=self._refusal)
            return
        self._refusal = ""
        if message is None:
            return
        self._talker = sentence.body[:2]
        self._heard_at = now
        fix = self._epochs.take(message, now)
        if fix is None:
            return
        if not self._is_known:
            self._is_known = True
            self._above.configured(f"NMEA receiver, talker {self._talker}, at {self._port.path}")
        self._above.epoch(fix)

    def _silence(self, path: str) -> InterfaceError:
        if self._loop.clock() - self._heard_at < SILENT_S:
            return InterfaceError(f"{path}: its sentences contain no position", "configure it to send GGA, RMC or both")
        if self._refusal:
            remedy = "the baud rate is correct; configure the receiver to send GGA, RMC or both, with checksums"
            return InterfaceError(f"{path}: no sentence is valid: {self._refusal}", remedy)
        what, first = ("only garbage received", "") if self._garbage else ("no data received", "connect its TX, and ")
        remedy = f"{first}set baud to that of the receiver: mostly 4800, 9600, 38400 or 115200"
        return InterfaceError(f"{path}: {what} at {self._options.rate_baud} baud", remedy)
