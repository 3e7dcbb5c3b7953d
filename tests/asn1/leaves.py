"""Values without components: numbers, items, strings. See values.py."""

import math
import random
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from asn1.model import types as t
from tests.asn1.bits import K64, KNOWN_MULTIPLIER
from tests.asn1.ranges import Allowed, Ends, alphabet, sizes

Holder = dict[str, Any]  # the SEQUENCE that a value is made for: an open type asks it for its identifier
Make = Callable[[Holder], Any]

NEVER = 1 << 30
INT64 = 1 << 63
PRESENCE = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0)
BUDGETS = (10, 40, 40, 100, 100, 300)  # values in one message; its mandatory components come on top
LENGTHS = (0, 1, 2, 3, 7, 8, 9, 20)  # of what no constraint bounds
LONG_LENGTHS = (126, 127, 128, 129, 255, 256)  # around the one-octet length, X.691 11.9.3.6
FRAGMENTED = (16383, 16384, 16385, 32768, 49152, 65535, 65536, 81920)  # around the fragments, X.691 11.9.3.8
PLAIN = 0.9  # of the strings have only characters that everybody prints
UNKNOWN = 0.1  # of the values hold additions that the schema has not
LONG = 0.002  # of the values hold one of the lengths in FRAGMENTED


class Mood:
    """What holds for the whole of the value that is being made, and where chance comes from.

    left      values that may still be made; mandatory ones are made even so
    presence  how likely something optional is there
    is_newer  the sender knows more than the schema; has_newer: and something of that is in the value
    """

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.chance = self.random.random
        self.left = 0
        self.presence = 0.5
        self.is_newer = self.has_newer = self.may_be_long = False

    def change(self, knows_more: bool, is_long: bool) -> None:
        chance = self.chance
        self.presence = PRESENCE[int(chance() * len(PRESENCE))]
        self.left = BUDGETS[int(chance() * len(BUDGETS))]
        self.is_newer = knows_more and chance() < UNKNOWN
        self.has_newer = False
        self.may_be_long = is_long and chance() < LONG

    def one_of(self, things: Sequence[Any]) -> Callable[[], Any]:
        """By chance and in turn, so that none is left out for long."""
        count, chance, turn = len(things), self.chance, 0
        if count == 1:
            return lambda: things[0]

        def pick() -> Any:
            nonlocal turn
            drawn = chance()
            if drawn < 0.5:
                return things[int(drawn * 2 * count)]
            turn = (turn + 1) % count
            return things[turn]

        return pick

    def above(self) -> int:
        """How far beyond the last known addition: mostly next, seldom past the 64 of a normally small number."""
        return self.random.choice((0, 0, 1, 2, 5, 63, 64, 65))

    def octets(self) -> bytes:
        """Of an open type that nobody knows."""
        return self.random.randbytes(self.random.choice((1, 1, 2, 5, 130)))


def integer(mood: Mood, allowed: Allowed, names: Iterable[t.Named]) -> Make:
    spans = [_finite(one) for one in allowed.root]
    inside = [edge for low, high in spans for edge in (low, low + 1, high - 1, high) if low <= edge <= high]
    inside += [one.value for one in names if any(low <= one.value <= high for low, high in spans)]
    inside += [0] if any(low <= 0 <= high for low, high in spans) else []
    edge = mood.one_of(sorted(set(inside)))
    beyond = mood.one_of(_beyond(allowed)) if allowed.is_extensible else edge
    chance, span = mood.chance, mood.one_of(spans)

    def make(_: Holder) -> int:
        mood.left -= 1
        drawn = chance()
        if drawn < 0.5:
            low, high = span()
            return int(min(high, low + int(chance() * (high - low + 1))))
        return int(edge() if drawn < 0.95 else beyond())

    return make


def enumerated(mood: Mood, type_: t.Enumerated) -> Make:
    pick = mood.one_of([one.name for one in (*type_.root, *type_.additions)])

    def make(_: Holder) -> str | int:
        mood.left -= 1
        if type_.is_extensible and mood.is_newer and mood.chance() < 0.2:
            mood.has_newer = True
            return len(type_.additions) + mood.above()
        return str(pick())

    return make


