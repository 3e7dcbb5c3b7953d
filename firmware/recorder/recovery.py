"""Counts of a recorder that was killed: its last word to the station, and the files that it left."""

from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from board.errors import StationError
from firmware.codec import capture
from firmware.recorder.ring import NAME, Ring

Counts = Mapping[str, int]


class State(NamedTuple):
    """A recorder's counts, all by interface, at a moment.

    number   of the first file whose frames are not in stored.
    stored   frames in files that are whole.
    written  frames that were given to a file; some may wait for it.
    gone     known to be lost. missing, killed: of these, as Scribe has it.
    reached  `total` of the last frame that is in either count.
    """

    number: int
    stored: Counts
    written: Counts
    gone: Counts
    missing: int
    killed: int
    reached: Counts


def state_of(ring: Ring) -> State | None:
    """None until it is known which files of the folder are this station's."""
    scribe, filing = ring.filing.scribe, ring.filing
    if not ring.is_known:
        return None
    return State(
        ring.number if filing.path else ring.number + 1,
        dict(scribe.written - filing.in_file),
        dict(scribe.written),
        dict(scribe.gone),
        scribe.missing,
        scribe.killed,
        dict(scribe.reached),
    )


def restore(ring: Ring, told: Mapping[str, Any]) -> None:
    """Go on with the counts that a process told the station last, before it was killed.

    A frame in its files is written, whatever it told of that; each other one up to the last that is known is lost.
    """
    state, scribe = State(**told), ring.filing.scribe
    files = _left(ring.folder, state.number)
    ring.go_on(max([state.number - 1, *files]))
    written = Counter(state.stored)
    reached = Counter(state.reached)
    for path in files.values():
        for frame in _frames(path):
            written[frame.interface] += 1
            total = frame.said.get("total")
            if isinstance(total, int):
                reached[frame.interface] = max(total, reached[frame.interface])
    scribe.missing, scribe.killed = state.missing, state.killed
    scribe.restore(written, state.gone, reached)
    for name, total in reached.items():
        gone = state.gone.get(name, 0)
        given = state.written.get(name, 0) + gone + total - state.reached.get(name, 0)
        scribe.lose(name, max(0, given - written[name] - gone))


def _left(folder: Path, number: int) -> dict[int, Path]:
    """Files of a folder from a number on."""
    with suppress(OSError):
        found = ((path, NAME.fullmatch(path.name)) for path in folder.iterdir())
        return {int(match[2]): path for path, match in found if match and int(match[2]) >= number}
    return {}


def _frames(path: Path) -> Iterator[capture.Frame]:
    """Whole frames of a file, whose last block may be cut off."""
    with suppress(OSError, StationError), path.open("rb") as stream:
        yield from capture.frames(stream.read(len(capture.PCAPNG)), stream)
