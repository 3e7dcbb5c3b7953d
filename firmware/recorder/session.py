"""A recording of frames from its begin to its end: by a count, a duration, a signal."""

import time
from collections.abc import Callable
from contextlib import suppress

from board.errors import StationError
from firmware.recorder.ending import Ending
from firmware.recorder.hearing import Hearing, say
from firmware.recorder.sinks import Keeper, Sink
from firmware.recorder.told import Told
from firmware.recorder.triggers import OPERATOR
from firmware.user import client
from firmware.user.listening import Wish


def record(
    place: client.Address,
    wish: Wish,
    make: Callable[[], Sink],
    name: str,
    note: Callable[[str], None] = say,
) -> int:
    """Frames of a station into what is made once it is there; returns the exit status.

    name  of where they go, in words.
    note  receives notes; losses and a station that falls silent go to standard error.

    The status is 1 where some could not be written. Raises StationError, and KeyboardInterrupt once all is written.
    """
    with client.session() as context, suppress(SystemExit), Ending() as ending:
        hearing = Hearing(context, place, note)
        sink = make()
        hearing.on_status, hearing.on_time = sink.know, sink.time
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
            raise StationError(f"no station was heard at {place.host}:{place.report}", client.START_ONE)
    return 1 if sink.scribe.lost > sink.scribe.missing else 0


def _is_wanted(wish: Wish, told: Told) -> bool:
    is_type = not wish.types or not wish.types.isdisjoint((told.type, told.said.get("message_id")))
    return is_type and (not wish.stations or told.said.get("station_id") in wish.stations)
