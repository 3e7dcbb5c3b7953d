"""Counts of a killed recorder: restored from its last report and its files."""

from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from board.runtime.errors import StationError
from firmware.recorder.ring import NAME, Ring
from firmware.recordings import capture

Counts = Mapping[str, int]


class RecorderCounts(NamedTuple):
    """Counts of a recorder at one moment; those in mappings are by interface.

    number   number of the first file whose frames are not counted in stored.
    stored   frames in completed files.
    written  frames given to a file, including buffered ones.
    gone     lost frames.
    missing  part of gone that was lost between station and recorder.
    killed   part of gone that was lost with an earlier process.
    reached  the station's `total` of the last frame that is counted as written or lost.
    """

    number: int
    stored: Counts
    written: Counts
    gone: Counts
    missing: int
    killed: int
    reached: Counts


def state_of(ring: Ring) -> RecorderCounts | None:
    """Return the present counts of a ring; None until it has read its folder."""
    scribe, filing = ring.filing.scribe, ring.filing
    if not ring.is_known:
        return None
    return RecorderCounts(
        ring.number if filing.path else ring.number + 1,
        dict(scribe.written - filing.in_file),
        dict(scribe.written),
        dict(scribe.gone),
        scribe.missing,
        scribe.killed,
        dict(scribe.reached),
    )


def restore(ring: Ring, told: Mapping[str, Any]) -> None:
    """Continue from the last counts that a recorder reported before it was killed.

    told  RecorderCounts as a mapping.

    A frame found in the files counts as written, whatever the report says. All other frames up to the last known one
    count as lost.
    """
    state, scribe = RecorderCounts(**told), ring.filing.scribe
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
        scribe.count_lost(name, max(0, given - written[name] - gone))


def _left(folder: Path, number: int) -> dict[int, Path]:
    """Return the recordings of a folder from a number on, by number; empty if the folder cannot be read."""
    with suppress(OSError):
        found = ((path, NAME.fullmatch(path.name)) for path in folder.iterdir())
        return {int(match[2]): path for path, match in found if match and int(match[2]) >= number}
    return {}


def _frames(path: Path) -> Iterator[capture.Frame]:
    """Yield the complete frames of a file, up to a truncated block."""
    with suppress(OSError, StationError), path.open("rb") as stream:
        yield from capture.frames(stream.read(len(capture.PCAPNG)), stream)
