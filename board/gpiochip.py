"""GPIO lines by libgpiod v2: lookup, request, and its errors as ours."""

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from board.description import LineDescription
from board.runtime.errors import InterfaceError

DEV = Path("/dev")

HINTS = {
    errno.EBUSY: "`gpioinfo` lists lines and their users",
    errno.EACCES: "add the user to the group gpio: `sudo adduser USER gpio`",
    errno.EPERM: "add the user to the group gpio: `sudo adduser USER gpio`",
    errno.EINVAL: "see `gpioinfo` for the offsets of the chip and its support of open drain",
}


def library() -> Any:
    """Import libgpiod v2 at its first use, which takes 49 ms. Raises InterfaceError if it is not installed."""
    try:
        import gpiod
        import gpiod.line
    except ImportError as error:
        hint = "`pip install gpiod`; the python3-libgpiod of Debian 12 is version 1 under the same name"
        raise InterfaceError(f"libgpiod version 2 is needed for GPIO lines: {error}", hint) from error
    return gpiod


def place(description: LineDescription, dev: Path = DEV) -> str:
    """Return the place of a line, for messages."""
    return description.line or f"{_named(description, dev)}, line {description.offset}"


def request(description: LineDescription, dev: Path, settings: Any, **more: Any) -> tuple[Any, int]:
    """Request exclusive use of a line; return gpiod's LineRequest, and the line's offset in its chip.

    settings  gpiod.LineSettings of the line.
    more      further arguments of Chip.request_lines().

    Raises InterfaceError if the line is absent, in use or not permitted.
    """
    with told(place(description, dev)), _opened(library(), description, dev) as (chip, offset):
        try:
            return chip.request_lines({offset: settings}, consumer="captain", **more), offset
        except OSError as error:
            if error.errno == errno.EBUSY:
                user = chip.get_line_info(offset).consumer or "an unnamed user"
                raise InterfaceError(f"{place(description, dev)}: in use by {user}", _busy_hint(user)) from error
            raise


@contextlib.contextmanager
def told(where: str) -> Iterator[None]:
    """Translate errors of gpiod. Raises InterfaceError, with the place and a remedy, for each of them."""
    try:
        yield
    except (OSError, ValueError) as error:
        text, hint = str(error), HINTS[errno.EINVAL]
        if isinstance(error, OSError):
            text = os.strerror(error.errno) if error.errno else text
            hint = HINTS.get(error.errno or 0, "`gpiodetect` lists chips, `gpioinfo` their lines")
        raise InterfaceError(f"{where}: {text}", hint) from error


def _busy_hint(user: str) -> str:
    """Return the remedy for a line in use. The driver pps-gpio is named `pps`, or `pps@12` by its device-tree node."""
    if user.startswith("pps"):
        return "the kernel's own driver stamps its edges: take /dev/pps0 instead"
    return HINTS[errno.EBUSY]


def _named(description: LineDescription, dev: Path) -> str:
    """Return the path of the GPIO chip that the description gives by name, path or label."""
    chip = description.chip
    return str(dev / chip) if chip.startswith(("/", "gpiochip")) else chip


@contextlib.contextmanager
def _opened(gpiod: Any, description: LineDescription, dev: Path) -> Iterator[tuple[Any, int]]:
    """Open the chip of the line; yield it with the line's offset, and close it afterwards."""
    named = _named(description, dev)
    if named.startswith("/"):
        with gpiod.Chip(named) as chip:
            yield chip, description.offset
        return
    # Numbers of chips change between boots. Links are skipped: Raspberry Pi OS links gpiochip4 to gpiochip0.
    for path in sorted(path for path in dev.glob("gpiochip*") if not path.is_symlink()):
        with gpiod.Chip(str(path)) as chip:
            offset = _offset_in(chip, description)
            if offset is not None:
                yield chip, offset
                return
    line = description.line
    what = f"no line of any GPIO chip is named {line}" if line else f"no GPIO chip is labelled {named}"
    raise InterfaceError(what, "`gpioinfo` lists chips with their labels, and the names of lines")


def _offset_in(chip: Any, description: LineDescription) -> int | None:
    """Return the offset of the described line in this chip; None if it is on another."""
    if description.chip:
        return description.offset if chip.get_info().label == description.chip else None
    try:
        return int(chip.line_offset_from_id(description.line))
    except (OSError, ValueError):
        return None
