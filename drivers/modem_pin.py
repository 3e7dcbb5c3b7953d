"""The PIN of a SIM: read from a file that nobody else may read, and never tried where it could lock the card.

Three rules. A PIN that this card refused is never tried again, across restarts. None is tried with fewer than two
attempts left, so that a person has one. None is tried where the try cannot be written down first.
"""

import hashlib
import json
import os
import stat
from pathlib import Path

from drivers.modem_script import BlockedError

LEAST_ATTEMPTS = 2
MAX_FILE = 4096  # octets


class PinError(BlockedError):
    """No PIN may be tried; somebody has to change something."""


def read_pin(path: str) -> str:
    """The digits in a file. Raises PinError."""
    try:
        with open(path, encoding="ascii", errors="replace") as file:
            mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
            pin = file.read(64).strip()
    except OSError as error:
        raise PinError(f"pin_file {path}: {error.strerror}", "write the PIN into it, mode 0600") from error
    if mode & 0o077:
        raise PinError(f"pin_file {path}: mode {mode:04o} lets others read it", f"chmod 600 {path}")
    if not (pin.isdecimal() and 4 <= len(pin) <= 8):
        raise PinError(f"pin_file {path}: holds no PIN", "4 to 8 digits, and nothing else")
    return pin


class PinGuard:
    """What was tried, in a file.

    path  of it; its folder must exist.
    """

    def __init__(self, path: Path) -> None:
        self._path = path

    def begin(self, pin: str, card: str, left: int) -> None:
        """Write down that a PIN is about to be tried at a card. Raises PinError where it must not be.

        card  what tells it from others. left: attempts that it has.
        """
        before = self._load()
        if before.get("key") == _key(before.get("salt"), card, pin):
            # Without a word of how it ended (the power may have failed), the attempts that are left tell.
            is_refused = before.get("is_refused") or left < _number(before.get("left"))
            if is_refused:
                raise PinError("the SIM has refused this PIN before: it is not tried again", "correct pin_file")
        if left < LEAST_ATTEMPTS:
            raise PinError(
                f"the SIM leaves {left} attempts for its PIN: none is used",
                "enter it once in a telephone, which gives all attempts back",
            )
        salt = os.urandom(8).hex()
        self._keep({"salt": salt, "key": _key(salt, card, pin), "left": left, "is_refused": False})

    def refused(self) -> None:
        """The card did not take it."""
        self._keep({**self._load(), "is_refused": True})

    def accepted(self) -> None:
        """The card took it."""
        self._path.unlink(missing_ok=True)

    def _load(self) -> dict[str, object]:
        try:
            found = json.loads(self._path.read_bytes()[:MAX_FILE])
        except FileNotFoundError:
            return {}
        except (OSError, ValueError) as error:
            raise PinError(f"{self._path}: cannot be read: {error}", "remove it when the PIN is right") from error
        return found if isinstance(found, dict) else {}

    def _keep(self, record: dict[str, object]) -> None:
        new = self._path.with_suffix(".new")
        try:
            new.touch(mode=0o600)
            new.write_text(json.dumps(record))
            new.rename(self._path)
        except OSError as error:
            raise PinError(
                f"{self._path}: cannot be written: {error.strerror}; without it no PIN is tried",
                "give state_dir a folder that the station may write to",
            ) from error


def _key(salt: object, card: str, pin: str) -> str:
    """What is kept in place of the PIN. Whoever may read it may read pin_file as well."""
    return hashlib.sha256(f"{salt} {card} {pin}".encode()).hexdigest()


def _number(value: object) -> int:
    return value if isinstance(value, int) else 0
