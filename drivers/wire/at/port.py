"""AT port core: one command in flight, its answer kept apart from unsolicited lines.

Rules:

# state      meaning                                   event                              -> state
#
# UNKNOWN    old answers may still arrive              a command waits                       PROBING: AT is written
# PROBING    AT was written                            a final code                          SETTLING
#                                                      PROBE_S is over, PROBES times         UNKNOWN; all waiting
#                                                                                            commands are SILENT
# SETTLING   late answers are discarded                SETTLE_S without a final code         IDLE
# IDLE       nothing is in flight                      a command waits                       WAITING: it is written
# WAITING    a command is in flight                    its final code                        IDLE
#                                                      OK without the line it asked for      UNKNOWN
#                                                      its timeout is over                   PROBING, after TIMEOUT
# any        reset() -> UNKNOWN; every command is answered GONE

The owner of the port (drivers/sim8202g/port.py) calls command() in any state, receive() with each read, and expire() at
deadline(). It writes take() after each of them, and calls reset() when the port is gone. Every command gets one Answer.

A new core begins in UNKNOWN, because the port may hold answers to an earlier user. In PROBING and SETTLING, final codes
and answers to the abandoned command are discarded. Otherwise each later command would get the answer of the one before
it. SETTLING ends after SETTLE_MOST_S, even if the modem still repeats OK.

The pending command and the form distinguish answers from unsolicited lines. If both have the same form, the last line
before the final code is the answer. Each priority has its own QUEUE places. With a single queue, an operator's 32
commands made the driver's own command fail, and the driver reset its modem.

Sources: those of forms.py.
"""

import heapq
import itertools
from enum import Enum, auto
from typing import NamedTuple

from board.runtime.errors import RequestError
from drivers.wire.at.forms import CODE, GONE, SILENT, TIMEOUT, UNSOLICITED, Command, Final, final
from drivers.wire.at.lines import PROMPT, Lines, Rubbish

QUEUE = 8  # waiting commands per priority; the driver's start has one at a time, an operator a few

PROBE_S = 2.0  # timeout of the answer to AT
PROBES = 5  # unanswered ATs after which the modem counts as silent

# After this silence no late answer is expected: a modem that has answered AT has completed all earlier commands.
SETTLE_S = 0.3
SETTLE_MOST_S = 30.0  # a modem that repeats OK for longer is babbling, not answering

SAMPLE = 48  # first octets of garbage that are kept for the report

ESCAPE = b"\x1b"


class Answer(NamedTuple):
    """Completed command.

    number  number that command() returned for it.
    lines   lines of the answer, without the final code.
    """

    number: int
    command: Command
    final: Final
    lines: tuple[str, ...] = ()


class Unsolicited(NamedTuple):
    """Unsolicited line of the modem."""

    line: str


class Garbage(NamedTuple):
    """Meaningless octets since the last Garbage event.

    sample  first octets, at most SAMPLE.
    octets  number of octets.
    """

    sample: bytes
    octets: int


Event = Answer | Unsolicited | Garbage


class _State(Enum):
    UNKNOWN = auto()  # old answers may arrive; AT precedes the next command
    PROBING = auto()  # AT was sent, and its answer is pending
    SETTLING = auto()  # AT was answered; late answers are discarded
    IDLE = auto()
    WAITING = auto()  # for the final code of a command


class _Sent(NamedTuple):
    number: int
    command: Command
    lines: list[str]


class AtCore:
    """AT port core: accepts received octets and commands, returns events and the octets to write.

    garbage  total number of meaningless octets.
    """

    def __init__(self) -> None:
        self.garbage = 0
        self._lines = Lines()
        self._queue: list[tuple[int, int, Command]] = []
        self._numbers = itertools.count(1)
        self._out = bytearray()
        self._state = _State.UNKNOWN
        self._until: float | None = None  # end of the current state's wait
        self._babble_until = 0.0
        self._probes = 0
        self._sent: _Sent | None = None
        self._given_up: Command | None = None
        self._echo = ""
        self._sample = b""
        self._untold = 0

    def command(self, command: Command, now: float, priority: int = 1) -> int:
        """Queue a command; return its number, which its Answer repeats.

        Commands are sent by priority, the lowest number first, then by age. Raises RequestError if QUEUE commands of
        this priority are waiting. The limit is per priority, so that a user with many commands does not block the
        others.
        """
        if sum(waiting == priority for waiting, _, _ in self._queue) >= QUEUE:
            raise RequestError(f"{QUEUE} commands wait for the modem already", "wait for their answers")
        number = next(self._numbers)
        heapq.heappush(self._queue, (priority, number, command))
        self._proceed(now)
        return number

    def receive(self, octets: bytes, now: float) -> list[Event]:
        """Return the events that the octets complete."""
        events: list[Event] = []
        for line in self._lines.feed(octets):
            if isinstance(line, Rubbish):
                self._rubbish(line.octets)
            else:
                self._line(line, now, events)
        self._complain(events)
        # Sent after all lines are processed: lines received before cannot be the answer to the next command.
        self._proceed(now)
        return events

    def deadline(self) -> float | None:
        """Return the time when expire() must be called; None if nothing is pending."""
        return self._until

    def expire(self, now: float) -> list[Event]:
        """Process a timeout that has passed; return the events, such as answers with TIMEOUT or SILENT."""
        events: list[Event] = []
        if self._until is None or now < self._until:
            return events
        if self._state is _State.SETTLING:
            self._become(_State.IDLE, None)
        elif self._state is _State.WAITING:
            self._finish(TIMEOUT, events)
            self._probe(now)  # at once, so that the late answer arrives while no other command is in flight
        else:
            self._unanswered(now, events)
        self._proceed(now)
        return events

    def take(self) -> bytes:
        """Return the octets to write to the port, and forget them."""
        octets = bytes(self._out)
        self._out.clear()
        return octets

    def reset(self) -> list[Event]:
        """Answer all commands with GONE and clear all state: the port has disappeared or was replaced."""
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
            # All have the same form: the last line before the final code is the answer, earlier ones are unsolicited.
            events.append(Unsolicited(sent.lines.pop(0)))
            sent.lines.append(line)
        else:
            self._rubbish(line.encode())

    def _while_settling(self, line: str, now: float, events: list[Event]) -> None:
        """Process a line after AT was sent: discard late final codes and late lines of the abandoned answer."""
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
        elif final(line, is_call=True) is None:  # a late final code is ignored
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
        if self._lines.rest.startswith(PROMPT):  # the modem waits for the text of a message; ESC cancels that
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
        # OK without the expected line may belong to an earlier command.
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
