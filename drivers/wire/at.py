"""The AT side of a modem's port: one command in flight, its answer kept apart from what comes unasked.

    command()       take()                 receive(), expire()
    ───────> queue ───────> in flight ───────────────────────> Answer
                                └─ no final code in time: Answer(TIMEOUT), then AT until its OK, then silence
                                   for a moment; what is late is thrown away in between, and takes no part in
                                   the next answer. A new core begins with that: nobody knows what the port holds.

Descriptors and clocks are somebody else's. Sources: those of at_forms.py.
"""

import heapq
import itertools
from enum import Enum, auto
from typing import NamedTuple

from board.errors import RequestError
from drivers.wire.at_forms import CODE, GONE, SILENT, TIMEOUT, UNSOLICITED, Command, Final, final
from drivers.wire.at_lines import PROMPT, Lines, Rubbish

QUEUE = 8  # commands that wait with one priority; a bring-up has one at a time, an operator a few

PROBE_S = 2.0  # that AT is given to be answered
PROBES = 5  # unanswered: the modem is silent

# Silence after which nothing late is expected. A modem that has answered AT has worked off what came before it.
SETTLE_S = 0.3
SETTLE_MOST_S = 30.0  # one that still says OK after OK is not answering but babbling

SAMPLE = 48  # octets of it that are kept to be shown

ESCAPE = b"\x1b"


class Answer(NamedTuple):
    """A command is done.

    number  that command() gave it.
    lines   of its answer, without the final code.
    """

    number: int
    command: Command
    final: Final
    lines: tuple[str, ...] = ()


class Unsolicited(NamedTuple):
    """A line that nobody asked for."""

    line: str


class Garbage(NamedTuple):
    """Octets that mean nothing, since the last time that this was said.

    sample  begins as they did. octets counts them all.
    """

    sample: bytes
    octets: int


Event = Answer | Unsolicited | Garbage


class _State(Enum):
    UNKNOWN = auto()  # what the port holds: the next command is preceded by AT
    PROBING = auto()  # AT was sent
    SETTLING = auto()  # and answered
    IDLE = auto()
    WAITING = auto()  # for a final code


class _Sent(NamedTuple):
    number: int
    command: Command
    lines: list[str]


