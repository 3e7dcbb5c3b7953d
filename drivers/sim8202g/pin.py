"""PIN of a SIM: read from a private file, never tried if that could lock the card.

Four rules. A PIN that a card refused is never tried again at this card, also after a restart. With fewer than two
attempts left, no PIN is tried, so that a person still has one attempt. No PIN is tried at a card whose ICCID cannot be
read. No PIN is tried if the try cannot be recorded in a file first.
"""

import hashlib
import json
import os
import stat
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path

from board.runtime import state_file
from board.runtime.describe import read
from board.runtime.errors import BlockedError, ConfigurationError, StorageError

LEAST_ATTEMPTS = 2
MAX_FILE = 64 * 1024  # octets; a refused PIN takes 68, and only a corrected pin_file can add another one


class PinError(BlockedError):
    """The driver must not try a PIN until the user changes the SIM or the PIN file."""


def read_pin(path: str) -> str:
    """Return the PIN in a file.

    Raises PinError if it is not a regular file, cannot be read, is readable by others, or does not have 4 to 8 digits.
    """
    try:
        # The open does not block: a FIFO would otherwise stop the loop until a program writes into it.
        with open(path, encoding="ascii", errors="replace", opener=_open_at_once) as file:
            mode = os.fstat(file.fileno()).st_mode
            if not stat.S_ISREG(mode):
                raise PinError(f"pin_file {path}: not a regular file", "write the PIN into one, mode 0600")
            pin = file.read(64).strip()
    except OSError as error:
        raise PinError(f"pin_file {path}: {error.strerror}", "write the PIN into it, mode 0600") from error
    if mode & 0o077:
        raise PinError(f"pin_file {path}: mode {stat.S_IMODE(mode):04o} lets others read it", f"chmod 600 {path}")
    if not (pin.isascii() and pin.isdecimal() and 4 <= len(pin) <= 8):
        raise PinError(f"pin_file {path}: holds no PIN", "write 4 to 8 digits into the file, and nothing else")
    return pin


@dataclass(frozen=True)
class _Card:
    """PINs tried at one card, as digests.

    refused  PINs that the card refused.
    begun    PIN of a try without recorded result; empty for none.
    left     attempts left before that try.
    """

    refused: tuple[str, ...] = ()
    begun: str = ""
    left: int = 0


@dataclass(frozen=True)
class _Record:
    """Content of the file: digests of cards with their tries.

    The salt makes digests of two stations differ. It does not protect the PIN: a user who may read this file may also
    read pin_file.
    """

    salt: str = ""
    cards: dict[str, _Card] = field(default_factory=dict)

    def digest(self, *parts: str) -> str:
        return hashlib.sha256(" ".join((self.salt, *parts)).encode()).hexdigest()

    def card(self, iccid: str) -> _Card:
        return self.cards.get(self.digest(iccid), _Card())


class PinGuard:
    """Record of PIN tries, in a file that survives a loss of power.

    path  path of the file; its folder must exist. Each try writes it twice, and waits until the octets are on the disk,
          because a locked card costs more than the delay.
    """

    def __init__(self, path: Path) -> None:
        self._path = path

    def begin(self, pin: str, iccid: str, left: int) -> None:
        """Record that a PIN is about to be tried at a card. Raises PinError if it must not be tried.

        iccid  identifier of the card.
        left   attempts that the card has left.
        """
        record = self._load()
        card, key = record.card(iccid), record.digest(iccid, pin)
        # The result of the last try may be missing, for example after a power failure. The attempts left show it: a
        # refused PIN has reduced them.
        has_cost = bool(card.begun) and left < card.left
        refused = (*card.refused, card.begun) if has_cost else card.refused
        if key in refused:
            if has_cost:
                self._keep(record, iccid, _Card(refused))
            raise PinError("the SIM has refused this PIN before, so it is not tried again", "correct pin_file")
        if left < LEAST_ATTEMPTS:
            raise PinError(
                f"the SIM allows only {left} more attempts for its PIN: the station tries none",
                "enter the PIN once in a telephone, which restores all attempts",
            )
        self._keep(record, iccid, _Card(refused, key, left))

    def refused(self, iccid: str) -> None:
        """Record that the card refused the PIN of begin(). Raises PinError if the file cannot be read or written."""
        record = self._load()
        card = record.card(iccid)
        self._keep(record, iccid, _Card((*card.refused, card.begun)))

    def accepted(self, iccid: str) -> None:
        """Record that the card accepted the PIN of begin(), and forget PINs that it refused before."""
        with suppress(PinError):  # harmless: the file then still has a try that has cost no attempt
            self._keep(self._load(), iccid, _Card())

    def _load(self) -> _Record:
        try:
            octets = state_file.read(self._path, MAX_FILE)
            if octets is None:
                return _Record(os.urandom(8).hex())
            found = json.loads(octets)
            return read(_Record, found if isinstance(found, dict) else {"": found}, "it")
        except StorageError as error:
            raise PinError(error.message, "check the PIN, then remove this file") from error
        except (ValueError, ConfigurationError) as error:
            raise PinError(f"{self._path}: cannot be read: {error}", "check the PIN, then remove this file") from error

    def _keep(self, record: _Record, iccid: str, card: _Card) -> None:
        cards = {**record.cards, record.digest(iccid): card}
        kept = _Record(record.salt, {key: value for key, value in cards.items() if value != _Card()})
        try:
            state_file.keep(self._path, json.dumps(asdict(kept)).encode(), 0o600)
        except StorageError as error:
            raise PinError(f"{error.message}; without this file the station tries no PIN", error.hint) from error


def _open_at_once(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK | os.O_NOCTTY)
