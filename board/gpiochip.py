"""Lines of GPIO chips by libgpiod v2: found by chip or by name, asked for, and its errors as ours."""

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from board.description import LineDescription
from board.errors import InterfaceError

DEV = Path("/dev")

HINTS = {
    errno.EBUSY: "`gpioinfo` lists lines and their users",
    errno.EACCES: "add the user to the group gpio: `sudo adduser USER gpio`",
    errno.EPERM: "add the user to the group gpio: `sudo adduser USER gpio`",
    errno.EINVAL: "`gpioinfo` shows what the chip has: offset, and whether it can do open drain",
}


def library() -> Any:
    """libgpiod v2: 49 ms that a station without lines saves. Raises InterfaceError where it is not."""
    try:
        import gpiod
        import gpiod.line
    except ImportError as error:
        hint = "`pip install gpiod`; the python3-libgpiod of Debian 12 is version 1 under the same name"
        raise InterfaceError(f"libgpiod version 2 is needed for GPIO lines: {error}", hint) from error
    return gpiod


def place(description: LineDescription, dev: Path = DEV) -> str:
    """Where a line is, for messages."""
    return description.line or f"{_named(description, dev)}, line {description.offset}"


def request(description: LineDescription, dev: Path, settings: Any, **more: Any) -> tuple[Any, int]:
    """Ask for a line: gpiod's LineRequest, ours alone until it is released, and the line's offset in its chip.

    settings  gpiod.LineSettings; more: for Chip.request_lines().
    Raises InterfaceError when the line is absent, taken or not permitted.
    """
    with told(place(description, dev)), _opened(library(), description, dev) as (chip, offset):
        try:
            return chip.request_lines({offset: settings}, consumer="captain", **more), offset
        except OSError as error:
            if error.errno == errno.EBUSY:
                user = chip.get_line_info(offset).consumer or "somebody unnamed"
                raise InterfaceError(f"{place(description, dev)}: in use by {user}", _busy_hint(user)) from error
            raise


@contextlib.contextmanager
def told(where: str) -> Iterator[None]:
    """Errors of gpiod as ours."""
    try:
        yield
    except (OSError, ValueError) as error:
        text, hint = str(error), HINTS[errno.EINVAL]
        if isinstance(error, OSError):
            text = os.strerror(error.errno) if error.errno else text
            hint = HINTS.get(error.errno or 0, "`gpiodetect` lists chips, `gpioinfo` their lines")
        raise InterfaceError(f"{where}: {text}", hint) from error


def _busy_hint(user: str) -> str:
    """pps-gpio calls itself `pps`, or `pps@12` after its node of the device tree."""
    if user.startswith("pps"):
        return "the kernel's own driver stamps its edges: take /dev/pps0 instead"
    return HINTS[errno.EBUSY]


def _named(description: LineDescription, dev: Path) -> str:
    """A chip that is given by name or path has a path; any other word is a label."""
    chip = description.chip
    return str(dev / chip) if chip.startswith(("/", "gpiochip")) else chip


@contextlib.contextmanager
def _opened(gpiod: Any, description: LineDescription, dev: Path) -> Iterator[tuple[Any, int]]:
    """The chip that has the line, and the line's offset in it; closed when the request is made."""
    named = _named(description, dev)
    if named.startswith("/"):
        with gpiod.Chip(named) as chip:
            yield chip, description.offset
        return
    # Numbers of chips change from boot to boot; a link to a chip (Raspberry Pi OS has gpiochip4 -> gpiochip0) is none.
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
    """Offset of the described line, where this chip has it."""
    if description.chip:
        return description.offset if chip.get_info().label == description.chip else None
    try:
        return int(chip.line_offset_from_id(description.line))
    except (OSError, ValueError):
        return None