class AtCore:
    """Octets and commands in, events and octets out.

    garbage  octets that meant nothing.
    """

    def __init__(self) -> None:
        self.garbage = 0
        self._lines = Lines()
        self._queue: list[tuple[int, int, Command]] = []
        self._numbers = itertools.count(1)
        self._out = bytearray()
        self._state = _State.UNKNOWN
        self._until: float | None = None  # what is waited for in this state
        self._babble_until = 0.0
        self._probes = 0
        self._sent: _Sent | None = None
        self._given_up: Command | None = None
        self._echo = ""
        self._sample = b""
        self._untold = 0

    def command(self, command: Command, now: float, priority: int = 1) -> int:
        """Take a command; its number is in the answer. The lowest priority leaves first, then the oldest.

        Raises RequestError when QUEUE commands of this priority wait already: who asks more than that keeps nobody
        else from asking.
        """
        if sum(waiting == priority for waiting, _, _ in self._queue) >= QUEUE:
            raise RequestError(f"{QUEUE} commands wait for the modem already", "wait for their answers")
        number = next(self._numbers)
        heapq.heappush(self._queue, (priority, number, command))
        self._proceed(now)
        return number

    def receive(self, octets: bytes, now: float) -> list[Event]:
        """What octets complete."""
        events: list[Event] = []
        for line in self._lines.feed(octets):
            if isinstance(line, Rubbish):
                self._rubbish(line.octets)
            else:
                self._line(line, now, events)
        self._complain(events)
        # Not before: what stands behind a final code in the same octets cannot answer a command that follows.
        self._proceed(now)
        return events

    def deadline(self) -> float | None:
        """When expire() wants to be called."""
        return self._until

    def expire(self, now: float) -> list[Event]:
        """What no longer comes."""
        events: list[Event] = []
        if self._until is None or now < self._until:
            return events
        if self._state is _State.SETTLING:
            self._become(_State.IDLE, None)
        elif self._state is _State.WAITING:
            self._finish(TIMEOUT, events)
            self._probe(now)  # at once: what is late comes while nobody waits for anything else
        else:
            self._unanswered(now, events)
        self._proceed(now)
        return events

    def take(self) -> bytes:
        """What is to be written."""
        octets = bytes(self._out)
        self._out.clear()
        return octets

    def reset(self) -> list[Event]:
        """The port is gone, or is a new one: every command is answered, nothing of the old one is kept."""
        events: list[Event] = []
        self._finish(GONE, events)
        self._drop_queue(GONE, events)
        self._lines.clear()
        self._out.clear()
        self._become(_State.UNKNOWN, None)
        return events

    # -- lines

    def _line(self, line: str, now: float, events: list[Event]) -> None:
        if line.upper() == self._echo:
            return
        if self._sent is not None:
            self._while_waiting(self._sent, line, events)
        elif self._state in (_State.PROBING, _State.SETTLING):
            self._while_settling(line, now, events)
        else:
            self._unasked(line, events)

    def _while_waiting(self, sent: _Sent, line: str, events: list[Event]) -> None:
        found = final(line, sent.command.is_call)
        if found is not None:
            self._finish(found, events)
        elif not sent.command.takes(line):
            self._unasked(line, events)
        elif len(sent.lines) < sent.command.most:
            sent.lines.append(line)
        elif sent.command.expects is not None:
            # Of the same form: the last before the final code is the answer, the earlier came unasked.
            events.append(Unsolicited(sent.lines.pop(0)))
            sent.lines.append(line)
        else:
            self._rubbish(line.encode())

    def _while_settling(self, line: str, now: float, events: list[Event]) -> None:
        """AT is under way or just answered: what has a final code's or the old answer's form is late."""
        if final(line, is_call=True) is not None:
            if self._state is _State.PROBING:
                self._babble_until = now + SETTLE_MOST_S
            if now < self._babble_until:
                self._become(_State.SETTLING, now + SETTLE_S)
        elif self._given_up is None or not self._given_up.takes(line):
            self._unasked(line, events)

    def _unasked(self, line: str, events: list[Event]) -> None:
        if UNSOLICITED.match(line) or (CODE.match(line) and final(line, is_call=True) is None):
            events.append(Unsolicited(line))
        elif final(line, is_call=True) is None:  # one that is late is nothing
            self._rubbish(line.encode())

    # -- commands

    def _proceed(self, now: float) -> None:
        """Send the next command, or AT before it."""
        if not self._queue:
            return
        if self._state is _State.UNKNOWN:
            self._probe(now)
        elif self._state is _State.IDLE:
            _, number, command = heapq.heappop(self._queue)
            self._sent = _Sent(number, command, [])
            self._write(command.text)
            self._become(_State.WAITING, now + command.timeout_s)

    def _probe(self, now: float) -> None:
        self._probes = 0
        self._send_probe(now)

    def _send_probe(self, now: float) -> None:
        if self._lines.rest.startswith(PROMPT):  # what we write would be a message's text
            self._out += ESCAPE
        self._write("AT")
        self._become(_State.PROBING, now + PROBE_S)

    def _unanswered(self, now: float, events: list[Event]) -> None:
        self._probes += 1
        if self._probes < PROBES:
            self._send_probe(now)
            return
        self._drop_queue(SILENT, events)
        self._become(_State.UNKNOWN, None)

    def _finish(self, how: Final, events: list[Event]) -> None:
        """End the command in flight, if there is one."""
        if self._sent is None:
            return
        sent, self._sent = self._sent, None
        # OK without the answer that was asked for may be that of an earlier command.
        is_doubtful = how is TIMEOUT or (how.is_ok and sent.command.is_query and not sent.lines)
        self._given_up = sent.command if is_doubtful else None
        events.append(Answer(sent.number, sent.command, how, tuple(sent.lines)))
        self._become(_State.UNKNOWN if is_doubtful else _State.IDLE, None)

    def _drop_queue(self, how: Final, events: list[Event]) -> None:
        while self._queue:
            _, number, command = heapq.heappop(self._queue)
            events.append(Answer(number, command, how))

    def _become(self, state: _State, until: float | None) -> None:
        self._state, self._until = state, until

    def _write(self, text: str) -> None:
        # CR alone: after CR LF some firmware answers twice.
        self._out += text.encode() + b"\r"
        self._echo = text.upper()

    # -- garbage

    def _rubbish(self, octets: bytes) -> None:
        self.garbage += len(octets)
        self._untold += len(octets)
        self._sample = (self._sample + octets[:SAMPLE])[:SAMPLE]

    def _complain(self, events: list[Event]) -> None:
        if self._untold:
            events.append(Garbage(self._sample, self._untold))
            self._untold, self._sample = 0, b""
