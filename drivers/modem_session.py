"""What a packet session leaves in the modem: the QMI client that holds it, in a file, for whoever comes next to end."""

import json
import logging
from pathlib import Path
from typing import NamedTuple

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
            found = json.loads(self._path.read_bytes()[:MAX_FILE])
            session = Session(str(found["client"]), str(found["handle"]))
        except (OSError, ValueError, KeyError, TypeError):
            return None
        return session if session.client.isdecimal() and (session.handle or "0").isdecimal() else None

    def keep(self, session: Session | None) -> None:
        """Write it down; None: there is none any more."""
        try:
            if session is None:
                self._path.unlink(missing_ok=True)
            else:
                self._path.write_text(json.dumps(session._asdict()))
        except OSError as error:
            log.debug("%s: %s", self._path, error.strerror)
