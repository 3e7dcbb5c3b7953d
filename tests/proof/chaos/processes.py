"""Worker processes, simulated in one process and in virtual time.

The real code runs in them if possible: board/bus_calls.py does the board's calls on simulated buses, which take a
bus's virtual time. The radio's process is simulated: its library has threads and a clock of its own.
"""

import json
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, Protocol, cast

from board.bus_calls import BlockingBusCalls, read_first_message
from board.runtime.child import GRACE_S, Child, Parent
from board.runtime.loop import Loop
from drivers.sim.chips import FiledBus
from drivers.som301e.process import CALL_S
from drivers.wire import v2xcast as wire

STARTED_S = 0.2  # from being started to its hello
CALLED_S = 0.002  # a call of the radio's library, or a message of the board's worker


class Program(Protocol):
    """What runs in a child: takes messages, and says others some seconds later."""

    def take(self, message: bytes) -> None: ...
    def end(self) -> None: ...


Say = Callable[[float, bytes], None]


class PlayedChild:
    """Started by board.runtime.worker.Worker in place of a process. programs: made when it runs, by their names.

    running  those that have been started and neither ended nor been let go.
    """

    programs: ClassVar[dict[str, Callable[[Loop, Say, "PlayedChild"], Program]]] = {}
    running: ClassVar[list["PlayedChild"]] = []

    def __init__(self, loop: Loop, parent: Parent, program: Sequence[str], name: str, silence_s: float = 0.0) -> None:
        self.loop = loop
        self.name = name
        self.is_up = False
        self.queue: deque[bytes] = deque()
        self.lost = self.longest = 0
        self._parent = parent
        self._as_child = cast(Child, self)  # which it has the methods of
        self._program: Program | None = None
        self._start = loop.after(STARTED_S, self._run)
        self.running.append(self)

    def send(self, message: bytes) -> bool:
        if self.is_up and self._program is not None:
            self._program.take(message)
        return self.is_up

    def leave(self) -> None:
        self._gone()
        self.loop.after(GRACE_S / 2, lambda: self._parent.ended(self._as_child, "left"))

    def finish(self, within: float) -> None:
        self._gone()
        self._parent.ended(self._as_child, "left")

    def crash(self) -> None:
        """It ends by a signal."""
        if self.is_up:
            self._gone()
            self._parent.ended(self._as_child, "ended by SIGSEGV")

    def _run(self) -> None:
        self.is_up = True
        self._program = self.programs[self.name](self.loop, self._say, self)
        self._parent.up(self._as_child, 4711)

    def _say(self, delay_s: float, message: bytes) -> None:
        self.loop.after(delay_s, lambda: self._parent.message(message) if self.is_up else None)

    def _gone(self) -> None:
        self._start.cancel()
        self.is_up = False
        if self in self.running:
            self.running.remove(self)
        if self._program is not None:
            self._program.end()


class PlayedBoard:
    """The board's worker: one call after the other, each as long as its buses block."""

    def __init__(self, loop: Loop, say: Say, child: PlayedChild) -> None:
        self._loop = loop
        self._say = say
        self._calls: BlockingBusCalls | None = None
        self._blocked_s = 0.0

    def take(self, message: bytes) -> None:
        if self._calls is None:
            self._calls = BlockingBusCalls(*read_first_message(message), self._open)
            return
        self._blocked_s = CALLED_S
        answer = self._calls.answer(message)
        self._say(self._blocked_s, answer)

    def end(self) -> None: ...

    def _open(self, *which: Any) -> FiledBus:
        bus = FiledBus(*which)
        bus._simulated._block = self._block
        return bus

    def _block(self, seconds: float) -> None:
        self._blocked_s += seconds


class PlayedRadio:
    """The radio's worker with its library: handlers that come up when the module is there, and messages that leave.

    is_away  whether the module does not answer; is_hanging: whether a call for sending does not return.
    sent     messages that have left.
    """

    is_away = False
    is_hanging = False
    sent = 0
    now: ClassVar["PlayedRadio | None"] = None  # that which runs

    def __init__(self, loop: Loop, say: Say, child: PlayedChild) -> None:
        self._loop = loop
        self._say = say
        self._child = child
        self._handlers: list[tuple[int, int]] = []
        type(self).now = self

    def take(self, message: bytes) -> None:
        if not self._handlers:
            casters = json.loads(message)["casters"]
            self._handlers = [(place, mode) for place in range(len(casters)) for mode in (wire.TX, wire.RX)]
            self.look()
        elif message[0] == wire.SEND:
            self._send(wire.to_send(message).number)

    def end(self) -> None:
        if type(self).now is self:
            type(self).now = None

    def look(self) -> None:
        """The module has come or gone."""
        why_not = "V2Xcast service is not available" if self.is_away else ""
        for place, mode in self._handlers:
            self._say(CALLED_S, wire.state(place, mode, why_not))

    def _send(self, number: int) -> None:
        if self.is_hanging:
            self._say(CALL_S, wire.fault(False, f"eu_caster_tx has not returned for {CALL_S:.0f} s"))
        elif self.is_away:
            self._say(CALLED_S, wire.sent(number, "no answer to the TX request"))
        else:
            type(self).sent += 1
            self._say(CALLED_S, wire.sent(number))

    @classmethod
    def tell(cls, words: str) -> None:
        """As drivers.sim.radio.control.Control.say()."""
        radio = cls.now
        if radio is None:
            return
        match words:
            case "down=1" | "down=0":
                radio.is_away = words == "down=1"
                radio.look()
            case "hang=tx" | "hang=none":
                radio.is_hanging = words == "hang=tx"
            case "crash=1":
                radio._child.crash()


PlayedChild.programs = {"sim-board": PlayedBoard, "som301e": PlayedRadio}
