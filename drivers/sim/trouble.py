"""Faults of a simulated board, begun and ended by commands on a socket.

They imitate manual interventions on a real board, and faults of modules. Commands are datagrams such as `begin cellular
garbage` or `end cellular garbage` to the Unix socket TROUBLE in the board's folder. The answer is `ok` or the error.
A real board has no such socket: only drivers/sim/board.py opens it.
"""

import errno
import random
import socket
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from board.description import Hardware
from board.runtime.errors import RequestError
from board.runtime.loop import Loop, Timer
from drivers.sim.chips import Fault, World
from drivers.sim.modem.network import Access
from drivers.sim.modules import MODEM, RADIO, RECEIVER, SimulatedModule, SlotPort, stranger

TROUBLE = "trouble"
LONGEST = 200  # octets of a command; longer datagrams are truncated

BABBLE_S = 0.1  # interval of pieces of garbage
BABBLE = 100  # octets of a piece
FLAP_S = 3.0  # interval of crashes, long enough for the module to be seen in between
SEED = 20  # fixed, so that garbage is the same in every run

STUCK_S = 1.0  # timeout of the kernel for a blocked bus
HELD_S = 4.0  # above the timeout of calls to the worker

JUMP = 9_000_000  # 1e-7 degree: 100 km to the north

BOARD = "board"  # name for faults of the board, in place of a slot


class Bench(Protocol):
    """Part of a simulated board that the faults use."""

    modules: dict[str, SimulatedModule]
    world: World

    def unplug(self, slot: str) -> None: ...
    def plug(self, slot: str, other: Callable[[Loop, SlotPort], SimulatedModule] | None = None) -> None: ...


@dataclass
class Seat:
    """Place of a fault: a slot, or the board."""

    loop: Loop
    bench: Bench
    hardware: Hardware
    name: str
    chance: random.Random = field(default_factory=lambda: random.Random(SEED))
    again: Timer | None = None

    @property
    def plays(self) -> Any:
        """Simulator of the module in the slot."""
        return self.bench.modules[self.name].plays


Act = Callable[[Seat], None]


class Trouble(NamedTuple):
    begin: Act
    end: Act = lambda seat: None


def _set(**attributes: object) -> Act:
    def act(seat: Seat) -> None:
        for name, value in attributes.items():
            setattr(seat.plays, name, value)

    return act


def _sky(**changes: int) -> Act:
    def act(seat: Seat) -> None:
        seat.plays.sky = replace(seat.plays.sky, **changes)

    return act


def _say(words: str) -> Act:
    return lambda seat: seat.plays.say(words)


def _again(what: Act, every_s: float) -> Trouble:
    """Return a fault that repeats an action periodically."""

    def begin(seat: Seat) -> None:
        what(seat)
        seat.again = seat.loop.after(every_s, lambda: begin(seat))

    def end(seat: Seat) -> None:
        if seat.again is not None:
            seat.again.cancel()

    return Trouble(begin, end)


def _garbage(seat: Seat) -> None:
    seat.plays.say(seat.chance.randbytes(BABBLE))


def _crash(seat: Seat) -> None:
    """Make the module leave USB and boot again, if its supply is on."""
    seat.bench.unplug(seat.name)
    seat.bench.plug(seat.name)


def _card(is_there: bool) -> Act:
    def act(seat: Seat) -> None:
        modem = seat.plays
        modem.card.is_there = is_there
        modem.unsolicited("+CPIN: READY" if is_there else "+CPIN: NOT INSERTED")
        if is_there:
            modem.network.search()
        else:
            modem.network.leave()

    return act


def _chips(fault: Fault | None, *tables: str) -> Act:
    """Return the action that begins or ends a fault of all chips in tables of the board file."""

    def act(seat: Seat) -> None:
        for bus, address in _addresses(seat.hardware, tables):
            seat.bench.world.fail(bus, address, fault)

    return act


def _addresses(hardware: Hardware, tables: tuple[str, ...]) -> Iterator[tuple[str, int]]:
    for table in tables:
        for chip in getattr(hardware, table).values():
            if chip.bus:
                yield chip.bus, chip.address


EVERY = ("expanders", "rails", "temperatures")
NACK = Fault(errno.EREMOTEIO)
STUCK = Fault(errno.ETIMEDOUT, seconds=STUCK_S)
HELD = Fault(errno.ETIMEDOUT, seconds=HELD_S)

