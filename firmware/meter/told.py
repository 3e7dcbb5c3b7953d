"""What a station tells on 5558, as events; a peer's words, read without trust."""

from collections.abc import Mapping

from firmware.meter.event import Clock, Received, Sent, What
from firmware.user.untrusted import named, number, text, within


def sent(station: str, confirm: Mapping[str, object], boot: str, at_s: float) -> Sent | None:
    """Of a confirm; None where it does not say that something left, or not when."""
    accepted_ns = _exact(confirm, "accepted_ns", 0)
    if text(confirm, "outcome") != "sent" or not accepted_ns:
        return None
    queue_ns, send_ns = (round(number(confirm, key) * 1000) for key in ("queue_us", "send_us"))
    clock = clock_of(within(confirm, "quality"), boot)
    return Sent(station, text(confirm, "interface"), what(confirm), accepted_ns, queue_ns, send_ns, clock, at_s)


def received(station: str, indication: Mapping[str, object], boot: str, at_s: float) -> Received:
    return Received(
        station,
        text(indication, "interface"),
        what(indication),
        _exact(indication, "received_ns", 0),
        clock_of(within(indication, "quality"), boot),
        at_s,
        rssi_of(indication),
    )


def rssi_of(said: Mapping[str, object]) -> int | None:
    """Signal strength in dBm; None where nobody says it, or what none can be."""
    rssi_dbm = said.get("rssi_dbm")
    is_one = isinstance(rssi_dbm, int) and not isinstance(rssi_dbm, bool) and abs(rssi_dbm) < 1 << 15
    return rssi_dbm if is_one else None  # type: ignore[return-value]


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
    return Clock(boot, _exact(quality, "offset_ns", 0), _exact(quality, "uncertainty_ns", 0))


def interfaces(status: Mapping[str, object]) -> dict[str, str]:
    """Those of a status: name and technology."""
    return {name: text(one, "technology") for name, one in named(status, "interfaces")}


def _exact(said: Mapping[str, object], key: str, otherwise: int) -> int:
    """A number of ns: a float has not enough digits for Unix time."""
    found = said.get(key)
    is_one = isinstance(found, int) and not isinstance(found, bool) and abs(found) < 1 << 63
    return found if is_one else otherwise  # type: ignore[return-value]
