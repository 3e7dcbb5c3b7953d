"""PDUs in Morse code: hexadecimal digits between prosigns, with a checksum, timed as ITU-R M.1677-1 says.

    KA (start)   the PDU, two digits an octet   four digits of CRC-16/XMODEM over it   AR (end)

A dot lasts one unit, a dash three; one unit of silence stands inside a letter, three between letters. A message is
the list of its durations: sound and silence in turn, sound first and last.
"""

import binascii
import io
import math
import wave
from collections.abc import Sequence

from drivers.reason import Reason

START, END = "-.-.-", ".-.-."
START_UNITS = 15  # of KA: three dashes, two dots, four silences
DIGITS = {
    "0": "-----", "1": ".----", "2": "..---", "3": "...--", "4": "....-", "5": ".....", "6": "-....", "7": "--...",
    "8": "---..", "9": "----.", "A": ".-", "B": "-...", "C": "-.-.", "D": "-..", "E": ".", "F": "..-.",
}  # fmt: skip
LETTERS = {code: digit for digit, code in DIGITS.items()}
UNITS = {".": 1, "-": 3}

MAX_PDU = 512  # octets: longer than most DENMs, and 4 minutes of sound at 20 ms a dot
MOST_DURATIONS = 11_000  # of a message: 2 * (512 + 2) digits of at most five signs and as many silences

# Sound is 8-bit unsigned mono. The tone's period is 8 samples: it starts and ends at a crossing, without a click.
RATE = 8000  # samples per second
PERIOD = bytes(round(128 + 100 * math.sin(math.pi * step / 4)) for step in range(8))
SILENCE = b"\x80"
LOUD = bytes(abs(sample - 128) > 32 for sample in range(256))  # of a sample: 1 loud, 0 not
HUSH = 32  # samples, 4 ms, that are not loud: longer than the tone is near zero, shorter than any unit


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


def write_wav(durations: Sequence[int], unit: int) -> bytes:
    """A WAV file of durations; unit in ms."""
    file = io.BytesIO()
    with wave.open(file, "wb") as writer:
        writer.setparams((1, 1, RATE, 0, "NONE", ""))
        writer.writeframes(sound(durations, unit))
    return file.getvalue()


def read_wav(octets: bytes) -> list[int]:
    """The durations in a WAV file; none where it is none, or not of 8 bits, mono."""
    try:
        with wave.open(io.BytesIO(octets)) as reader:
            is_ours = (reader.getnchannels(), reader.getsampwidth()) == (1, 1)
            return listen(reader.readframes(len(octets))) if is_ours else []
    except (wave.Error, EOFError, RuntimeError):  # the last where a chunk is longer than its file
        return []


def sound(durations: Sequence[int], unit: int) -> bytes:
    """Samples of durations, with silence around them; unit is in periods of the tone, 1 ms each."""
    parts = [SILENCE * len(PERIOD) * unit * 7]
    for place, units in enumerate(durations):
        parts.append((SILENCE * len(PERIOD) if place % 2 else PERIOD) * (unit * units))
    return b"".join([*parts, parts[0]])


def listen(samples: bytes) -> list[int]:
    """Durations in samples of what is loud and what is silent between it; of noise only as many as of a message."""
    loud = samples.translate(LOUD) + bytes(HUSH)
    durations: list[int] = []
    end = 0
    while (start := loud.find(1, end)) >= 0 and len(durations) < MOST_DURATIONS:
        if durations:
            durations.append(start - end)
        end = loud.find(bytes(HUSH), start)
        durations.append(end - start)
    return durations