# Faults of every module.
_OF_ALL = {
    "unplugged": Trouble(lambda seat: seat.bench.unplug(seat.name), lambda seat: seat.bench.plug(seat.name)),
    "crash": Trouble(_crash),
    "flapping": _again(_crash, FLAP_S),
    "stranger": Trouble(lambda seat: seat.bench.plug(seat.name, stranger), lambda seat: seat.bench.plug(seat.name)),
}
_GARBAGE = {"garbage": _again(_garbage, BABBLE_S)}

# Faults by the first id of the slot, as in drivers/sim/modules.py.
TROUBLES: Mapping[str, Mapping[str, Trouble]] = {
    RECEIVER: {
        **_OF_ALL,
        **_GARBAGE,
        "mute": Trouble(_set(is_mute=True), _set(is_mute=False)),
        "deaf": Trouble(_set(is_deaf=True), _set(is_deaf=False)),
        "unacknowledged": Trouble(_set(acknowledges=False), _set(acknowledges=True)),
        "jump": Trouble(_sky(offset=JUMP), _sky(offset=0)),
        "jamming": Trouble(_sky(jamming=3, satellites=0), _sky(jamming=1, satellites=28)),
    },
    MODEM: {
        **_OF_ALL,
        **_GARBAGE,
        "silent": Trouble(_set(answers=False), _set(answers=True)),
        "refusing": Trouble(_set(lies=lambda text: "\r\nERROR\r\n"), _set(lies=lambda text: None)),
        "uncovered": Trouble(
            lambda seat: seat.plays.network.offer(Access.NONE), lambda seat: seat.plays.network.offer(Access.NSA)
        ),
        "cardless": Trouble(_card(False), _card(True)),
    },
    RADIO: {
        **_OF_ALL,
        "away": Trouble(_say("down=1"), _say("down=0")),
        "library": Trouble(_say("crash=1")),  # the library's process ends
        "hanging": Trouble(_say("hang=tx"), _say("hang=none")),
    },
    BOARD: {
        "unanswered": Trouble(_chips(NACK, "rails", "temperatures"), _chips(None, "rails", "temperatures")),
        "switchless": Trouble(_chips(NACK, "expanders"), _chips(None, "expanders")),
        "stuck": Trouble(_chips(STUCK, *EVERY), _chips(None, *EVERY)),
        "held": Trouble(_chips(HELD, *EVERY), _chips(None, *EVERY)),
    },
}


class Troubles:
    """Available faults of one board."""

    def __init__(self, loop: Loop, bench: Bench, hardware: Hardware) -> None:
        self._seats = {name: Seat(loop, bench, hardware, name) for name in (*hardware.slots, BOARD)}
        self._kinds = {name: slot.ids[0] for name, slot in hardware.slots.items() if slot.ids} | {BOARD: BOARD}

    def words(self, where: str) -> Mapping[str, Trouble]:
        """Return the faults of a slot, or of the board, by name."""
        return TROUBLES.get(self._kinds.get(where, ""), {})

    def obey(self, text: str) -> None:
        """Execute the command `begin SLOT WORD` or `end SLOT WORD`.

        Raises RequestError for another form, and for a fault that the slot does not have.
        """
        match text.split():
            case [("begin" | "end") as verb, where, word] if word in self.words(where):
                trouble = self.words(where)[word]
                (trouble.begin if verb == "begin" else trouble.end)(self._seats[where])
            case _:
                every = "; ".join(f"{name}: {', '.join(self.words(name))}" for name in self._seats if self.words(name))
                raise RequestError(f"unknown trouble: {text!r}", f"begin or end, then one of {every}")


class Door:
    """Socket for the commands; a Source of the loop."""

    def __init__(self, loop: Loop, folder: Path, troubles: Troubles) -> None:
        self._loop = loop
        self._troubles = troubles
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self._socket.bind(str(folder / TROUBLE))
        loop.add(self)

    def fileno(self) -> int:
        return self._socket.fileno()

    def ready(self, events: int) -> None:
        octets, sender = self._socket.recvfrom(LONGEST)
        try:
            self._troubles.obey(octets.decode("utf-8", "replace"))
            answer = "ok"
        except RequestError as error:
            answer = str(error)
        if sender:
            try:
                self._socket.sendto(answer.encode(), sender)
            except OSError:  # the sender of the command has gone
                return

    def close(self) -> None:
        """Close the socket; idempotent."""
        if self.fileno() >= 0:
            self._loop.remove(self)
            self._socket.close()
