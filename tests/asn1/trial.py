"""One message under trial: generated values, our octets against those of the others, and what explains a difference.

Every value: our octets equal those of reference.py, and decoding them gives the value back. Some values, as many as time
allows: asn1tools and pycrate give the same octets, and read ours as the same value; tshark reads the same leaves.
"""

import contextlib
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from asn1.model import types as t
from tests.asn1 import tshark
from tests.asn1.disagreements import Constructs, explained
from tests.asn1.effective import effective
from tests.asn1.older import UnsaidError, seen_by_older
from tests.asn1.oracles import Asn1tools, Oracle, Pycrate
from tests.asn1.ranges import read_as
from tests.asn1.reach import pruned
from tests.asn1.reference import Encoder
from tests.asn1.values import Values

ORACLES: dict[str, Callable[[t.Schema, t.Reference], Oracle]] = {"asn1tools": Asn1tools, "pycrate": Pycrate}
EXAMPLES = 3  # of what nothing explains, a message
BATCH = 500  # messages a run of tshark


class Codec(Protocol):
    """What is under trial: captain_messages.Message."""

    def encode(self, value: Any) -> bytes: ...
    def decode(self, octets: bytes) -> Any: ...


@dataclass
class Tally:
    """compared, agreed: by codec; healed: agreed as soon as every constraint was written out, which is explained as well.

    reasons: by codec and construct, a difference may have several.
    newer: values that only we can say; explained, unexplained: differences.
    """

    values: int = 0
    newer: int = 0
    compared: Counter[str] = field(default_factory=Counter)
    agreed: Counter[str] = field(default_factory=Counter)
    healed: Counter[str] = field(default_factory=Counter)
    reasons: Counter[tuple[str, str]] = field(default_factory=Counter)
    explained: int = 0
    unexplained: int = 0
    examples: list[str] = field(default_factory=list)

    def add(self, other: "Tally") -> None:
        self.values += other.values
        self.newer += other.newer
        self.compared += other.compared
        self.agreed += other.agreed
        self.healed += other.healed
        self.reasons += other.reasons
        self.explained += other.explained
        self.unexplained += other.unexplained
        self.examples = [*self.examples, *other.examples][:EXAMPLES]

    def differ(self, codec: str, constructs: list[str], what: str) -> None:
        """Constructs: what explains it; nothing: nothing does."""
        self.explained += bool(constructs)
        self.reasons.update((codec, one) for one in constructs)
        if not constructs:
            self.fail(what)

    def fail(self, what: str) -> None:
        self.unexplained += 1
        self.examples = [*self.examples, what][:EXAMPLES]


class _Verdict(NamedTuple):
    is_equal: bool
    what: str


