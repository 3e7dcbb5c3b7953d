"""What a handler is made of: one object for each type of message, in a file of its own."""

from typing import Literal, NamedTuple

Clock = Literal["delta", "its", "none"]


class Kind(NamedTuple):
    """A type of message as ROS topics know it. Paths are those of a reader of the message library.

    name       of the handler, of its topics and of its parameters.
    editions   that it may speak, the default first: names of the message library.
    position   pairs of paths: latitude, longitude in 1e-7 degree; the first pair that the edition has is read.
    generated  paths of the time of the message; likewise.
    clock      how that time counts: `delta` is milliseconds of ITS time modulo 65536 (GenerationDeltaTime), `its` is
               all of them (TimestampIts).
    key        paths of what makes two messages one and the same thing, of which the newer replaces the older: an event,
               an intersection; without, it is whose message it is.
    is_usual   whether it is there unless the parameter `handlers` says otherwise.
    """

    name: str
    editions: tuple[str, ...]
    position: tuple[tuple[str, str], ...] = ()
    generated: tuple[str, ...] = ()
    clock: Clock = "none"
    key: tuple[str, ...] = ()
    is_usual: bool = True


def place(path: str) -> tuple[str, str]:
    """Both paths of a ReferencePosition."""
    return f"{path}.latitude", f"{path}.longitude"
