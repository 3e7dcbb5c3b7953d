"""A u-blox receiver brought up: who it is, at which rate it listens, and what it shall be.

Each step is a question with an answer; a receiver that gives none fails by name. A configuration that it refuses is
asked for in halves until the keys are found that its firmware does not know.
"""

from collections import deque
from collections.abc import Callable, Iterable

from board.errors import InterfaceError
from board.loop import Loop, Timer
from drivers import gnss_settings
from drivers.gnss_conversation import Conversation
from drivers.gnss_options import FACTORY_BAUD, GnssOptions
from drivers.gnss_port import Line
from drivers.gnss_settings import Group
from drivers.wire import ubx
from drivers.wire.ubx import Kind
from drivers.wire.ubx_health import MonVer
from drivers.wire.ubx_keys import key
from drivers.wire.ubx_messages import Ack, Message, Nak, encode
from drivers.wire.ubx_values import BBR, FLASH, GET_FLASH, RAM, Items, ValGet, ValSet

# From a change of its rate until the receiver listens at the new one. Its acknowledgement comes at the old rate, at
# the new one, or not at all.
CHANGE_S = 0.3
IDENTIFY_TRIES = 3


class Bringup:
    """One bring-up. done() is given the receiver's version; failed() may be called from inside start()."""

    def __init__(
        self,
        loop: Loop,
        talk: Conversation,
        port: Line,
        options: GnssOptions,
        done: Callable[[MonVer], None],
        failed: Callable[[InterfaceError], None],
    ) -> None:
        self.refused: list[str] = []  # names of keys that the firmware does not know
        self.written: list[str] = []  # names of keys that were written into its flash
        self._loop = loop
        self._talk = talk
        self._port = port
        self._options = options
        self._done = done
        self._failed = failed
        self._baud = gnss_settings.baud(options)
        self._bauds = deque([options.rate_baud] if self._baud is None else [options.rate_baud, FACTORY_BAUD])
        self._tried: list[int] = []
        self._groups: deque[Group] = deque()
        self._timer: Timer | None = None

    def start(self) -> None:
        """Open the port. Raises InterfaceError when it cannot be."""
        self._open(self._bauds.popleft())

    def close(self) -> None:
        """Go no further; idempotent."""
        self._talk.close()
        if self._timer is not None:
            self._timer.cancel()

    # Who it is

    def _open(self, baud: int) -> None:
        self._tried.append(baud)
        self._port.open(baud)
        self._talk.ask(ubx.encode(Kind.MON_VER), _is_version, self._identified, IDENTIFY_TRIES)

    def _open_again(self, baud: int) -> None:
        try:
            self._open(baud)
        except InterfaceError as error:
            self._failed(error)

    def _identified(self, answer: Message | None) -> None:
        if isinstance(answer, MonVer):
            self._version = answer
            self._change_baud()
        elif self._bauds:
            self._open_again(self._bauds.popleft())
        else:
            rates = "" if self._baud is None else f" at {' and '.join(map(str, dict.fromkeys(self._tried)))} baud"
            self._failed(
                InterfaceError(
                    f"{self._port.path}: no u-blox receiver answers{rates}",
                    'one that speaks NMEA alone needs kind = "nmea"',
                )
            )

    # At which rate

    def _change_baud(self) -> None:
        if self._baud is None or self._tried[-1] == self._options.rate_baud:
            self._configure()
            return
        self._bauds.clear()
        self._port.write(encode(ValSet(RAM, self._baud.items)))
        self._timer = self._loop.after(CHANGE_S, lambda: self._open_again(self._options.rate_baud))

    # What it shall be

    def _configure(self) -> None:
        self._groups.extend(gnss_settings.groups(self._options))
        self._next_group()

    def _next_group(self) -> None:
        if not self._groups:
            self._save()
            return
        group = self._groups.popleft()
        self._set(RAM, group.items, lambda answer: self._was_set(group, answer))

    def _set(self, layers: int, items: Items, done: Callable[[Message | None], None]) -> None:
        self._talk.ask(encode(ValSet(layers, items)), _is_about(Kind.CFG_VALSET), done)

    def _was_set(self, group: Group, answer: Message | None) -> None:
        if answer is None:
            self._failed(InterfaceError(f"{self._port.path}: the receiver does not acknowledge its {group.name}"))
        elif isinstance(answer, Ack):
            self._next_group()
        elif len(group.items) > 1:
            half = len(group.items) // 2
            self._groups.appendleft(group._replace(items=group.items[half:]))
            self._groups.appendleft(group._replace(items=group.items[:half]))
            self._next_group()
        elif group.is_needed:
            self._failed(
                InterfaceError(
                    f"{self._port.path}: the receiver refuses {_names(group.items)[0]}",
                    f"firmware {self._version.firmware} is too old, or it is another receiver; update it with u-center",
                )
            )
        else:
            self.refused += _names(group.items)
            self._next_group()

    # And stay

    def _save(self) -> None:
        """Flash wears out: it is read first, a group at a time, and what is there already is not written."""
        if not self._options.save:
            self._done(self._version)
            return
        self._groups.extend(gnss_settings.groups(self._options))
        if self._baud is not None:
            self._groups.append(self._baud)
        self._next_kept()

    def _next_kept(self) -> None:
        if not self._groups:
            self._done(self._version)
            return
        group = self._groups.popleft()
        known = tuple(item for item in group.items if key(item[0]).name not in self.refused)
        if not known:
            self._next_kept()
            return
        question = encode(ValGet(0, GET_FLASH, known))
        self._talk.ask(question, _is_about(Kind.CFG_VALGET), lambda answer: self._compare(known, answer))

    def _compare(self, wanted: Items, answer: Message | None) -> None:
        # A key that flash does not hold is left out of the answer; without any, or with silence, all are written.
        kept = dict(answer.items) if isinstance(answer, ValGet) else {}
        missing = tuple((number, value) for number, value in wanted if kept.get(number) != value)
        if not missing:
            self._next_kept()
            return
        self._set(BBR | FLASH, missing, lambda answer: self._was_kept(missing, answer))

    def _was_kept(self, items: Items, answer: Message | None) -> None:
        if isinstance(answer, Ack):
            self.written += _names(items)
        self._next_kept()


def _is_version(message: Message) -> bool:
    return isinstance(message, MonVer)


def _is_about(kind: Kind) -> Callable[[Message], bool]:
    """Whether a message answers a CFG message of a kind."""

    def is_about(message: Message) -> bool:
        if isinstance(message, Ack | Nak):
            # The values of a CFG-VALGET come before its acknowledgement.
            is_refusal = isinstance(message, Nak) or kind is not Kind.CFG_VALGET
            return is_refusal and message.class_ << 8 | message.id == kind
        return isinstance(message, ValGet) and kind is Kind.CFG_VALGET and message.version == 1

    return is_about


def _names(items: Iterable[tuple[int, object]]) -> list[str]:
    return [key(number).name for number, _ in items]
