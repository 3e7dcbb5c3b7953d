"""The PIN of a SIM: read from a file that nobody else may read, and never tried where it could lock the card.

Four rules. A PIN that a card refused is never tried at it again, across restarts. None is tried with fewer than two
attempts left, so that a person has one. None is tried at a card that does not say which it is. None is tried where the
try cannot be written down first.
"""

import hashlib
import json
import os
import stat
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path

from board import state_file
from board.describe import read
from board.errors import BlockedError, ConfigurationError, StorageError

LEAST_ATTEMPTS = 2
MAX_FILE = 64 * 1024  # octets; a refused PIN takes 68 of them, and a person who corrects pin_file


class PinError(BlockedError):
    """No PIN may be tried; somebody has to change something."""


def read_pin(path: str) -> str:
    """The digits in a file. Raises PinError."""
    try:
        # A FIFO would keep the loop waiting for who writes into it.
        with open(path, encoding="ascii", errors="replace", opener=_open_at_once) as file:
            mode = os.fstat(file.fileno()).st_mode
            if not stat.S_ISREG(mode):
                raise PinError(f"pin_file {path}: is no regular file", "write the PIN into one, mode 0600")
            pin = file.read(64).strip()
    except OSError as error:
        raise PinError(f"pin_file {path}: {error.strerror}", "write the PIN into it, mode 0600") from error
    if mode & 0o077:
        raise PinError(f"pin_file {path}: mode {stat.S_IMODE(mode):04o} lets others read it", f"chmod 600 {path}")
    if not (pin.isascii() and pin.isdecimal() and 4 <= len(pin) <= 8):
        raise PinError(f"pin_file {path}: holds no PIN", "4 to 8 digits, and nothing else")
    return pin


@dataclass(frozen=True)
class _Card:
    """What one card has been tried with: digests of PINs.

    begun  a try whose end nobody has written down; empty for none.
    left   attempts that there were before it.
    """

    refused: tuple[str, ...] = ()
    begun: str = ""
    left: int = 0


@dataclass(frozen=True)
class _Record:
    """The file. Whoever may read it may read pin_file as well: the salt only keeps digests of two stations apart."""

    salt: str = ""
    cards: dict[str, _Card] = field(default_factory=dict)

    def digest(self, *parts: str) -> str:
        return hashlib.sha256(" ".join((self.salt, *parts)).encode()).hexdigest()

    def card(self, iccid: str) -> _Card:
        return self.cards.get(self.digest(iccid), _Card())


class PinGuard:
    """What was tried, in a file that survives a loss of power.

    path  of it; its folder must exist. It is written twice for a try, and waited for: a card is worth that.
    """

    def __init__(self, path: Path) -> None:
        self._path = path

    def begin(self, pin: str, iccid: str, left: int) -> None:
        """Write down that a PIN is about to be tried at a card. Raises PinError where it must not be.

        iccid  what tells the card from others. left: attempts that it has.
        """
        record = self._load()
        card, key = record.card(iccid), record.digest(iccid, pin)
        # Without a word of how the last try ended (the power may have failed) the attempts that are left tell.
        has_cost = bool(card.begun) and left < card.left
        refused = (*card.refused, card.begun) if has_cost else card.refused
        if key in refused:
            if has_cost:
                self._keep(record, iccid, _Card(refused))
            raise PinError("the SIM has refused this PIN before: it is not tried again", "correct pin_file")
        if left < LEAST_ATTEMPTS:
            raise PinError(
                f"the SIM leaves {left} attempts for its PIN: none is used",
                "enter it once in a telephone, which gives all attempts back",
            )
        self._keep(record, iccid, _Card(refused, key, left))

    def refused(self, iccid: str) -> None:
        """The card did not take what was begun."""
        record = self._load()
        card = record.card(iccid)
        self._keep(record, iccid, _Card((*card.refused, card.begun)))

    def accepted(self, iccid: str) -> None:
        """The card took it: what it refused before it may be given now."""
        with suppress(PinError):  # what stays written is a try that has cost no attempt
            self._keep(self._load(), iccid, _Card())

    def _load(self) -> _Record:
        try:
            octets = state_file.read(self._path, MAX_FILE)
            if octets is None:
                return _Record(os.urandom(8).hex())
            found = json.loads(octets)
            return read(_Record, found if isinstance(found, dict) else {"": found}, "it")
        except StorageError as error:
            raise PinError(error.message, "remove it when the PIN is right") from error
        except (ValueError, ConfigurationError) as error:
            raise PinError(f"{self._path}: cannot be read: {error}", "remove it when the PIN is right") from error

    def _keep(self, record: _Record, iccid: str, card: _Card) -> None:
        cards = {**record.cards, record.digest(iccid): card}
        kept = _Record(record.salt, {key: value for key, value in cards.items() if value != _Card()})
        try:
            state_file.keep(self._path, json.dumps(asdict(kept)).encode(), 0o600)
        except StorageError as error:
            raise PinError(f"{error.message}; without it no PIN is tried", error.hint) from error


def _open_at_once(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK | os.O_NOCTTY)