class Trial:
    """every: of how many values one goes to each of asn1tools, pycrate and tshark; absent: none."""

    def __init__(self, schema: t.Schema, message: t.Message, codec: Codec, every: Mapping[str, int]) -> None:
        self._message, self._codec, self._every = message, codec, every
        self._schema = read_as(pruned(schema, message.pdu), message)
        self._reference = Encoder(self._schema)
        self._constructs = Constructs(self._schema)
        self._oracles = {name: make(self._schema, message.pdu) for name, make in ORACLES.items() if name in every}
        self._healed: dict[str, Oracle] = {}

    def run(self, seed: int, count: int) -> Tally:
        tally = Tally()
        values = Values(self._schema, self._message.pdu, seed)
        waiting: list[Any] = []
        for number in range(count):
            value = values.value()
            tally.values += 1
            octets = self._own(value, values, tally)
            chosen = [name for name, one in self._every.items() if number % one == 0]
            tally.newer += values.has_newer
            if octets is None:
                continue
            for name in chosen:
                if values.has_newer:
                    self._compare_older(name, value, octets, tally)
                elif name in self._oracles:
                    self._compare(self._oracles[name], value, octets, tally, _agrees)
                else:
                    waiting.append(value)
        for start in range(0, len(waiting), BATCH):
            self._dissect(waiting[start : start + BATCH], tally)
        return tally

    def _own(self, value: Any, values: Values, tally: Tally) -> bytes | None:
        """Our octets, where all is well with them."""
        expected = self._reference.encode(self._message.pdu, value)
        try:
            octets = self._codec.encode(value)
            values.complete()
            decoded = self._codec.decode(octets)
        except ValueError as error:
            tally.fail(f"{self._message.name}: {error!r}\n  value    {value}\n  expected {expected.hex()}")
            return None
        if octets != expected:
            tally.fail(
                f"{self._message.name}:\n  value    {value}\n  expected {expected.hex()}\n  ours     {octets.hex()}"
            )
            return None
        if decoded != value:
            tally.fail(f"{self._message.name}: {octets.hex()}\n  is       {value}\n  decoded  {decoded}")
            return None
        return octets

    def _compare_older(self, name: str, value: Any, octets: bytes, tally: Tally) -> None:
        """What a newer sender wrote is read by asn1tools, which skips what it does not know."""
        with contextlib.suppress(UnsaidError):
            if name == "asn1tools":
                older = seen_by_older(self._schema, self._message.pdu, value)
                self._compare(self._oracles[name], older, octets, tally, reads)

    def _compare(self, oracle: Oracle, value: Any, octets: bytes, tally: Tally, agrees: "Agrees") -> None:
        tally.compared[oracle.name] += 1
        verdict = agrees(oracle, value, octets)
        if verdict.is_equal:
            tally.agreed[oracle.name] += 1
            return
        constructs = self._constructs.of(self._message.pdu, value)
        reasons = explained(oracle.name, constructs, is_healed=True)
        if reasons and agrees(self._heal(oracle.name), value, octets).is_equal:
            tally.healed[oracle.name] += 1
        else:
            reasons = explained(oracle.name, constructs, is_healed=False)
        what = f"{self._message.name}: {oracle.name} {verdict.what}\n  value    {value}\n  ours     {octets.hex()}"
        tally.differ(oracle.name, reasons, what)

    def _heal(self, name: str) -> Oracle:
        """The same codec over the effective form of every constraint."""
        if name not in self._healed:
            self._healed[name] = ORACLES[name](effective(self._schema), self._message.pdu)
        return self._healed[name]

    def _dissect(self, values: list[Any], tally: Tally) -> None:
        messages = [(value, self._codec.encode(value)) for value in map(self._announced, values)]
        messages = [one for one in messages if len(one[1]) <= tshark.LONGEST]
        with tempfile.TemporaryDirectory() as folder:
            read = tshark.leaves_read(
                Path(folder) / "captured", [octets for _, octets in messages], self._message.btp_port
            )
        for (value, octets), leaves in zip(messages, read, strict=True):
            tally.compared["tshark"] += 1
            written = tshark.leaves_written(self._schema, self._message.pdu, value)
            if tshark.is_same(leaves, written):
                tally.agreed["tshark"] += 1
                continue
            reasons = explained(tshark.NAME, self._constructs.of(self._message.pdu, value), is_healed=False)
            what = f"{self._message.name}: tshark reads {leaves}\n  written  {written}\n  ours     {octets.hex()}"
            tally.differ("tshark", reasons, what)

    def _announced(self, value: Any) -> Any:
        """With the header by which tshark knows the message."""
        number, version = tshark.MESSAGES[self._message.name]
        name = "messageID" if "messageID" in value["header"] else "messageId"
        header = {**value["header"], name: number, "protocolVersion": version}
        return {**value, "header": header}


def _agrees(oracle: Oracle, value: Any, octets: bytes) -> _Verdict:
    """Their octets are ours, and what they read in ours is the value."""
    try:
        theirs = oracle.encode(oracle.shape(value))
    except Exception as error:  # noqa: BLE001 - their faults have many classes
        return _Verdict(False, f"raises {error!r}")
    return reads(oracle, value, octets) if theirs == octets else _Verdict(False, f"encodes {theirs.hex()}")


def reads(oracle: Oracle, value: Any, octets: bytes) -> _Verdict:
    """What they read in the octets is the value."""
    try:
        decoded = oracle.decode(octets)
        is_equal = decoded == oracle.shape(value)
        # What is right is not printed: pycrate's bit strings are integers of more digits than Python prints.
        return _Verdict(is_equal, "" if is_equal else f"decodes {decoded}")
    except Exception as error:  # noqa: BLE001
        return _Verdict(False, f"raises {error!r}")


Agrees = Callable[[Oracle, Any, bytes], _Verdict]


def chunks(count: int, size: int) -> Iterator[tuple[int, int]]:
    """(seed, how many) of each part of a run: the same values, however many processes share it."""
    for seed, start in enumerate(range(0, count, size)):
        yield seed, min(size, count - start)
