"""Which received messages pass: by station, place and age."""

import pytest

from firmware.gateway.captain_gateway.captain_gateway import filters
from firmware.gateway.captain_gateway.captain_gateway.codec import Edition
from firmware.gateway.captain_gateway.captain_gateway.handlers import KINDS
from firmware.gateway.captain_gateway.captain_gateway.settings import HANDLER, receive
from tests.firmware.gateway.library import Library
from tests.firmware.gateway.real import CAM, DENM, MAPEM, real

DEFAULTS = {name: option.default for name, option in HANDLER.items()}
STATION = int.from_bytes(CAM[2:6], "big")
NOWHERE = real("cam", 41)  # latitude and longitude are unavailable
HERE = (53.5626518, 9.9761485)  # as the CAM has it


def edition(name: str) -> Edition:
    return Edition(Library(), KINDS[name].editions[0], "etsi_its", KINDS[name])


def refused(pdu: bytes, name: str, own=None, **chosen: object) -> str | None:
    settings = receive(DEFAULTS | {f"receive.{key}": value for key, value in chosen.items()})
    return filters.refusal(pdu, edition(name), settings, own)


def test_everything_passes_by_default():
    assert refused(CAM, "cam") is None


def test_stations_are_chosen_and_left_out():
    assert refused(CAM, "cam", stations=[STATION]) is None
    assert refused(CAM, "cam", stations=[1]) == "station"
    assert refused(CAM, "cam", not_stations=[STATION]) == "station"
    assert refused(CAM, "cam", stations=[STATION], not_stations=[STATION]) == "station"


def test_the_area_is_a_circle_around_a_place():
    assert refused(CAM, "cam", area=[*HERE, 10.0]) is None
    assert refused(CAM, "cam", area=[HERE[0] + 0.01, HERE[1], 1000.0]) == "area"
    assert refused(CAM, "cam", area=[HERE[0] + 0.01, HERE[1], 1200.0]) is None


def test_the_area_is_a_circle_around_own_position():
    assert refused(CAM, "cam", own=HERE, area=[10.0]) is None
    assert refused(CAM, "cam", own=(48.0, 11.0), area=[10.0]) == "area"


def test_a_message_passes_where_nobody_knows_where_it_or_the_station_is():
    assert refused(CAM, "cam", own=None, area=[10.0]) is None
    assert refused(NOWHERE, "cam", own=HERE, area=[10.0]) is None


def test_an_event_has_a_place_too():
    assert refused(DENM, "denm", area=[53.5506976, 9.9360788, 1.0]) is None
    assert refused(DENM, "denm", area=[0.0, 0.0, 1.0]) == "area"


@pytest.mark.parametrize(("later_ms", "expected"), [(0, 0.0), (1500, 1.5), (32767, 32.767), (-2000, -2.0)])
def test_the_age_of_a_cam_is_known_within_half_a_turn_of_its_time(later_ms, expected):
    generated = 51136  # of the CAM; the turn is any
    assert filters.age(CAM, edition("cam"), "delta", 65536 * 9_000_000 + generated + later_ms) == expected


def test_the_age_of_an_event_is_by_its_whole_time():
    assert filters.age(DENM, edition("denm"), "its", 585913223347 + 90_000) == 90.0


def test_only_what_is_older_than_the_limit_is_old():
    now = 65536 * 9_000_000 + 51136
    assert not filters.is_old(CAM, edition("cam"), "delta", 1.0, now + 1000)
    assert filters.is_old(CAM, edition("cam"), "delta", 1.0, now + 1001)
    assert not filters.is_old(CAM, edition("cam"), "delta", 1.0, now - 5000)


def test_what_does_not_say_its_time_is_never_old():
    assert filters.age(MAPEM, edition("mapem"), "none", 0) is None


def test_a_message_that_does_not_decode_is_an_error_and_not_a_filter():
    with pytest.raises(ValueError, match=r"truncated|end"):
        refused(CAM[:20], "cam", own=HERE, area=[10.0])


def test_its_time_matches_the_example_of_the_standard():
    # TS 102 894-2, TimestampIts: 2007-01-01T00:00:00Z is 94 694 401 000 ms
    assert filters.its_ms(1_167_609_600, 1) == 94_694_401_000


def test_a_distance_is_that_of_a_map():
    # A minute of latitude is a nautical mile.
    assert filters.distance_m((0.0, 0.0), (1 / 60, 0.0)) == pytest.approx(1852, rel=2e-3)
    assert filters.distance_m((90.0, 0.0), (90.0, 77.0)) == pytest.approx(0.0, abs=1e-6)
