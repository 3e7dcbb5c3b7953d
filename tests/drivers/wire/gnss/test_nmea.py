"""NMEA sentences compared with pynmeagps, and fields that cannot be read."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pynmeagps import NMEAReader

from board.runtime.errors import ProtocolError
from drivers.wire.gnss.nmea import Clock, Gga, Gsa, Rmc, Sentence, Vtg, Zda, checksum, decode, encode

# From the interface description of a u-blox receiver, clause 2.7, and of other manufacturers' receivers.
GGA = "GNGGA,092725.00,4717.11399,N,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,"
RMC = "GPRMC,083559.00,A,4717.11437,N,00833.91522,E,0.004,77.52,091202,,,A,V"
GSA = "GNGSA,A,3,23,29,07,08,09,18,26,28,,,,,1.94,1.18,1.54,1"
VTG = "GPVTG,77.52,T,,M,0.004,N,0.008,K,A"
ZDA = "GPZDA,082710.00,16,09,2002,00,00"


def test_a_sentence_has_its_checksum_and_its_end():
    assert encode(RMC[:-2]).endswith(b"*57\r\n")
    assert checksum(GGA.encode()) == 0x45  # for GPGGA, the interface description has 5B
    assert encode(GGA) == b"$" + GGA.encode() + b"*45\r\n"


def test_a_position_is_read():
    assert decode(Sentence(GGA)) == Gga(Clock(9, 27, 25, 0), 472_852_332, 85_652_650, 1, 8, 1.01, 499_600, 48_000)


def test_time_position_and_motion_are_read():
    assert decode(Sentence(RMC)) == Rmc(Clock(8, 35, 59, 0), True, 472_852_395, 85_652_537, 2, 7_752_000, (2002, 12, 9))


def test_the_other_three_are_read():
    assert decode(Sentence(GSA)) == Gsa(3, 1.18)
    assert decode(Sentence(VTG)) == Vtg(7_752_000, 2)
    assert decode(Sentence(ZDA)) == Zda(Clock(8, 27, 10, 0), (2002, 9, 16))


def test_what_is_not_known_is_none():
    assert decode(Sentence("GPGGA,,,,,,0,00,99.99,,,,,,")) == Gga(None, None, None, 0, 0, 99.99, None, None)
    assert decode(Sentence("GPRMC,,V,,,,,,,,,,N")) == Rmc(None, False, None, None, None, None, None)
    assert decode(Sentence("GPZDA,,,,,00,00")) == Zda(None, None)


@pytest.mark.parametrize("talker", ["GP", "GL", "GA", "GB", "GN", "GQ", "GI", "IN"])
def test_any_talker_is_heard(talker):
    assert decode(Sentence(talker + RMC[2:])) == decode(Sentence(RMC))


def test_other_sentences_and_those_of_a_manufacturer_are_none():
    assert decode(Sentence("GPGSV,1,1,00")) is None
    assert decode(Sentence("PUBX,00")) is None
    assert decode(Sentence("PGRMC,A")) is None


@pytest.mark.parametrize(
    "body",
    [
        "GPGGA,092725.00,4717.11399,N",
        "GPGGA,252725.00,4717.11399,N,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,",
        "GPGGA,092725.00,9117.11399,N,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,",
        "GPGGA,092725.00,4760.11399,N,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,",
        "GPGGA,092725.00,4717.11399,X,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,",
        "GPGGA,092725.00,4717.11399,N,00833.91590,E,1,0x8,1.01,499.6,M,48.0,M,,",
        "GPGGA,092725.00,4717.11399,N,00833.91590,E,1,08,nan,499.6,M,48.0,M,,",
        "GPRMC,083559.00,A,4717.11437,N,00833.91522,E,1e9,77.52,091202,,,A,V",
        "GPRMC,083559.00,A,4717.11437,N,00833.91522,E,0.004,77.52,0912,,,A,V",
        "GPZDA,082710.00,16,09,20o2,00,00",
    ],
)
def test_fields_that_cannot_be_read_are_explained(body):
    with pytest.raises(ProtocolError):
        decode(Sentence(body))


clock = st.builds(Clock, st.integers(0, 23), st.integers(0, 59), st.integers(0, 59), st.just(0))


def minutes(angle, digits):
    degrees, rest = divmod(abs(angle), 10**7)
    whole, fraction = divmod(rest * 60, 10**7)
    return f"{degrees:0{digits}}{whole:02}.{fraction:07}"


@given(
    when=clock,
    latitude=st.integers(-900_000_000, 900_000_000),
    longitude=st.integers(-1_800_000_000, 1_800_000_000),
    quality=st.integers(0, 6),
    satellites=st.integers(0, 40),
    altitude=st.integers(-500_000, 9_000_000),
)
def test_positions_agree_with_pynmeagps(when, latitude, longitude, quality, satellites, altitude):
    body = (
        f"GNGGA,{when.hour:02}{when.minute:02}{when.second:02}.00,{minutes(latitude, 2)},{'NS'[latitude < 0]},"
        f"{minutes(longitude, 3)},{'EW'[longitude < 0]},{quality},{satellites:02},0.62,{altitude / 1000:.3f},M,46.6,M,,"
    )
    ours, theirs = decode(Sentence(body)), NMEAReader.parse(encode(body))
    assert isinstance(ours, Gga)
    assert (ours.latitude, ours.longitude) == (latitude, longitude)
    assert ours.latitude / 1e7 == pytest.approx(theirs.lat, abs=1e-7)
    assert ours.longitude / 1e7 == pytest.approx(theirs.lon, abs=1e-7)
    assert (ours.quality, ours.satellites, ours.altitude_mm) == (theirs.quality, theirs.numSV, round(theirs.alt * 1000))
    assert (ours.clock[:3]) == (theirs.time.hour, theirs.time.minute, theirs.time.second)


@given(
    speed=st.integers(0, 100_000), course=st.integers(0, 35_999), day=st.dates().filter(lambda day: day.year >= 2000)
)
def test_motion_and_date_agree_with_pynmeagps(speed, course, day):
    day = day.replace(year=2000 + day.year % 100, day=min(day.day, 28))
    body = (
        f"GNRMC,083559.00,A,4717.11437,N,00833.91522,E,{speed / 1000:.3f},{course / 100:.2f},"
        f"{day.day:02}{day.month:02}{day.year % 100:02},,,A,V"
    )
    ours, theirs = decode(Sentence(body)), NMEAReader.parse(encode(body))
    assert isinstance(ours, Rmc)
    assert ours.speed_mm_s == round(theirs.spd * 1852 / 3.6)
    assert ours.course == round(theirs.cog * 1e5)
    assert ours.date == (day.year, day.month, day.day)


@given(body=st.text(st.characters(min_codepoint=0x20, max_codepoint=0x7E, exclude_characters="$*"), max_size=90))
def test_any_sentence_is_read_or_explained(body):
    for address in ("", "GPGGA,", "GPRMC,", "GPGSA,", "GPVTG,", "GPZDA,"):
        try:
            decode(Sentence(address + body))
        except ProtocolError as error:
            assert str(error)


@given(
    fields=st.lists(st.sampled_from(["", "1", "-1", "A", "083559.00", "4717.1", "N", "E", "99", "091202"]), max_size=20)
)
def test_any_fields_are_read_or_explained(fields):
    for address in ("GPGGA", "GPRMC", "GPGSA", "GPVTG", "GPZDA"):
        try:
            decode(Sentence(",".join([address, *fields])))
        except ProtocolError as error:
            assert str(error)
