"""Keys typed on a serial line, separated from line noise."""

import re

# Octets closer together than this form one burst: a key as a terminal sends it, or noise.
QUIET_S = 0.1
LONGEST = 12  # most octets of a burst that may be a key: a function key, or a key held down

UNKNOWN = "?"  # any control or function key without a meaning here
INTERRUPT = "\x03"  # Ctrl-C
AGAIN, NEXT, BACK = "r", "n", "p"

# Sequences of ECMA-48 terminals: CSI or SS3, parameters, and one final octet.
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
    """Converts received octets to keys, after each quiet moment.

    A key in noise might open a shell, and the rest of the noise would be typed into it. So a burst is noise as a whole
    unless a single key makes it. Noise is only counted, so a flood costs nothing else.

    noise  number of octets of noise so far.
    """

    def __init__(self) -> None:
        self.noise = 0
        self._burst = b""
        self._length = 0
        self._last = 0.0

    def receive(self, octets: bytes, now: float) -> list[str]:
        """Add octets; return the keys of the previous burst if these begin another one."""
        keys = self.expire(now)
        self._burst = (self._burst + octets[: LONGEST + 1])[: LONGEST + 1]
        self._length += len(octets)
        self._last = now
        return keys

    def expire(self, now: float) -> list[str]:
        """Return the keys of a burst that has ended; letters are lower-case."""
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
    """Return the keys of a burst: one key, perhaps repeated, perhaps with Enter; empty if it is noise."""
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
