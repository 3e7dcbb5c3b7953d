"""Recording of frames until a count, a duration or a signal."""

import time
from collections.abc import Callable
from contextlib import suppress

from board.runtime.errors import StationError
from firmware.client import client
from firmware.client.listening import ListenFilter
from firmware.recorder.ending import Ending
from firmware.recorder.hearing import Hearing, say
from firmware.recorder.reported_frame import ReportedFrame
from firmware.recorder.sinks import Keeper, Sink
from firmware.recorder.triggers import OPERATOR


def record(
    place: client.Address,
    wish: ListenFilter,
    make: Callable[[], Sink],
    name: str,
    note: Callable[[str], None] = say,
) -> int:
    """Record frames of a station to the sink that `make` opens; return the exit status.

    name  name of the sink in messages.
    note  prints notes; losses and a silent station are always reported on standard error.

    The exit status is 1 if frames could not be written. Raises StationError if no station is heard, and
    KeyboardInterrupt after Ctrl-C, once all frames are written.
    """
    with client.session() as context, suppress(SystemExit), Ending() as ending:
        hearing = Hearing(context, place, note)
        sink = make()
        hearing.sink = sink
        end = time.monotonic() + wish.for_s if wish.for_s is not None else None

        def goes_on() -> bool:
            ending.check()
            if ending.is_asked() and isinstance(sink, Keeper):
                sink.trigger(OPERATOR)
            if hearing.is_known:
                sink.idle()
            return end is None or time.monotonic() < end

        try:
            for told in hearing.frames(goes_on):
                if not _is_wanted(wish, told):
                    sink.scribe.pass_over(told)
                    continue
                sink.add(told)
                ending.check()
                if sink.scribe.frames == wish.most:
                    break
        finally:
            sink.close()
            tell = say if sink.scribe.lost else note
            tell(f"{name}: {sink.scribe.frames} frames, {sink.scribe.lost} lost")
        if not hearing.is_heard:
            raise StationError(f"{place.host}:{place.report}: no station was heard", client.START_ONE)
    return 1 if sink.scribe.lost > sink.scribe.missing else 0


def _is_wanted(wish: ListenFilter, told: ReportedFrame) -> bool:
    is_type = not wish.types or not wish.types.isdisjoint((told.type, told.said.get("message_id")))
    return is_type and (not wish.stations or told.said.get("station_id") in wish.stations)
