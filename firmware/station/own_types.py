"""Own message types that `captain-asn1 add` registers while the station runs."""

import logging
import os
from collections.abc import Callable

from board.runtime.errors import ConfigurationError
from board.runtime.loop import Loop
from drivers.message import MessageType
from firmware.config import registered
from firmware.config.tables import TypeConfig
from firmware.topics import Topics, TypeRow

LOOK_S = 0.5
Stamp = tuple[tuple[str, int, int], ...]  # path, inode and time of the last change of each file

log = logging.getLogger("captain.types")


class OwnTypes:
    """Looks twice a second whether a types.toml has changed, and adds its new rows to the table of types.

    take  receives each added type.

    A changed or removed row takes effect at the next start: other parts may use its type.
    """

    def __init__(self, loop: Loop, topics: Topics, take: Callable[[MessageType], None]) -> None:
        self._loop = loop
        self._topics = topics
        self._take = take
        self._stamp: Stamp = ()  # the first look adds what was registered after the configuration was read

    def start(self) -> None:
        self._loop.every(LOOK_S, self._look)

    def _look(self) -> None:
        if (stamp := _stamp()) == self._stamp:
            return
        self._stamp = stamp
        for path, *_ in stamp:
            try:
                rows = registered.rows_of(path)
            except ConfigurationError as error:
                log.error("%s; the types in force stay", error)
                continue
            for row in rows:
                self._add(path, type_row(row))

    def _add(self, path: str, row: TypeRow) -> None:
        if (kind := self._topics.add(row)) is not None:
            self._take(kind)
            log.info("new message type %s: messageID %d, BTP port %s", kind.name, kind.number, kind.btp_port)
        elif not self._topics.has(row):
            log.warning("%s: the type in force differs from row %s: restart the station to apply it", path, row.name)


def type_row(row: TypeConfig) -> TypeRow:
    """Return a row of [[types]] as a row of the table of types; both profiles send it at the same port."""
    return TypeRow(row.number, row.name, row.btp_port, row.btp_port, row.priority, row.lifetime_s, row.traffic_class)


def _stamp() -> Stamp:
    found = []
    for path in registered.files():
        try:
            file = os.stat(path)
        except OSError:
            continue
        found.append((path, file.st_ino, file.st_mtime_ns))
    return tuple(found)
