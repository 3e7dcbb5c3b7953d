"""Frames and sentences in a stream: whole, cut, interleaved, damaged, among garbage."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.reason import Reason
from drivers.wire import rtcm
from drivers.wire.garbage import Garbage
from drivers.wire.gnss import nmea
from drivers.wire.gnss.stream import CREDIT, FRAME_S, MAX_GARBAGE, MOST_CREDIT, GnssStream
from drivers.wire.ublox import ubx
from drivers.wire.ublox.ubx import Kind

VERSION = ubx.encode(Kind.MON_VER)
GGA = nmea.encode("GNGGA,094503.00,4846.01170,N,01125.92330,E,4,18,0.62,376.2,M,46.6,M,1.0,0000")
STATION = rtcm.encode(bytes.fromhex("3ed00003") + bytes(15))  # 1005

frames = st.builds(ubx.UbxFrame, st.integers(0, 0xFFFF), st.binary(max_size=400))
sentences = st.builds(
    nmea.Sentence,
    st.text(st.characters(min_codepoint=0x20, max_codepoint=0x7E, exclude_characters="$*"), min_size=5, max_size=100),
)
corrections = st.binary(max_size=300).map(lambda message: rtcm.RtcmFrame(rtcm.encode(message)))
# Garbage with octets that may look like the beginning of a frame or sentence.
noise = st.lists(
    st.sampled_from([b"\xb5", b"b", b"\xb5b", b"\xb5b\1\7\xff\x1f", b"$", b"$GNGGA,", b"*00\r\n", b"\xd3", b"\xd3\0"])
    | st.binary(max_size=20),
    max_size=10,
).map(b"".join)


def octets_of(event):
    match event:
        case ubx.UbxFrame():
            return ubx.encode(*event)
        case nmea.Sentence():
            return nmea.encode(event.body)
        case rtcm.RtcmFrame():
            return event.octets
        case Garbage():
            return bytes(event.octets)


def length(events):
    return sum(len(octets_of(event)) for event in events)


def cut(octets, cuts):
    """Return parts of these lengths, and the rest as a last part."""
    parts = []
    for size in cuts:
        parts.append(octets[:size])
        octets = octets[size:]
    return [*parts, octets]


def all_of(stream, parts, now=0.0):
    return [event for part in parts for event in stream.receive(part, now)]


def given_up(stream, now):
    """Return the events for octets that the stream still holds, after its deadline."""
    events = []
    while (deadline := stream.deadline()) is not None:
        events += stream.expire(max(now, deadline))
    return events


def without_garbage(events):
    return [event for event in events if not isinstance(event, Garbage)]


def test_the_three_protocols_come_in_any_order():
    events = GnssStream().receive(VERSION + GGA + STATION + GGA + VERSION, 0.0)
    assert [type(event) for event in events] == [
        ubx.UbxFrame,
        nmea.Sentence,
        rtcm.RtcmFrame,
        nmea.Sentence,
        ubx.UbxFrame,
    ]
    assert events[2].number == 1005


@given(sent=st.lists(frames | sentences | corrections, max_size=6), cuts=st.lists(st.integers(0, 200), max_size=20))
def test_what_is_found_does_not_depend_on_how_it_was_cut(sent, cuts):
    octets = b"".join(map(octets_of, sent))
    assert GnssStream().receive(octets, 0.0) == sent
    assert all_of(GnssStream(), cut(octets, cuts)) == sent


@given(sent=st.lists(frames | sentences | corrections, min_size=1, max_size=3))
def test_octet_by_octet_is_as_good_as_whole(sent):
    octets = b"".join(map(octets_of, sent))
    stream = GnssStream()
    assert all_of(stream, [octets[at : at + 1] for at in range(len(octets))]) == sent
    assert stream.deadline() is None


@given(sent=st.lists(st.tuples(noise, frames | sentences | corrections), max_size=5), cuts=st.lists(st.integers(0, 99)))
def test_every_octet_is_in_a_frame_or_counted(sent, cuts):
    octets = b"".join(before + octets_of(event) for before, event in sent)
    stream = GnssStream()
    events = all_of(stream, cut(octets, cuts))
    events += given_up(stream, 10.0)
    # The event for the last garbage comes with the frame that follows it.
    events += stream.receive(VERSION, 20.0)
    assert length(events) == len(octets) + len(VERSION)


@given(rubbish=st.binary(max_size=600), sent=frames | sentences | corrections)
def test_a_frame_behind_any_garbage_is_found_within_its_time(rubbish, sent):
    stream = GnssStream()
    octets = octets_of(sent)
    found = [*stream.receive(rubbish, 0.0), *given_up(stream, 1.0), *stream.receive(octets, 60.0)]
    assert sent in found


@given(rubbish=st.binary(max_size=100))
def test_trailing_garbage_takes_nothing_with_it(rubbish):
    stream = GnssStream()
    assert stream.receive(VERSION + GGA + STATION + rubbish, 0.0)[:3] == GnssStream().receive(
        VERSION + GGA + STATION, 0.0
    )


@given(octets=st.binary(max_size=3000), cuts=st.lists(st.integers(0, 500)))
def test_random_octets_are_counted_and_the_buffer_stays_bounded(octets, cuts):
    stream = GnssStream()
    events = all_of(stream, cut(octets, cuts))
    assert length(events) <= len(octets)
    assert len(stream._waiting) <= ubx.MAX_PAYLOAD + ubx.OVERHEAD


def test_a_damaged_frame_costs_itself_alone():
    damaged = bytearray(ubx.encode(Kind.NAV_PVT, bytes(92)))
    damaged[50] ^= 1
    events = GnssStream().receive(VERSION + bytes(damaged) + GGA, 0.0)
    assert [type(event) for event in events] == [ubx.UbxFrame, Garbage, nmea.Sentence]
    assert events[1] == Garbage(Reason.CHECKSUM, bytes(damaged[:64]), 100)


@pytest.mark.parametrize("lost", [2, 5, 40, 99])
def test_a_frame_that_lost_octets_gives_back_what_it_had_swallowed(lost):
    # Octets were lost in an overrun. The length is still 92, so octets of the next frame are taken for this one.
    cut_off = ubx.encode(Kind.NAV_PVT, bytes(92))[: -lost or None]
    events = GnssStream().receive(cut_off + VERSION * 13, 0.0)
    assert without_garbage(events) == [ubx.UbxFrame(Kind.MON_VER, b"")] * 13


def test_a_beginning_that_promises_too_much_is_none():
    long = ubx.SYNC + b"\1\7" + (ubx.MAX_PAYLOAD + 1).to_bytes(2, "little")
    assert without_garbage(GnssStream().receive(long + VERSION, 0.0)) == [ubx.UbxFrame(Kind.MON_VER, b"")]


def test_a_frame_of_the_longest_length_is_read():
    frame = ubx.UbxFrame(0x0213, bytes(ubx.MAX_PAYLOAD))
    assert GnssStream().receive(ubx.encode(*frame), 0.0) == [frame]


def test_a_false_beginning_holds_what_follows_up_for_its_time_and_no_longer():
    stream = GnssStream()
    false = ubx.SYNC + b"\1\7\x00\x20"  # 8192 octets
    assert stream.receive(false + VERSION + GGA, 0.0) == []
    assert stream.deadline() == FRAME_S
    assert stream.expire(FRAME_S / 2) == []
    events = stream.expire(FRAME_S)
    assert [type(event) for event in events] == [Garbage, ubx.UbxFrame, nmea.Sentence]
    assert events[0].octets == len(false)
    assert stream.deadline() is None


def test_the_time_of_a_candidate_begins_with_it():
    stream = GnssStream()
    stream.receive(VERSION + VERSION[:3], 5.0)
    stream.receive(VERSION[3:5], 5.5)
    assert stream.deadline() == 5.0 + FRAME_S
    stream.receive(VERSION[5:] + VERSION[:1], 5.9)
    assert stream.deadline() == 5.9 + FRAME_S


def test_long_garbage_is_told_without_waiting_for_its_end():
    stream = GnssStream()
    events = [event for _ in range(10) for event in stream.receive(b"\xff" * (MAX_GARBAGE // 2), 0.0)]
    assert [event.octets for event in events] == [MAX_GARBAGE] * 5


@pytest.mark.parametrize(
    "line",
    [
        b"$GNGGA,1*00\r\n",  # checksum
        b"$GNGGA,1*5\r\n",
        b"$GNGGA,1\r\n",  # none
        b"$" + b"G" * 300 + b"*00\r\n",  # too long
        b"$GN\x80GA*00\r\n",
    ],
)
def test_what_is_no_sentence_is_garbage(line):
    events = GnssStream().receive(line + VERSION, 0.0)
    assert without_garbage(events) == [ubx.UbxFrame(Kind.MON_VER, b"")]
    assert length(events) == len(line) + len(VERSION)


MADE_UP = {
    "ubx": ubx.SYNC + b"\1\7\xf0\x1f",  # 8176 octets
    "rtcm": b"\xd3\3\xff",
    "nmea": b"$" + b"A" * 81 + b"*00\r\n",
}


@pytest.mark.parametrize("kind", MADE_UP)
def test_made_up_beginnings_cost_no_more_than_their_octets_are_worth(kind, monkeypatch):
    work = 0

    def counted(call):
        def checked(octets):
            nonlocal work
            work += len(octets)
            return call(octets)

        return checked

    monkeypatch.setattr(ubx, "checksum", counted(ubx.checksum))
    monkeypatch.setattr(rtcm, "crc24q", counted(rtcm.crc24q))
    monkeypatch.setattr(nmea, "checksum", counted(nmea.checksum))
    stream, octets = GnssStream(), MADE_UP[kind] * 4000
    events = all_of(stream, [octets[at : at + 1024] for at in range(0, len(octets), 1024)])
    assert work <= MOST_CREDIT + (CREDIT + 2) * len(octets)
    assert without_garbage(events) == []
    given_up(stream, 100.0)
    assert without_garbage(stream.receive(GGA, 200.0)) == [nmea.Sentence(GGA[1:-5].decode())]
