"""Configuration of an identified u-blox receiver: writes groups of keys, and saves them in flash if asked to.

If the receiver refuses a group, the group is halved until the keys are found that its firmware does not know.
"""

from collections import deque
from collections.abc import Callable, Iterable

from board.runtime.errors import InterfaceError
from drivers.gnss import settings
from drivers.gnss.conversation import Conversation
from drivers.gnss.options import GnssOptions
from drivers.gnss.settings import KeyGroup
from drivers.wire.ublox.health import MonVer
from drivers.wire.ublox.keys import key
from drivers.wire.ublox.messages import Ack, Message, Nak, encode
from drivers.wire.ublox.ubx import Kind
from drivers.wire.ublox.values import BBR, FLASH, GET_FLASH, RAM, Items, ValGet, ValSet

# Called with the receiver's version and the names of keys that its firmware does not know.
Done = Callable[[MonVer, list[str]], None]


class Configuration:
    """One pass over all groups of keys. It ends with done() or failed(), unless the conversation is closed.

    talk     conversation with the receiver.
    path     path of the port, for error messages.
    version  version that the receiver has reported.
    """

    def __init__(
        self,
        talk: Conversation,
        path: str,
        options: GnssOptions,
        version: MonVer,
        done: Done,
        failed: Callable[[InterfaceError], None],
    ) -> None:
        self._talk = talk
        self._path = path
        self._options = options
        self._version = version
        self._done = done
        self._failed = failed
        self._refused: list[str] = []
        self._groups: deque[KeyGroup] = deque()

    def start(self) -> None:
        """Write the first group of keys."""
        self._groups.extend(settings.groups(self._options))
        self._next_group()

    def _next_group(self) -> None:
        if not self._groups:
            self._save()
            return
        group = self._groups.popleft()
        self._set(RAM, group.items, lambda answer: self._was_set(group, answer))

    def _set(self, layers: int, items: Items, done: Callable[[Message | None], None]) -> None:
        self._talk.ask(encode(ValSet(layers, items)), _is_about(Kind.CFG_VALSET), done)

    def _was_set(self, group: KeyGroup, answer: Message | None) -> None:
        if answer is None:
            self._failed(InterfaceError(f"{self._path}: the receiver does not acknowledge its {group.name}"))
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
                    f"{self._path}: the receiver refuses {_names(group.items)[0]}",
                    f"firmware {self._version.firmware} is too old, or it is another receiver; update it with u-center",
                )
            )
        else:
            self._refused += _names(group.items)
            self._next_group()

    # Saving in flash

    def _save(self) -> None:
        """Save the configuration, if the option says so. Flash wears out, so only keys that differ are written."""
        if not self._options.save:
            self._done(self._version, self._refused)
            return
        self._groups.extend(settings.groups(self._options))
        if (baud := settings.baud(self._options)) is not None:
            self._groups.append(baud)
        self._next_kept()

    def _next_kept(self) -> None:
        if not self._groups:
            self._done(self._version, self._refused)
            return
        group = self._groups.popleft()
        known = tuple(item for item in group.items if key(item[0]).name not in self._refused)
        if not known:
            self._next_kept()
            return
        question = encode(ValGet(0, GET_FLASH, known))
        self._talk.ask(question, _is_about(Kind.CFG_VALGET), lambda answer: self._compare(known, answer))

    def _compare(self, wanted: Items, answer: Message | None) -> None:
        # The answer leaves out keys that flash does not contain. If it has no key, or is missing, all keys are written.
        kept = dict(answer.items) if isinstance(answer, ValGet) else {}
        missing = tuple((number, value) for number, value in wanted if kept.get(number) != value)
        if not missing:
            self._next_kept()
            return
        self._set(BBR | FLASH, missing, lambda answer: self._next_kept())


def _is_about(kind: Kind) -> Callable[[Message], bool]:
    """Return a function that returns True if a message answers a CFG message of this kind."""

    def is_about(message: Message) -> bool:
        if isinstance(message, Ack | Nak):
            # The values that answer a CFG-VALGET arrive before its Ack, so of Ack and Nak only a Nak answers it.
            is_refusal = isinstance(message, Nak) or kind is not Kind.CFG_VALGET
            return is_refusal and message.class_ << 8 | message.id == kind
        return isinstance(message, ValGet) and kind is Kind.CFG_VALGET and message.version == 1

    return is_about


def _names(items: Iterable[tuple[int, object]]) -> list[str]:
    return [key(number).name for number, _ in items]
