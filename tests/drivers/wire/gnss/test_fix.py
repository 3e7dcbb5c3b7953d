"""Fixes of epochs: fields, impossible positions, combination of sentences."""

import pytest

from board.time.scales import Carrier, FixKind
from drivers.sim.receiver import messages as says
from drivers.sim.receiver.messages import Moment, Sky
from drivers.sim.track import Track
from drivers.wire.gnss import nmea
from drivers.wire.gnss.fix import Jumps, distance, fix_of
from drivers.wire.gnss.nmea_epochs import NmeaEpochs
from drivers.wire.gnss.stream import GnssStream
from drivers.wire.gnss.time import Leap

GPS_S = says.gps_of(2026, 6, 1, 8, 0, 0)
UTC_NS = 1_780_300_800 * 10**9


def moment(seconds=0.0, kind=FixKind.FULL, carrier=Carrier.FIXED, is_resolved=True, sky=None):
    gps_ms = GPS_S * 1000 + round(seconds * 1000)
    return Moment(gps_ms, Leap(18), is_resolved, 18, kind, carrier, 3, Track().at(seconds), sky or Sky(), 60_000, 2_000)


def test_an_epoch_becomes_a_fix():
    fix = fix_of(says.nav_pvt(moment(1.0)), 5.0)
    motion = Track().at(1.0)
    assert (fix.monotonic, fix.kind, fix.carrier) == (5.0, FixKind.FULL, Carrier.FIXED)
    assert (fix.latitude, fix.longitude, fix.altitude) == motion[:3]
    assert (fix.speed, fix.heading, fix.horizontal) == (13_900, motion.heading, 14)
    assert (fix.utc_ns, fix.utc_accuracy_ns) == (UTC_NS + 10**9 - 412, 22)
    assert fix.tow_ms == (GPS_S + 1) % 604_800 * 1000


def test_before_leap_seconds_are_known_a_fix_has_no_utc_but_a_time_of_week():
    fix = fix_of(says.nav_pvt(moment(is_resolved=False)), 0.0)
    assert fix.tow_ms == GPS_S % 604_800 * 1000
    assert (fix.utc_ns, fix.utc_accuracy_ns) == (None, None)
    assert fix.latitude is not None


@pytest.mark.parametrize(
    ("fields", "kind"),
    [
        ({"fix_type": 0}, FixKind.NONE),
        ({"flags": 0}, FixKind.NONE),
        ({"flags3": 1}, FixKind.NONE),
        ({"fix_type": 5}, FixKind.TIME_ONLY),
        ({"fix_type": 9}, FixKind.NONE),
    ],
)
def test_what_is_outside_the_receivers_own_limits_has_no_position_but_a_time(fields, kind):
    fix = fix_of(says.nav_pvt(moment())._replace(**fields), 0.0)
    assert (fix.kind, fix.latitude, fix.speed, fix.carrier) == (kind, None, None, Carrier.NONE)
    assert (fix.utc_ns, fix.tow_ms) == (UTC_NS - 412, GPS_S % 604_800 * 1000)


@pytest.mark.parametrize("fields", [{"valid": 0}, {"valid": 1}, {"itow_ms": 604_800_000}, {"itow_ms": 0xFFFF_FFFF}])
def test_a_time_of_week_with_any_doubt_is_none(fields):
    assert fix_of(says.nav_pvt(moment())._replace(**fields), 0.0).tow_ms is None


def test_a_flat_fix_has_no_altitude():
    fix = fix_of(says.nav_pvt(moment())._replace(fix_type=2), 0.0)
    assert (fix.kind, fix.altitude, fix.vertical) == (FixKind.FLAT, None, None)


def at(latitude, longitude=114_320_680, monotonic=0.0):
    return fix_of(says.nav_pvt(moment()), monotonic)._replace(latitude=latitude, longitude=longitude)


def test_distances_are_those_on_the_ground():
    assert distance(at(488_000_000), at(489_000_000)) == pytest.approx(11_132, rel=0.01)
    assert distance(at(0, 1_799_000_000), at(0, -1_799_000_000)) == pytest.approx(22_264, rel=0.01)
    assert distance(at(600_000_000, 0), at(600_000_000, 10_000_000)) == pytest.approx(55_660, rel=0.01)


def test_a_drive_is_believed():
    jumps, track = Jumps(), Track(speed_m_s=60.0)
    for second in range(30):
        motion = track.at(second)
        assert jumps.is_believed(at(motion.latitude, motion.longitude, second))
    assert jumps.count == 0


def test_a_jump_of_100_km_is_not_believed_before_five_epochs_agree():
    jumps = Jumps()
    assert jumps.is_believed(at(488_000_000))
    believed = [jumps.is_believed(at(497_000_000, monotonic=1.0 + epoch)) for epoch in range(6)]
    assert believed == [False, False, False, False, True, True]
    assert jumps.count == 1
    assert jumps.metres == pytest.approx(100_188, rel=0.01)


