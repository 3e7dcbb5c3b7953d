"""What a packet session leaves in the modem: the QMI client that holds it, in a file, for whoever comes next to end."""

import json
import logging
from pathlib import Path
from typing import NamedTuple

from board import state_file
from board.errors import StorageError

MAX_FILE = 4096  # octets

log = logging.getLogger("captain.modem")


class Session(NamedTuple):
    """Of qmicli. client: the CID; handle: of the packets, empty before they may flow."""

    client: str
    handle: str = ""


class SessionFile:
    """The session that is open, if there is one.

    A station that ends without a word leaves it open in the modem, which has few clients, and gives its network to one.
    What cannot be written is not known to the next start, and does not keep this one from its network.
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
        """Write it down; None: there is none any more."""
        try:
            if session is None:
                state_file.forget(self._path)
            else:
                state_file.keep(self._path, json.dumps(session._asdict()).encode())
        except StorageError as error:
            log.debug("%s", error.message)  # it is counted
