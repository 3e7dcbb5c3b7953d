"""Screen of the serial console: a VT100 fed with the guest's output."""

import re
import time

import pyte

from tests.proof.image.machine import LIMIT_S, Guest, NotSeenError

COLUMNS, LINES = 80, 24
# All that the station's screen may send: printable ASCII, ends of lines, and three that each VT100 has.
ALLOWED = re.compile(r"(?:[\x20-\x7e\r\n]|\x1b\[[HKJ])*")
HEAD = r"(?m)^\S+ +captain \S+ +up "
PROMPT = r"(?m)^operator@\S+:\S*\$ *$"


class Screen:
    """A terminal of 80 columns and 24 lines, of what the guest says from now on.

    sent   all that it was fed.
    noise  what the machine adds of its own, which no terminal would be sent.
    """

    def __init__(self, guest: Guest, noise: str = "") -> None:
        self.sent = ""
        self._guest = guest
        self._noise = noise
        self._at = len(guest.text)
        self._shown = pyte.Screen(COLUMNS, LINES)
        self._stream = pyte.Stream(self._shown)

    @property
    def text(self) -> str:
        return "\n".join(line.rstrip() for line in self._shown.display)

    def wait(self, pattern: str, limit_s: float = LIMIT_S) -> re.Match[str]:
        """Until it shows this. Raises NotSeenError."""
        ends = time.monotonic() + limit_s
        while not (found := re.search(pattern, self.text)):
            said = self._guest.more(self._at, ends - time.monotonic())
            if not said:
                raise NotSeenError(f"the screen does not show {pattern!r}:\n{self.text}")
            self._feed(said)
        return found

    def settle(self, quiet_s: float = 0.5) -> str:
        """Its text once it has said nothing for a moment: the whole of a frame has come."""
        while said := self._guest.more(self._at, quiet_s):
            self._feed(said)
        return self.text

    def type(self, text: str) -> None:
        self._guest.type(text)

    def run(self, command: str, pattern: str, limit_s: float = LIMIT_S) -> re.Match[str]:
        """A command at the shell's prompt, from an empty screen, until it has said this and the prompt is back."""
        self._shown.reset()
        self.type(f"{command}\r")
        found = self.wait(pattern, limit_s)
        self.wait(PROMPT, limit_s)
        return re.search(pattern, self.text) or found  # a part of the line may have come first

    def forget(self) -> None:
        """Begin with an empty screen."""
        self._shown.reset()

    def _feed(self, said: str) -> None:
        self._at += len(said)
        shown = said.replace(self._noise, "") if self._noise else said
        self.sent += shown
        self._stream.feed(shown)
