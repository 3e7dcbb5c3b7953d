"""Description of a handler: each message type has one in its own file."""

from typing import Literal, NamedTuple

Clock = Literal["delta", "its", "none"]


class Kind(NamedTuple):
    """A message type with its ROS topics. Paths are those of a reader of the message library.

    name       name of the handler, used in topics and parameters.
    editions   editions of the message library that it supports; the first is the default.
    position   pairs of paths (latitude, longitude; 1e-7 degree). The first pair that the edition has is read.
    generated  paths of the message's time. The first that the edition has is read.
    clock      format of that time: `delta` is milliseconds of ITS time modulo 65536 (GenerationDeltaTime), `its` is
               milliseconds of ITS time (TimestampIts).
    key        paths of the identifier of an event, intersection or sign. A newer message of a station with the same
               identifier replaces the older. Empty: any newer message of the station does.
    is_usual   True if the parameter `handlers` contains it by default.
    """

    name: str
    editions: tuple[str, ...]
    position: tuple[tuple[str, str], ...] = ()
    generated: tuple[str, ...] = ()
    clock: Clock = "none"
    key: tuple[str, ...] = ()
    is_usual: bool = True


def place(path: str) -> tuple[str, str]:
    """Return the paths of latitude and longitude in a ReferencePosition."""
    return f"{path}.latitude", f"{path}.longitude"
