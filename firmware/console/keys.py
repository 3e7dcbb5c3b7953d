"""What a person types on a serial line: keys, told from the noise of the line."""

import re

# Octets that come closer than this are one burst: one key, as a terminal sends it, or noise.
QUIET_S = 0.1
LONGEST = 12  # octets of a burst that may be a key: one that is held down, or a function key

UNKNOWN = "?"  # a key without a letter that means nothing here
INTERRUPT = "\x03"  # Ctrl-C
AGAIN, NEXT, BACK = "r", "n", "p"

# As ECMA-48 terminals send them; CSI or SS3 and one final octet.
KEY = re.compile(rb"\x1b[\[O][0-9;]{0,4}[@-~]|\r\n?|[\x01-\x7f]")
MEANINGS = {
    b"\r": AGAIN,
    b"\n": AGAIN,
    b"\r\n": AGAIN,
    b"\x0c": AGAIN,  # Ctrl-L
    b" ": NEXT,
    b"\x1b[6~": NEXT,
    b"\x1b[B": NEXT,
    b"\x1b[C": NEXT,
    b"\x1b[5~": BACK,
    b"\x1b[A": BACK,
    b"\x1b[D": BACK,
    b"\x03": INTERRUPT,
}


class Keys:
    """Octets in, keys out, once the line was quiet for a moment.

    A key of noise might open a shell, and the rest of the noise would be typed into it: so whatever comes in a burst
    that no single key makes is noise as a whole. It is counted, and a flood costs nothing but its counter.

    noise  octets so far.
    """

    def __init__(self) -> None:
        self.noise = 0
        self._burst = b""
        self._length = 0
        self._last = 0.0

    def receive(self, octets: bytes, now: float) -> list[str]:
        """Keys of the burst before, if this is the first of another."""
        keys = self.expire(now)
        self._burst = (self._burst + octets[: LONGEST + 1])[: LONGEST + 1]
        self._length += len(octets)
        self._last = now
        return keys

    def expire(self, now: float) -> list[str]:
        """Keys of the burst that has ended; letters are small."""
        due = self.deadline()
        if due is None or now < due:
            return []
        keys = _keys(self._burst)
        if not keys:
            self.noise += self._length
        self._burst, self._length = b"", 0
        return keys

    def deadline(self) -> float | None:
        return self._last + QUIET_S if self._length else None


def _keys(burst: bytes) -> list[str]:
    """What was pressed: one key, perhaps several times, perhaps Enter behind it; nothing where it is noise."""
    found = KEY.findall(burst)
    if len(burst) > LONGEST or b"".join(found) != burst:
        return []
    keys = [_meaning(octets) for octets in found]
    return keys if len(set(keys) - {AGAIN}) <= 1 else []


def _meaning(octets: bytes) -> str:
    if octets in MEANINGS:
        return MEANINGS[octets]
    letter = octets.decode("ascii")
    return letter.lower() if len(letter) == 1 and letter.isprintable() else UNKNOWN
