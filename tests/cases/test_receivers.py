"""NMEA of public reports: each line is used with its right values, or refused with its reason."""

from contextlib import closing
from pathlib import Path

import pytest

from board.runtime.errors import ProtocolError
from board.time.scales import FixKind
from drivers.reason import Reason
from drivers.sim.receiver.habits import Habits
from drivers.wire.garbage import Garbage
from drivers.wire.gnss import nmea
from drivers.wire.gnss.nmea import Clock, Gga, Rmc, Sentence, Vtg
from drivers.wire.gnss.stream import GnssStream
from tests.drivers.gnss.receiver import Bench
from tests.ptys import PtyLoop, Ptys

CASES = Path(__file__).parent
LF_ONLY = (CASES / "nmea-lf-only.nmea").read_bytes()
ODD = (CASES / "nmea-odd.nmea").read_bytes()
NORTH, EAST = 481_000_000, 115_000_000  # 4806.0000,N and 01130.0000,E
# A receiver that says 2011 today is one whose weeks have rolled over once (1024 weeks; IS-GPS-200N, 20.3.3.3.1.1).
LF_UTC = 1_306_574_870 + 1024 * 604_800  # 2011-05-28T09:27:50Z
GGA = b"$GNGGA,094503.00,4846.01170,N,01125.92330,E,4,18,0.62,376.2,M,46.6,M,1.0,0000"


@pytest.fixture
def bench(monkeypatch):
    """A receiver of NMEA, which says only what the test has it say, and its interface at the other end of a pty."""
    with closing(PtyLoop(Ptys(monkeypatch), 0.0)) as loop:
        one = Bench(loop, Habits(speaks_ubx=False), kind="nmea").start()
        one.receiver.is_mute = True
        yield one
        one.close()


def said(octets):
    """What a stream makes of octets, and of what has stood in it for too long."""
    stream = GnssStream()
    found = stream.receive(octets, 0.0)
    while (deadline := stream.deadline()) is not None:
        found += stream.expire(deadline)
    return found


def reading(line):
    """The values of a line, or why it is refused."""
    (event,) = [*said(line + nmea.encode("PUBX,00"))][:-1]
    if isinstance(event, Garbage):
        return event.reason
    try:
        return nmea.decode(event)
    except ProtocolError as error:
        return str(error)


def test_sentences_that_end_with_lf_alone_are_read():
    gga, rmc = (nmea.decode(event) for event in said(LF_ONLY))
    assert gga == Gga(Clock(9, 27, 50, 0), NORTH, EAST, 1, 8, 1.03, 561_700, 47_200)
    # 0.02 knots are 10 mm/s.
    assert rmc == Rmc(Clock(9, 27, 50, 0), True, NORTH, EAST, 10, 3_166_000, (2011, 5, 28))


@pytest.mark.parametrize("end", [b"\r\n", b"\n", b"\r\r\n"])
@pytest.mark.parametrize("digits", [b"5b", b"5B"])
def test_a_checksum_in_lower_case_is_read_with_any_end_of_line(end, digits):
    body = b"GPGGA,092725.00,4717.11399,N,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,"
    octets = b"$" + body + b"*" + digits + end
    assert said(octets) == [Sentence(body.decode())]
    stream = GnssStream()
    assert [event for octet in octets for event in stream.receive(bytes([octet]), 0.0)] == said(octets)


def test_a_wrong_checksum_in_lower_case_is_refused():
    assert reading(GGA + b"*5b\n") == Reason.CHECKSUM


ODD_READ = [
    Reason.FRAMING,  # one digit of checksum
    Gga(Clock(11, 41, 30, 0), NORTH, EAST, 1, 4, 5.6, 1_500_000, 34_500),
    Reason.FRAMING,  # RMC without checksum and end; the VTG behind it is below
    "GPRMC with 4 fields: it has 9",
    "GPGGA with 8 fields: it has 11",
    "GPRMC: invalid angle: '0.000' 'N'",
    Gga(None, None, None, 0, None, None, None, None),
    Rmc(None, False, None, None, None, None, None),
    Rmc(Clock(13, 27, 34, 0), True, NORTH, EAST, 0, 0, (2020, 4, 20)),
    Gga(Clock(13, 27, 34, 0), NORTH, EAST, 2, 10, 0.8, 540_300, 47_100),
    Reason.CHECKSUM,  # `p9` was `09`
]


@pytest.mark.parametrize("number", range(len(ODD_READ)))
def test_each_odd_line_is_read_right_or_refused_with_its_reason(number):
    line = ODD.splitlines(keepends=True)[number]
    if number == 2:
        broken, line = line[: line.rindex(b"$")], line[line.rindex(b"$") :]
        assert reading(line) == Vtg(None, 62)  # 0.222 km/h
        line = broken
    assert reading(line) == ODD_READ[number]


def test_an_interface_whose_receiver_ends_lines_with_lf_alone_is_up_and_has_its_position(bench):
    bench.receiver.say(LF_ONLY)
    bench.loop.run_until(lambda: bench.host.fixes)
    fix = bench.host.fixes[-1]
    assert (fix.kind, fix.latitude, fix.longitude, fix.altitude) == (FixKind.FULL, NORTH, EAST, 608_900)
    assert (fix.speed, fix.heading, fix.satellites, fix.horizontal) == (10, 3_166_000, 8, 5150)
    assert fix.utc_ns == LF_UTC * 10**9
    assert bench.host.is_up
    assert bench.host.drops == {}


def test_an_interface_tells_of_each_odd_line_why_it_is_refused(bench):
    bench.receiver.say(ODD + LF_ONLY)
    bench.loop.run_until(lambda: bench.host.fixes and bench.host.fixes[-1].utc_ns == LF_UTC * 10**9)
    assert bench.host.drops == {Reason.FRAMING: 5, Reason.CHECKSUM: 1}
    assert [why for why in bench.host.drop_details if why] == [why for why in ODD_READ if type(why) is str]
    assert [fix.kind for fix in bench.host.fixes] == [FixKind.NONE, FixKind.FULL, FixKind.FULL]
    full = bench.host.fixes[1]
    assert (full.latitude, full.longitude, full.altitude, full.horizontal) == (NORTH, EAST, 587_400, 1200)


CONFIGURE = "the baud rate is correct; configure the receiver to send GGA, RMC or both"


@pytest.mark.parametrize(
    ("octets", "what", "remedy"),
    [
        (b"", "no data received at 38400 baud", "connect its TX, and set baud to that of the receiver: mostly 4800"),
        (b"\xb7\x00\xff" * 50, "only garbage received at 38400 baud", "set baud to that of the receiver: mostly 4800"),
        (GGA + b"\r\n", "no sentence is valid: framing: $GNGGA,094503.00,", CONFIGURE),
        (GGA + b"*00\r\n", "no sentence is valid: checksum: $GNGGA,094503.00,", CONFIGURE),
        (nmea.encode("GNRMC,1"), "no sentence is valid: GNRMC with 1 fields: it has 9", CONFIGURE),
    ],
    ids=["silence", "garbage", "no-checksum", "wrong-checksum", "few-fields"],
)
def test_a_receiver_without_one_valid_sentence_is_explained(bench, octets, what, remedy):
    for _ in range(32):
        bench.receiver.say(octets)
        bench.loop.run_for(0.5)
    (failure,) = bench.host.failures[:1]
    assert what in failure.message
    assert failure.hint.startswith(remedy)