def bit_string(mood: Mood, allowed: Allowed, has_names: bool) -> Make:
    count = counts(mood, allowed, 0)
    least = allowed.low or 0

    def make(_: Holder) -> tuple[bytes, int]:
        size = count()
        number = mood.random.choice((0, -1, mood.random.getrandbits(size + 1))) & ((1 << size) - 1)
        if has_names:
            while size > least and not number & 1:  # X.691 16.2, 16.3: trailing zeros are sent only
                number, size = number >> 1, size - 1  # as far as they make up the least size
            number, size = number << max(0, least - size), max(least, size)
        return (number << (-size % 8)).to_bytes((size + 7) // 8, "big"), size

    return make


def octet_string(mood: Mood, allowed: Allowed) -> Make:
    count = counts(mood, allowed, 0)
    return lambda _: mood.random.randbytes(count())


def characters(mood: Mood, kind: str, constraints: Sequence[t.Constraint]) -> Make:
    count = counts(mood, sizes(constraints), 0)
    ranges = alphabet(constraints) or KNOWN_MULTIPLIER.get(kind)
    codes = [code for low, high in ranges for code in range(int(low), int(high) + 1)] if ranges else []
    pool = "".join(map(chr, codes)) or 'aZ09 "\\\x00\x7f\x80äß€\u07ff\u0800\ufffd\U00010000\U0010ffff'
    plain = "".join(filter(str.isprintable, filter(str.isascii, pool)))

    def make(_: Holder) -> str:
        return "".join(mood.random.choices(plain if mood.chance() < PLAIN else pool, k=count()))

    return make


def object_identifier(mood: Mood, is_relative: bool) -> Make:
    def make(_: Holder) -> str:
        mood.left -= 1
        arcs = [
            mood.random.choice((0, 1, 39, 127, 128, 16383, 16384, 1 << 31)) for _ in range(mood.random.randint(1, 5))
        ]
        first = [] if is_relative else [mood.random.choice((0, 1, 2)), mood.random.choice((0, 1, 39))]
        return ".".join(map(str, [*first, *arcs]))

    return make


def counts(mood: Mood, allowed: Allowed, cost: int) -> Callable[[], int]:
    """How many characters, or elements of `cost` values each."""
    low, high = allowed.low or 0, allowed.high
    top = NEVER if high is None else high
    usual = {low, min(low + 1, top), *(one for one in LENGTHS if low <= one <= top)}
    usual |= {top - 1, top} - {low - 1} if top < 1000 else set()
    outside = [one for one in (top + 1, top + 2, low - 1, 127, 128) if one >= 0 and not allowed.holds(one)]
    long = [one for one in (*LONG_LENGTHS, top) if low <= one <= top and one not in usual and one < K64]
    huge = [one for one in FRAGMENTED if low <= one <= top] if cost <= 1 else []
    if allowed.additions:
        outside = [one for one in outside if any(a <= one <= b for a, b in allowed.additions)]
    pick, chance = mood.one_of(sorted(usual)), mood.chance
    rare = [*(outside if allowed.is_extensible and high is not None else []), *long]

    def count() -> int:
        number = int(pick())
        drawn = chance()
        if rare and drawn < 0.06:
            number = rare[int(drawn / 0.06 * len(rare))]
        elif huge and mood.may_be_long and drawn > 0.7:
            mood.may_be_long = False  # one in a message
            return mood.random.choice(huge)
        if cost and number * cost > mood.left:
            number = max(min(low, number), mood.left // cost)
        mood.left -= 1
        return number

    return count


def _finite(span: Ends) -> tuple[int, int]:
    """What 64 bits hold."""
    low, high = span
    return -INT64 if math.isinf(low) else int(low), INT64 - 1 if math.isinf(high) else int(high)


def _beyond(allowed: Allowed) -> list[int]:
    """Numbers that only the extension holds."""
    if allowed.additions:
        return [edge for span in map(_finite, allowed.additions) for edge in span]
    low, high = _finite((allowed.root[0][0], allowed.root[-1][1]))
    near = (low - 1, low - 129, high + 1, high + 128, high + 40000, 1 << 40, -(1 << 40))
    return [one for one in near if not allowed.holds(one) and -INT64 <= one < INT64]
