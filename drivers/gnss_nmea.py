"""NMEA 0183 receiver without configuration: gives position and time of day, announces no pulses."""

import re

from board.errors import InterfaceError, ProtocolError, RequestError
from board.machine import Machine
from drivers.gnss_options import GnssOptions
from drivers.gnss_port import SerialLine
from drivers.gnss_receiver import SILENT_S, Above
from drivers.reason import Reason
from drivers.wire.garbage import Garbage
from drivers.wire.gnss_stream import GnssStream
from drivers.wire.nmea import Sentence, decode
from drivers.wire.nmea_epochs import NmeaEpochs

GIVE_UP_S = 15.0  # a receiver silent for so long is absent, or has another baud rate
# Octets of another rate do not look like this: talker and formatter, then fields.
_SENTENCE_LIKE = re.compile(rb"\$[A-Z]{5},[ -~]*")


class NmeaReceiver:
    """Listens."""

    def __init__(self, options: GnssOptions, machine: Machine, above: Above) -> None:
        self._options = options
        self._machine = machine
        self._above = above
        self._port: SerialLine | None = None

    def start(self) -> None:
        host = self._above.host
        self._loop = host.loop
        self._stream = GnssStream()
        self._epochs = NmeaEpochs()
        self._talker = ""
        self._is_known = False
        self._garbage = self._unread = 0
        self._refusal = ""  # why the last sentence was refused; empty: none came
        self._heard_at = float("-inf")  # when the last sentence came
        port = SerialLine(host.loop, self._options, self._machine, self._received, self._above.failed)
        port.open(self._options.rate_baud)
        self._port = port
        host.link(False, f"listening at {port.path}, {self._options.rate_baud} baud")

    def stop(self) -> None:
        if self._port is not None:
            self._port.close()
            self._port = None

    def silent(self, seconds: float) -> None:
        if self._port is None:
            return
        self._is_known = False
        self._above.host.link(False, f"{self._port.path}: no epoch for {SILENT_S:.0f} s")
        if seconds >= GIVE_UP_S:
            self._above.failed(self._silence(self._port.path))

    def correct(self, frame: bytes) -> None:
        """A receiver that is not configured takes none."""

    def reset(self, kind: str) -> None:
        raise RequestError("a receiver of kind nmea cannot be reset", "power-cycle its slot: `captain slot cycle`")

    def details(self) -> dict[str, object]:
        return {
            "port": self._port.path if self._port else "",
            "talker": self._talker,
            "unread": self._unread,
            "garbage_octets": self._garbage,
        }

    def _received(self, octets: bytes) -> None:
        now = self._loop.clock()
        for event in [*self._stream.expire(now), *self._stream.receive(octets, now)]:
            if self._port is None:
                return
            match event:
                case Sentence():
                    self._take(event, self._port, now)
                case Garbage():
                    self._garbage += event.octets
                    self._above.host.drop(event.reason, event.sample)
                    if found := _SENTENCE_LIKE.search(event.sample):
                        self._refusal = f"{event.reason}: {found[0].decode('ascii')}"

    def _take(self, sentence: Sentence, port: SerialLine, now: float) -> None:
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
            self._above.configured(f"NMEA receiver, talker {self._talker}, at {port.path}")
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
