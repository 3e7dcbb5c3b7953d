"""Events as stations would tell them, with one clock for both ends unless said otherwise."""

from firmware.meter.event import Clock, ReceivedEvent, Sent, What

ONE_CLOCK = Clock("boot")
START_NS = 1_795_182_426_000_000_000


def what(name: object, kind: str = "cam", station_id: int = 1337) -> What:
    return What(str(name), kind, station_id, 41)


def sent(name: object, at_s: float, *, clock: Clock = ONE_CLOCK, heard_s: float | None = None, by: str = "air") -> Sent:
    """Handed over and gone in the moment at_s."""
    heard = at_s if heard_s is None else heard_s
    return Sent("A", by, what(name), START_NS + round(at_s * 1e9), 0, 0, clock, heard)


def received(
    name: object, at_s: float, *, clock: Clock = ONE_CLOCK, heard_s: float | None = None, by: str = "air"
) -> ReceivedEvent:
    heard = at_s if heard_s is None else heard_s
    return ReceivedEvent("B", by, what(name), START_NS + round(at_s * 1e9), clock, heard, -70)