def test_a_receiver_that_jumps_about_is_never_believed_and_its_return_is_at_once():
    jumps = Jumps()
    assert jumps.is_believed(at(488_000_000))
    for epoch in range(20):
        assert not jumps.is_believed(at(500_000_000 + epoch * 10_000_000, monotonic=0.2 * epoch))
    assert jumps.count == 20
    assert jumps.is_believed(at(488_000_100, monotonic=5.0))


def test_what_was_driven_in_a_tunnel_is_no_jump():
    jumps = Jumps()
    assert jumps.is_believed(at(488_000_000, monotonic=0.0))
    assert jumps.is_believed(at(488_500_000, monotonic=120.0))  # 5.6 km


def fixes(octets, epochs=None):
    epochs = epochs or NmeaEpochs()
    found = []
    for event in GnssStream().receive(octets, 0.0):
        assert isinstance(event, nmea.Sentence)
        message = nmea.decode(event)
        if message is not None and (fix := epochs.take(message, 7.0)) is not None:
            found.append(fix)
    return found


def said(names, *seconds, **state):
    return b"".join(says.sentences(moment(second, **state))[name] for second in seconds for name in names)


def test_sentences_of_one_moment_become_one_fix():
    (fix,) = fixes(said(("GSA", "VTG", "GGA", "RMC", "ZDA"), 1.0))
    motion = Track().at(1.0)
    assert (fix.monotonic, fix.kind, fix.carrier, fix.satellites) == (7.0, FixKind.FULL, Carrier.FIXED, 28)
    assert (fix.latitude, fix.longitude, fix.altitude) == motion[:3]
    assert abs(fix.speed - motion.speed_mm_s) <= 1
    assert abs(fix.heading - motion.heading) <= 1000
    assert (fix.horizontal, fix.utc_ns) == (12, UTC_NS + 10**9)


@pytest.mark.parametrize(
    ("quality", "hdop", "horizontal"),
    [
        (1, "1.2", 6000),
        (2, "1.2", 1800),
        (4, "0.8", 16),
        (5, "0.8", 400),
        (1, "99.99", None),
        (1, "0", None),
        (1, "", None),
        (6, "1.2", None),
        (8, "1.2", None),
    ],
)
def test_how_exact_a_position_is_is_estimated_from_its_quality_and_dilution(quality, hdop, horizontal):
    body = f"GPGGA,092725.00,4846.01170,N,01125.92330,E,{quality},08,{hdop},376.2,M,48.0,M,,"
    epochs = NmeaEpochs()
    found = fixes(nmea.encode(body) + nmea.encode(body.replace("25.00", "26.00")), epochs)
    assert found[-1].horizontal == horizontal


def test_the_dilution_may_stand_in_gsa_alone():
    gsa = nmea.encode("GNGSA,A,3,05,12,,,,,,,,,,,1.94,1.50,1.00")
    found = fixes(gsa + said(("RMC",), 1.0, 2.0))
    assert found[-1].horizontal == 7500


@pytest.mark.parametrize("names", [("GGA", "RMC"), ("RMC", "GGA"), ("RMC", "GSA", "GGA", "ZDA")])
def test_each_moment_gives_one_fix_in_whatever_order_its_sentences_come(names):
    found = fixes(said(names, 1.0, 2.0, 3.0))
    assert [fix.utc_ns for fix in found] == [UTC_NS + second * 10**9 for second in (1, 2, 3)]


@pytest.mark.parametrize("names", [("RMC",), ("GGA",), ("GGA", "ZDA")])
def test_a_receiver_that_sends_one_sentence_alone_is_understood_from_its_second_moment_on(names):
    found = fixes(said(names, 1.0, 2.0, 3.0))
    assert [fix.latitude for fix in found] == [Track().at(2.0).latitude, Track().at(3.0).latitude]


def test_without_a_fix_there_is_no_position_and_no_utc():
    (fix,) = fixes(said(("GGA", "RMC"), 1.0, kind=FixKind.NONE, carrier=Carrier.NONE))
    assert (fix.kind, fix.latitude, fix.utc_ns) == (FixKind.NONE, None, None)


def test_the_quality_says_what_the_carrier_phase_was_good_for():
    found = [fixes(said(("GGA", "RMC"), 1.0, carrier=carrier))[0].carrier for carrier in Carrier]
    assert found == list(Carrier)


def test_southern_and_western_positions_keep_their_signs():
    body = "GPGGA,092725.00,3351.50000,S,15112.25000,W,1,08,1.01,-5.6,M,48.0,M,,"
    rmc = "GPRMC,092725.00,A,3351.50000,S,15112.25000,W,,,091226,,,A"
    (fix,) = fixes(nmea.encode(body) + nmea.encode(rmc))
    assert (fix.latitude, fix.longitude, fix.altitude) == (-338_583_333, -1_512_041_667, 42_400)
    assert (fix.speed, fix.heading) == (None, None)


def test_a_leap_second_is_a_second_of_its_own():
    bodies = [f"GPRMC,2359{second}.00,A,4717.1,N,00833.9,E,,,311216,,,A" for second in (58, 59, 60)]
    found = fixes(b"".join(map(nmea.encode, bodies)))
    assert [fix.utc_ns // 10**9 % 60 for fix in found] == [59, 59]
