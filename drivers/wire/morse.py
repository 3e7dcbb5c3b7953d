"""PDUs in Morse code: hexadecimal digits between prosigns, with a checksum, timed as ITU-R M.1677-1 says.

    KA (start)   the PDU, two digits an octet   four digits of CRC-16/XMODEM over it   AR (end)

A dot lasts one unit, a dash three; one unit of silence stands inside a letter, three between letters. A message is
the list of its durations: sound and silence in turn, sound first and last.
"""

import binascii
import math
import struct
from collections.abc import Iterator, Sequence

from drivers.reason import Reason

START, END = "-.-.-", ".-.-."
START_UNITS = 15  # of KA: three dashes, two dots, four silences
DIGITS = {
    "0": "-----", "1": ".----", "2": "..---", "3": "...--", "4": "....-", "5": ".....", "6": "-....", "7": "--...",
    "8": "---..", "9": "----.", "A": ".-", "B": "-...", "C": "-.-.", "D": "-..", "E": ".", "F": "..-.",
}  # fmt: skip
LETTERS = {code: digit for digit, code in DIGITS.items()}
UNITS = {".": 1, "-": 3}

MAX_PDU = 128  # octets: longer than most CAMs, and a minute of sound at 20 ms a dot
MOST_DURATIONS = 2_700  # of a message: 2 * (128 + 2) digits of at most five signs and as many silences

# Sound is 8-bit unsigned mono. The tone's period is 8 samples: it starts and ends at a crossing, without a click.
RATE = 8000  # samples per second
PERIOD = bytes(round(128 + 100 * math.sin(math.pi * step / 4)) for step in range(8))
SILENCE = b"\x80"
LOUD = bytes(abs(sample - 128) > 32 for sample in range(256))  # of a sample: 1 loud, 0 not
SLICE = 64  # durations that are made sound at once: 80 KiB at the slowest unit
PCM = 1  # the format of samples that are not compressed
MAX_HEADER = 1024  # octets, within which the samples begin
HUSH = 32  # samples, 4 ms, that are not loud: longer than the tone is near zero, shorter than any unit
HUSHED = bytes(HUSH)


def encode(pdu: bytes) -> list[int]:
    """Durations in units of a PDU."""
    digits = (pdu + binascii.crc_hqx(pdu, 0).to_bytes(2)).hex().upper()
    durations: list[int] = []
    for letter in [START, *(DIGITS[digit] for digit in digits), END]:
        for sign in letter:
            durations += [UNITS[sign], 1]
        durations[-1] = 3
    return durations[:-1]


def decode(durations: Sequence[float]) -> bytes | Reason:
    """The PDU of durations in any unit, each up to a fifth too long or too short; or FRAMING, or CHECKSUM."""
    limit = 1.8 * sum(durations[:9]) / START_UNITS  # between one unit and three
    signs = ["-" if sound > limit else "." for sound in durations[::2]]
    gaps = [" " if silence > limit else "" for silence in durations[1::2]]
    letters = "".join(map("".join, zip(signs, [*gaps, ""], strict=False))).split()
    digits = "".join(LETTERS.get(letter, "?") for letter in letters[1:-1])
    if [letters[:1], letters[-1:]] != [[START], [END]] or "?" in digits or len(digits) < 4 or len(digits) % 2:
        return Reason.FRAMING
    octets = bytes.fromhex(digits)
    pdu, checksum = octets[:-2], octets[-2:]
    return pdu if binascii.crc_hqx(pdu, 0).to_bytes(2) == checksum else Reason.CHECKSUM


def wav(durations: Sequence[int], unit: int) -> Iterator[bytes]:
    """A WAV file of durations with silence around them, in slices; unit is in periods of the tone, 1 ms each."""
    silence = SILENCE * (7 * unit * len(PERIOD))
    octets = 2 * len(silence) + sum(durations) * unit * len(PERIOD)
    form = struct.pack("<4sIHHIIHH", b"fmt ", 16, PCM, 1, RATE, RATE, 1, 8)
    yield struct.pack("<4sI4s", b"RIFF", 36 + octets, b"WAVE") + form + struct.pack("<4sI", b"data", octets) + silence
    for start in range(0, len(durations), SLICE):
        yield sound(durations[start : start + SLICE], unit)
    yield silence


def sound(durations: Sequence[int], unit: int) -> bytes:
    """Samples of durations, sound first; unit is in periods of the tone."""
    silence = SILENCE * len(PERIOD)
    return b"".join((silence if place % 2 else PERIOD) * (unit * units) for place, units in enumerate(durations))


class Ear:
    """What is loud and what is silent between it in a WAV file that comes in slices; in others there is no sound.

    durations  in samples; of noise only as many as of a message.
    """

    def __init__(self) -> None:
        self.durations: list[int] = []
        self._is_wav: bool | None = None  # not known before the first slice
        self._is_sounding = False
        self._lasts = 0  # samples of the sound or silence that goes on
        self._rest = b""  # of a sound: what may be the beginning of its end

    def receive(self, octets: bytes) -> None:
        """Listen to a slice; the first one has the file's whole header."""
        if self._is_wav is None:
            start = samples_start(octets)
            self._is_wav = start > 0
            octets = octets[start:]
        if self._is_wav:
            self._listen(self._rest + octets.translate(LOUD))

    def end(self) -> list[int]:
        """The durations; the file has ended."""
        self.receive(SILENCE * HUSH)
        return self.durations

    def _listen(self, loud: bytes) -> None:
        at = 0
        while len(self.durations) < MOST_DURATIONS:
            turn = loud.find(HUSHED, at) if self._is_sounding else loud.find(1, at)
            if turn < 0:
                break
            if self._is_sounding or self.durations:  # the silence before the first sound is none of the message
                self.durations.append(self._lasts + turn - at)
            self._is_sounding, self._lasts, at = not self._is_sounding, 0, turn
        keep = min(HUSH - 1, len(loud) - at) if self._is_sounding else 0
        self._lasts += len(loud) - at - keep
        self._rest = loud[len(loud) - keep :]


def samples_start(octets: bytes) -> int:
    """Where the samples begin in a WAV file of 8 bits, mono; 0 where it is none."""
    at, is_ours = 12, False
    if octets[:4] != b"RIFF" or octets[8:12] != b"WAVE":
        return 0
    while at + 8 <= min(len(octets), MAX_HEADER):
        name, size = struct.unpack_from("<4sI", octets, at)
        at += 8
        if name == b"data":
            return at if is_ours else 0
        if name == b"fmt ":
            form, channels, bits = octets[at : at + 2], octets[at + 2 : at + 4], octets[at + 14 : at + 16]
            is_ours = (form, channels, bits) == (b"\x01\0", b"\x01\0", b"\x08\0")
        at += size + size % 2
    return 0
