"""Packet session of a modem: stores its QMI client in a file, to end the session later."""

import json
import logging
from pathlib import Path
from typing import NamedTuple

from board.runtime import state_file
from board.runtime.errors import StorageError

MAX_FILE = 4096  # longest file in octets

log = logging.getLogger("captain.modem")


class Session(NamedTuple):
    """A session of qmicli.

    client  client ID (CID).
    handle  packet data handle; empty before the network is started.
    """

    client: str
    handle: str = ""


class SessionFile:
    """File with the open session, if there is one.

    A station that ends without stop() leaves its session open in the modem. The modem has few clients, and gives its
    network to only one of them, so the next start must end that session. If the file cannot be written, the next start
    does not know the session; the current start continues.
    """

    def __init__(self, path: Path) -> None:
        self._path = path

    def load(self) -> Session | None:
        try:
            found = json.loads(state_file.read(self._path, MAX_FILE) or b"{}")
            session = Session(str(found["client"]), str(found["handle"]))
        except (StorageError, ValueError, KeyError, TypeError):
            return None
        return session if session.client.isdecimal() and (session.handle or "0").isdecimal() else None

    def keep(self, session: Session | None) -> None:
        """Write the session to the file; None: remove the file, because the session has ended."""
        try:
            if session is None:
                state_file.forget(self._path)
            else:
                state_file.keep(self._path, json.dumps(session._asdict()).encode())
        except StorageError as error:
            log.debug("%s", error.message)  # debug level only: state_file counts the error
