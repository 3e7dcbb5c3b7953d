"""Ledger of a workload's writes: started, acknowledged, allowed after a cut."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

LINE = re.compile(r"@(\w+) (\{[^\r\n]*\})\r?\n")
IDENTITY = ("machine-id", "ssh")


@dataclass
class Ledger:
    """The numbers of each thing that is written: the last one that was begun, and the last one acknowledged.

    identity  of the box, as it was first seen.
    made_ns   when the newest message of the recording was made that we know of, by the guest's clock; first_ns: and the
              oldest; heard_s: when we heard of the newest, by ours.
    """

    begun: dict[str, int] = field(default_factory=dict)
    done: dict[str, int] = field(default_factory=dict)
    identity: dict[str, str] = field(default_factory=dict)
    first_ns: int = 0
    made_ns: int = 0
    heard_s: float = 0.0

    def hear(self, text: str, now_s: float) -> str:
        """Take lines of the console; returns what has not ended yet."""
        at = 0
        for found in LINE.finditer(text):
            self._take(found[1], json.loads(found[2]), now_s)
            at = found.end()
        return text[at:]

    @property
    def in_progress(self) -> list[str]:
        """What was begun and not acknowledged."""
        return sorted(name for name, number in self.begun.items() if self.done.get(name) != number)

    def troubles(self, kept: Mapping[str, object]) -> list[str]:
        """What of a card is not as it has to be, in words; kept: its numbers, -1 for none."""
        found = [f"{name} has changed" for name in IDENTITY if not self._is_same(name, str(kept.get(name, "")))]
        unknown = kept.keys() - self.begun.keys() - set(IDENTITY)
        found += [f"{name}: {kept[name]}" for name in sorted(unknown) if isinstance(kept[name], str)]
        for name, number in self.begun.items():
            has, least = kept.get(name), self.done.get(name, 0)
            if not isinstance(has, int):
                found.append(f"{name}: {has}")
            elif not least <= max(has, 0) <= number:
                found.append(f"{name}: {has} is on the card, {least} was acknowledged, {number} begun")
        return found

    def forget(self, name: str) -> None:
        """Somebody else has written it meanwhile: any number is right, and damage is damage."""
        self.begun.pop(name, None)
        self.done.pop(name, None)

    def settle(self, kept: Mapping[str, object]) -> None:
        """After a look at the card: what it has is what there is."""
        self.begun = {name: max(0, number) for name, number in kept.items() if isinstance(number, int)}
        self.done = dict(self.begun)
        self.first_ns = self.made_ns = 0

    def lost_s(self, last_ns: int, cut_s: float) -> float:
        """How much is missing at a recording's end; last_ns: when the last message was made that is there, 0: none."""
        if not self.made_ns:
            return 0.0
        return max(0.0, (self.made_ns - (last_ns or self.first_ns)) / 1e9 + cut_s - self.heard_s)

    def _take(self, word: str, told: dict[str, int], now_s: float) -> None:
        if word == "begin":
            self.begun[str(told["what"])] = told["number"]
        elif word == "done":
            self.done[str(told["what"])] = told["number"]
        elif word == "record":
            self.made_ns, self.heard_s = told["made_ns"], now_s
            self.first_ns = self.first_ns or self.made_ns

    def _is_same(self, name: str, value: str) -> bool:
        """A box that has none yet gets one."""
        if not value and name not in self.identity:
            return True
        return self.identity.setdefault(name, value) == value
