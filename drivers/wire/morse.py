"""PDUs in Morse code: hexadecimal digits between prosigns, with a checksum, timed by ITU-R M.1677-1.

    KA (start)   the PDU, two digits per octet   four digits of CRC-16/XMODEM over the PDU   AR (end)

A dot lasts one unit, a dash three. One unit of silence separates the signs of a letter, three units separate letters.
A message is a list of durations: sound and silence alternate, and sound is first and last.
"""

import binascii
import math
import struct
from collections.abc import Iterator, Sequence

from drivers.reason import Reason

START, END = "-.-.-", ".-.-."
START_UNITS = 15  # length of KA: three dashes, two dots, four silences
DIGITS = {
    "0": "-----", "1": ".----", "2": "..---", "3": "...--", "4": "....-", "5": ".....", "6": "-....", "7": "--...",
    "8": "---..", "9": "----.", "A": ".-", "B": "-...", "C": "-.-.", "D": "-..", "E": ".", "F": "..-.",
}  # fmt: skip
LETTERS = {code: digit for digit, code in DIGITS.items()}
UNITS = {".": 1, "-": 3}

MAX_PDU = 128  # octets: longer than most CAMs; takes a minute of sound at 20 ms per dot
MOST_DURATIONS = 2_700  # longest message: 2 * (128 + 2) digits with at most five signs, and a silence after each

# Sound is 8-bit unsigned mono. A period of the tone has 8 samples. Tones start and end at a zero crossing, to avoid
# clicks.
RATE = 8000  # samples per second
PERIOD = bytes(round(128 + 100 * math.sin(math.pi * step / 4)) for step in range(8))
SILENCE = b"\x80"
LOUD = bytes(abs(sample - 128) > 32 for sample in range(256))  # translates samples: 1 for loud, 0 for silent
SLICE = 64  # durations per slice of a WAV file: 80 KiB at the slowest unit
PCM = 1  # WAV format of uncompressed samples
MAX_HEADER = 1024  # octets; the samples must begin within them
HUSH = 32  # silent samples (4 ms) that end a sound: longer than a zero crossing of the tone, shorter than any unit
HUSHED = bytes(HUSH)


def encode(pdu: bytes) -> list[int]:
    """Return the durations of a PDU, in units."""
    digits = (pdu + binascii.crc_hqx(pdu, 0).to_bytes(2)).hex().upper()
    durations: list[int] = []
    for letter in [START, *(DIGITS[digit] for digit in digits), END]:
        for sign in letter:
            durations += [UNITS[sign], 1]
        durations[-1] = 3
    return durations[:-1]


def decode(durations: Sequence[float]) -> bytes | Reason:
    """Return the PDU of a list of durations; FRAMING or CHECKSUM if they contain no valid one.

    durations  in any unit; each may be up to a fifth too long or too short.
    """
    limit = 1.8 * sum(durations[:9]) / START_UNITS  # threshold between durations of one unit and three units
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
    """Yield slices of a WAV file that plays the durations, with silence before and after.

    unit  length of a dot in periods of the tone, of 1 ms each.
    """
    silence = SILENCE * (7 * unit * len(PERIOD))
    octets = 2 * len(silence) + sum(durations) * unit * len(PERIOD)
    form = struct.pack("<4sIHHIIHH", b"fmt ", 16, PCM, 1, RATE, RATE, 1, 8)
    yield struct.pack("<4sI4s", b"RIFF", 36 + octets, b"WAVE") + form + struct.pack("<4sI", b"data", octets) + silence
    for start in range(0, len(durations), SLICE):
        yield sound(durations[start : start + SLICE], unit)
    yield silence


def sound(durations: Sequence[int], unit: int) -> bytes:
    """Return samples of the durations, of which the first is a sound.

    unit  length of a dot in periods of the tone.
    """
    silence = SILENCE * len(PERIOD)
    return b"".join((silence if place % 2 else PERIOD) * (unit * units) for place, units in enumerate(durations))


class ToneDecoder:
    """Measures the durations of sounds and silences in a WAV file that arrives in slices.

    A file of another format has no durations.
    durations  in samples; at most MOST_DURATIONS, also if the file contains only noise.
    """

    def __init__(self) -> None:
        self.durations: list[int] = []
        self._is_wav: bool | None = None  # None before the first slice
        self._is_sounding = False
        self._lasts = 0  # samples so far of the current sound or silence
        self._rest = b""  # last samples of a sound, which may belong to the silence that ends it

    def receive(self, octets: bytes) -> None:
        """Process a slice of the file; the first slice must contain the whole header."""
        if self._is_wav is None:
            start = samples_start(octets)
            self._is_wav = start > 0
            octets = octets[start:]
        if self._is_wav:
            self._listen(self._rest + octets.translate(LOUD))

    def end(self) -> list[int]:
        """Return the durations after the end of the file."""
        self.receive(SILENCE * HUSH)
        return self.durations

    def _listen(self, loud: bytes) -> None:
        at = 0
        while len(self.durations) < MOST_DURATIONS:
            turn = loud.find(HUSHED, at) if self._is_sounding else loud.find(1, at)
            if turn < 0:
                break
            if self._is_sounding or self.durations:  # skip the silence before the first sound
                self.durations.append(self._lasts + turn - at)
            self._is_sounding, self._lasts, at = not self._is_sounding, 0, turn
        keep = min(HUSH - 1, len(loud) - at) if self._is_sounding else 0
        self._lasts += len(loud) - at - keep
        self._rest = loud[len(loud) - keep :]


def samples_start(octets: bytes) -> int:
    """Return the index of the first sample in a mono WAV file of 8 bits; 0 for other files."""
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
