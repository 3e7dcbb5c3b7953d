"""UBX compared with pyubx2, field by field: each parses the other's messages."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyubx2 import GET, SET, UBX_CONFIG_DATABASE, UBXMessage, UBXReader

from drivers.wire.ublox import ubx
from drivers.wire.ublox.health import MonRf, MonVer, RfBlock, SecSig
from drivers.wire.ublox.keys import KEYS
from drivers.wire.ublox.messages import Ack, CfgRst, Nak, NavPvt, NavStatus, RxmRtcm, decode, encode
from drivers.wire.ublox.time import NavTimeLs, TimTp
from drivers.wire.ublox.values import ValGet, ValSet, size

WEEK_MS = 604_800_000


def u(bits):
    return st.integers(0, 2**bits - 1)


def i(bits):
    return st.integers(-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)


def bits(number, low, count=1):
    return number >> low & (1 << count) - 1


TOW = st.integers(0, WEEK_MS - 1)
CLOCK = (st.integers(0, 23), st.integers(0, 59), st.integers(0, 60))

PVT = st.builds(
    NavPvt, TOW, u(16), u(8), u(8), *CLOCK, u(4), u(32), i(32), u(8), u(8), u(8), u(8), i(32), i(32), i(32), i(32),
    u(32), u(32), i(32), i(32), i(32), i(32), i(32), u(32), u(32), u(16), u(16), i(32), i(16), u(16),
)  # fmt: skip

# For each message: its name in pyubx2, and the expected attributes there; scaled values as integers.
CASES = {
    NavPvt: (
        PVT,
        lambda m: {
            "year": m.year, "month": m.month, "day": m.day, "hour": m.hour, "min": m.minute, "second": m.second,
            "validDate": m.is_date_valid, "validTime": m.is_time_valid, "fullyResolved": m.is_fully_resolved,
            "tAcc": m.time_accuracy_ns, "nano": m.nano, "fixType": m.fix_type, "gnssFixOk": m.is_fix_ok,
            "diffSoln": bits(m.flags, 1), "carrSoln": m.carrier, "confirmedAvai": bits(m.flags2, 5),
            "confirmedDate": bits(m.flags2, 6), "confirmedTime": bits(m.flags2, 7), "numSV": m.satellites,
            "lon*1e7": m.longitude, "lat*1e7": m.latitude, "height": m.height_mm, "hMSL": m.above_sea_mm,
            "hAcc": m.horizontal_mm, "vAcc": m.vertical_mm, "velN": m.north_mm_s, "velE": m.east_mm_s,
            "velD": m.down_mm_s, "gSpeed": m.speed_mm_s, "headMot*1e5": m.heading, "sAcc": m.speed_accuracy_mm_s,
            "headAcc*1e5": m.heading_accuracy, "pDOP*1e2": m.pdop, "invalidLlh": m.is_position_invalid,
            "lastCorrectionAge": m.correction_age, "headVeh*1e5": m.vehicle_heading, "magDec*1e2": m.declination,
            "magAcc*1e2": m.declination_accuracy,
        },
    ),
    NavStatus: (
        st.builds(NavStatus, TOW, u(8), u(4), u(8), u(8), u(32), u(32)),
        lambda m: {
            "gpsFix": m.fix_type, "gpsFixOk": bits(m.flags, 0), "towSet": bits(m.flags, 3),
            "spoofDetState": m.spoofing, "carrSoln": bits(m.flags2, 6, 2), "ttff": m.first_fix_ms,
            "msss": m.since_start_ms,
        },
    ),
    NavTimeLs: (
        st.builds(NavTimeLs, TOW, u(8), u(8), i(8), u(8), i(8), i(32), u(16), u(16), u(2)),
        lambda m: {
            "version": m.version, "srcOfCurrLs": m.source, "currLs": m.leap_seconds, "srcOfLsChange": m.change_source,
            "lsChange": m.change, "timeToLsEvent": m.to_event_s, "dateOfLsGpsWn": m.event_week,
            "dateOfLsGpsDn": m.event_day, "validCurrLs": bits(m.valid, 0), "validTimeToLsEvent": m.is_event_known,
        },
    ),
    TimTp: (
        st.builds(TimTp, u(32), u(32), i(32), u(16), u(6), u(8)),
        lambda m: {
            "towMS": m.tow_ms, "qErr": m.quantisation_ps, "week": m.week, "timeBase": m.is_utc,
            "utc": bits(m.flags, 1), "raim": bits(m.flags, 2, 2), "qErrInvalid": not m.is_quantisation_valid,
            "TpNotLocked": not m.is_locked, "timeRefGnss": m.system, "utcStandard": bits(m.reference, 4, 4),
        },
    ),
    RxmRtcm: (
        st.builds(RxmRtcm, u(8), u(3), u(16), u(16), u(16)),
        lambda m: {
            "version": m.version, "crcFailed": m.is_damaged, "msgUsed": m.use, "subType": m.subtype,
            "refStation": m.station, "msgType": m.number,
        },
    ),
    Ack: (st.builds(Ack, u(8), u(8)), lambda m: {"clsID": m.class_, "msgID": m.id}),
    Nak: (st.builds(Nak, u(8), u(8)), lambda m: {"clsID": m.class_, "msgID": m.id}),
    SecSig: (
        st.builds(SecSig, st.just(1), st.booleans(), u(2), st.booleans(), u(3), st.just(())),
        lambda m: {
            "version": 1, "jamDetEnabled": m.is_jamming_detected, "jammingState": m.jamming,
            "spfDetEnabled": m.is_spoofing_detected, "spoofingState": m.spoofing,
        },
    ),
}  # fmt: skip


def theirs(octets):
    return UBXReader.parse(octets, parsebitfield=1)


def read(parsed, name):
    """Return an attribute of a pyubx2 message; `lat*1e7` returns lat as the original integer."""
    attribute, _, scale = name.partition("*")
    value = getattr(parsed, attribute)
    return round(value * float(scale)) if scale else value


def ours(message):
    octets = message.serialize()
    return decode(ubx.UbxFrame(int.from_bytes(octets[2:4]), octets[6:-2]))


@pytest.mark.parametrize("kind", CASES, ids=lambda kind: kind.__name__)
def test_what_we_build_they_read(kind):
    messages, expected = CASES[kind]

    @given(message=messages)
    def check(message):
        parsed = theirs(encode(message))
        wanted = expected(message)
        assert {name: read(parsed, name) for name in wanted} == wanted

    check()


@pytest.mark.parametrize("kind", CASES, ids=lambda kind: kind.__name__)
def test_what_they_build_we_read(kind):
    messages, _ = CASES[kind]

    @given(message=messages)
    def check(message):
        # The same message, built by pyubx2 from its attributes.
        parsed = theirs(encode(message))
        again = UBXMessage(parsed.msg_cls, parsed.msg_id, GET, payload=parsed.payload)
        assert ours(again) == message
        assert again.serialize() == encode(message)

    check()


def test_a_position_that_they_build_from_its_fields_we_read():
    made = UBXMessage(
        "NAV", "NAV-PVT", GET, year=2026, month=6, day=1, hour=8, min=0, second=60, validDate=1, validTime=1,
        fullyResolved=1, tAcc=22, nano=-412, fixType=3, gnssFixOk=1, carrSoln=2, confirmedAvai=1, confirmedDate=1,
        confirmedTime=1, numSV=28, lon=11.432068, lat=-48.7668616, height=420_000, hAcc=14, gSpeed=13_900,
        headMot=16.21917, lastCorrectionAge=3,
    )  # fmt: skip
    message = ours(made)
    assert (message.year, message.second, message.nano) == (2026, 60, -412)
    assert message.longitude == 114_320_680
    assert message.latitude == -487_668_616
    assert (message.is_fully_resolved, message.is_confirmed, message.is_fix_ok) == (True, True, True)
    assert (message.carrier, message.correction_age) == (2, 3)
    assert abs(message.heading - 1_621_917) <= 1  # pyubx2 truncates floating-point values


ASCII = st.text(st.characters(min_codepoint=0x21, max_codepoint=0x7E), max_size=30)


@given(software=ASCII, hardware=ASCII.map(lambda text: text[:10]), extensions=st.lists(ASCII, max_size=8))
def test_versions_agree_both_ways(software, hardware, extensions):
    message = MonVer(software, hardware, tuple(extensions))
    parsed = theirs(encode(message))
    assert parsed.swVersion == software.encode().ljust(30, b"\0")
    assert parsed.hwVersion == hardware.encode().ljust(10, b"\0")
    for at, extension in enumerate(extensions, 1):
        assert getattr(parsed, f"extension_{at:02}") == extension.encode().ljust(30, b"\0")
    assert ours(parsed) == message


BLOCK = st.builds(RfBlock, u(8), u(2), u(8), u(8), u(32), u(16), u(16), u(8), i(8), u(8), i(8), u(8))


@given(blocks=st.lists(BLOCK, max_size=4))
def test_states_of_the_receiving_paths_agree_both_ways(blocks):
    message = MonRf(0, tuple(blocks))
    parsed = theirs(encode(message))
    assert parsed.nBlocks == len(blocks)
    for at, block in enumerate(blocks, 1):
        names = ("blockId", "jammingState", "antStatus", "antPower", "jamInd", "ofsQ", "magQ")
        found = [getattr(parsed, f"{name}_{at:02}") for name in names]
        assert found == [
            block.block, block.jamming, block.antenna, block.power, block.jamming_indicator, block.offset_q,
            block.magnitude_q,
        ]  # fmt: skip
    assert ours(parsed) == message


@given(flags=st.tuples(st.booleans(), u(2), st.booleans(), u(3)), centres=st.lists(u(25), max_size=6))
def test_signal_security_of_version_2_agrees_both_ways(flags, centres):
    message = SecSig(2, *flags, tuple(centres))
    parsed = theirs(encode(message))
    assert (parsed.jamDetEnabled, parsed.jammingState, parsed.spfDetEnabled, parsed.spoofingState) == flags
    assert parsed.jamNumCentFreqs == len(centres)
    for at, centre in enumerate(centres, 1):
        assert getattr(parsed, f"centFreq_{at:02}") == bits(centre, 0, 24)
        assert getattr(parsed, f"jammed_{at:02}") == bits(centre, 24)
    assert ours(parsed) == message


@st.composite
def settings(draw):
    key = draw(st.sampled_from(list(KEYS.values())))
    octets = size(key.number)
    match key.type:
        case "L":
            return key, draw(st.integers(0, 1))
        case "I":
            return key, draw(i(8 * octets))
        case _:
            return key, draw(u(8 * octets))


@given(layers=st.sampled_from([1, 4, 5, 7]), items=st.lists(settings(), min_size=1, max_size=20))
def test_configurations_agree_both_ways(layers, items):
    message = ValSet(layers, tuple((key.number, value) for key, value in items))
    made = UBXMessage.config_set(layers, 0, [(key.number, value) for key, value in items])
    assert made.serialize() == encode(message)
    assert ours(made) == message


@given(layer=st.sampled_from([0, 1, 2, 7]), position=u(16), items=st.lists(settings(), min_size=1, max_size=20))
def test_questions_for_a_configuration_and_their_answers_agree(layer, position, items):
    question = ValGet(0, layer, tuple((key.number, 0) for key, _ in items), position)
    made = UBXMessage.config_poll(layer, position, [key.number for key, _ in items])
    assert made.serialize() == encode(question)
    answer = ValGet(1, layer, tuple((key.number, value) for key, value in items))
    parsed = theirs(encode(answer))
    for key, value in items[-1:]:
        assert getattr(parsed, key.name.replace("-", "_")) == value


def test_a_reset_has_their_octets():
    made = UBXMessage("CFG", "CFG-RST", SET, navBbrMask=b"\xff\xff", resetMode=2, parsebitfield=0)
    assert made.serialize() == encode(CfgRst(0xFFFF, 2))


def test_every_key_has_their_number_and_type():
    for name, key in KEYS.items():
        number, kind = UBX_CONFIG_DATABASE[name.replace("-", "_")]
        assert (key.number, key.type) == (number, kind[0])
        assert size(key.number) == int(kind[1:])
