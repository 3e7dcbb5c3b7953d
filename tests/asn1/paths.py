"""The paths of a decoded message, as Message.reader takes them."""

from collections.abc import Iterator
from typing import Any


def paths(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Every path of what decode gives, with the value there; what no edition knows has no path."""
    if path:
        yield path, value
    match value:
        case dict():
            for name, inner in value.items():
                if not name.startswith("["):
                    yield from paths(inner, f"{path}.{name}" if path else name)
        case list():
            for index, inner in enumerate(value):
                yield from paths(inner, f"{path}[{index}]")
        case (str(name), inner) if not name.startswith("["):
            yield from paths(inner, f"{path}.{name}")


def is_readable(message: Any, path: str) -> bool:
    """Whether a path leads through no open type, at which the paths of a reader end."""
    try:
        message.reader(path)
    except ValueError as error:
        assert "open type has no" in str(error)
        return False
    return True
