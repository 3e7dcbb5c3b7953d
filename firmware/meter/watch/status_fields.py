"""Fields of reports on port 5558 as events, validated."""

from collections.abc import Mapping

from drivers.message import Position
from firmware.meter.event import Clock, ReceivedEvent, Sent, What
from firmware.untrusted import named, number, text, within


def sent(station: str, confirm: Mapping[str, object], boot: str, at_s: float) -> Sent | None:
    """Return the event of a confirm; None if it does not report that a message was sent, and when."""
    accepted_ns = _exact(confirm, "accepted_ns")
    if text(confirm, "outcome") != "sent" or not accepted_ns:
        return None
    queue_ns, send_ns = (round(number(confirm, key) * 1000) for key in ("queue_us", "send_us"))
    clock = clock_of(within(confirm, "quality"), boot)
    return Sent(station, text(confirm, "interface"), what(confirm), accepted_ns, queue_ns, send_ns, clock, at_s)


def received(station: str, indication: Mapping[str, object], boot: str, at_s: float) -> ReceivedEvent:
    return ReceivedEvent(
        station,
        text(indication, "interface"),
        what(indication),
        _exact(indication, "received_ns"),
        clock_of(within(indication, "quality"), boot),
        at_s,
        rssi_of(indication),
    )


def rssi_of(said: Mapping[str, object]) -> int | None:
    """Return a signal strength in dBm; None if it is missing or invalid."""
    return _whole(said, "rssi_dbm", 1 << 15)


def what(said: Mapping[str, object]) -> What:
    station_id = said.get("station_id")
    return What(
        text(said, "digest"),
        text(said, "type"),
        station_id if isinstance(station_id, int) and abs(station_id) < 1 << 63 else None,
        round(number(said, "octets")),
    )


def clock_of(quality: Mapping[str, object], boot: str) -> Clock:
    if quality.get("offset_ns") is None or quality.get("uncertainty_ns") is None:
        return Clock(boot)
    return Clock(boot, _exact(quality, "offset_ns"), _exact(quality, "uncertainty_ns"))


def interfaces(status: Mapping[str, object]) -> dict[str, str]:
    """Return the technology of each interface in a status."""
    return {name: text(one, "technology") for name, one in named(status, "interfaces")}


def position_of(status: Mapping[str, object]) -> Position | None:
    """Return the station's position in a status; None if it is unknown."""
    here = within(status, "position")
    if not text(here, "source"):
        return None
    return Position(*(round(number(here, key) * 1e7) for key in ("latitude", "longitude")))


def _exact(said: Mapping[str, object], key: str) -> int:
    """Return a number of ns, 0 if it is missing. A float would not have enough digits for Unix time."""
    return _whole(said, key, 1 << 63) or 0


def _whole(said: Mapping[str, object], key: str, bound: int) -> int | None:
    """Return an integer whose magnitude is below a bound; None for any other value."""
    found = said.get(key)
    if isinstance(found, bool) or not isinstance(found, int) or abs(found) >= bound:
        return None
    return found
