"""UBX frames, messages and configuration: compared with known octets; invalid input."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import ProtocolError
from drivers.gnss import settings
from drivers.wire.ublox import ubx
from drivers.wire.ublox.health import MonVer
from drivers.wire.ublox.keys import KEYS
from drivers.wire.ublox.messages import Ack, NavPvt, decode, encode
from drivers.wire.ublox.ubx import Kind
from drivers.wire.ublox.values import FLASH, RAM, ValGet, ValSet, size

# Examples of the interface description, and a configuration that another program built and checked.
POLL_VERSION = bytes.fromhex("b5620a0400000e34")
ACK_VALSET = bytes.fromhex("b56205010200068a98c1")
PULSE = bytes.fromhex(
    "b562068a4c0000010000230005200030000520010700051001080005100109000510010a000510010b000510010c00052000"
    "0200054040420f0004000540000000000300054040420f0005000540a0860100b2ee"
)
# Order of the pulse's keys in that configuration.
PULSE_ORDER = ("PERIOD_TP1", "LEN_TP1", "PERIOD_LOCK_TP1", "LEN_LOCK_TP1")


def frame_of(octets):
    assert octets[:2] == ubx.SYNC
    assert ubx.checksum(octets[2:-2]) == octets[-2:]
    return ubx.UbxFrame(int.from_bytes(octets[2:4]), octets[6:-2])


def test_an_empty_frame_polls():
    assert ubx.encode(Kind.MON_VER) == POLL_VERSION


def test_an_acknowledgement_has_the_octets_of_the_description():
    assert encode(Ack(0x06, 0x8A)) == ACK_VALSET
    assert decode(frame_of(ACK_VALSET)) == Ack(0x06, 0x8A)


def test_the_pulse_is_configured_with_the_octets_that_another_program_makes():
    items = [(KEYS[name].number, value) for name, value in settings.PULSE.items()]
    last = [(KEYS[f"CFG-TP-{name}"].number, settings.PULSE[f"CFG-TP-{name}"]) for name in PULSE_ORDER]
    ordered = [item for item in items if item not in last] + last
    assert encode(ValSet(RAM, tuple(ordered))) == PULSE
    assert decode(frame_of(PULSE)) == ValSet(RAM, tuple(ordered))


def test_values_are_signed_as_their_keys_say():
    items = (
        (KEYS["CFG-TP-ANT_CABLEDELAY"].number, -7),
        (KEYS["CFG-UART1-BAUDRATE"].number, 921_600),
    )
    assert decode(frame_of(encode(ValSet(RAM | FLASH, items)))) == ValSet(RAM | FLASH, items)


def test_a_question_for_values_has_keys_alone_and_its_answer_has_values():
    key = KEYS["CFG-RATE-MEAS"].number
    question = ValGet(0, 7, ((key, 0),), position=300)
    assert frame_of(encode(question)).payload == bytes.fromhex("00072c01") + key.to_bytes(4, "little")
    assert decode(frame_of(encode(question))) == question
    answer = ValGet(1, 7, ((key, 200),))
    assert decode(frame_of(encode(answer))) == answer


@pytest.mark.parametrize(
    ("payload", "what"),
    [
        (b"\0\1\0", "at least 4"),
        (b"\0\1\0\0\x23\0\5", "in the middle of a key"),
        (b"\0\1\0\0\x02\0\5\x40\1\2\3", "in the middle of the value of CFG-TP-PERIOD_TP1"),
        (b"\0\1\0\0\x02\0\5\0\1\2\3\4", "invalid key"),
    ],
)
def test_a_configuration_that_is_cut_off_is_explained(payload, what):
    with pytest.raises(ProtocolError, match=what):
        decode(ubx.UbxFrame(Kind.CFG_VALSET, payload))


def test_keys_of_sizes_that_do_not_exist_are_refused():
    assert [size(bits << 28) for bits in (1, 2, 3, 4, 5)] == [1, 1, 2, 4, 8]
    for bits in (0, 6, 7):
        with pytest.raises(ProtocolError):
            size(bits << 28)


def test_a_short_message_is_refused_and_a_longer_one_is_of_a_later_version():
    assert decode(ubx.UbxFrame(Kind.ACK_ACK, b"\6\x8a\0\0")) == Ack(0x06, 0x8A)
    with pytest.raises(ProtocolError, match="NAV-PVT of 91 octets: it has 92"):
        decode(ubx.UbxFrame(Kind.NAV_PVT, bytes(91)))


def test_a_kind_that_is_not_known_is_none_and_named_by_its_numbers():
    assert decode(ubx.UbxFrame(0x0135, b"")) is None
    assert ubx.name(0x0135) == "01-35"
    assert ubx.name(Kind.SEC_SIG) == "SEC-SIG"


@pytest.mark.parametrize(
    ("extensions", "firmware", "protocol"),
    [
        (("FWVER=HPG 1.32", "PROTVER=27.31", "MOD=ZED-F9P"), "HPG 1.32", "27.31"),
        (("PROTVER 18.00",), "EXT CORE 1.00", "18.00"),
        ((), "EXT CORE 1.00", ""),
    ],
)
def test_the_version_of_older_firmware_is_read_as_well(extensions, firmware, protocol):
    version = MonVer("EXT CORE 1.00", "00190000", extensions)
    assert decode(frame_of(encode(version))) == version
    assert (version.firmware, version.protocol) == (firmware, protocol)


def test_a_negative_nano_is_kept_negative():
    payload = bytearray(92)
    payload[16:20] = (-123_456).to_bytes(4, "little", signed=True)
    message = decode(ubx.UbxFrame(Kind.NAV_PVT, bytes(payload)))
    assert isinstance(message, NavPvt)
    assert message.nano == -123_456


@given(kind=st.sampled_from([*Kind, 0x1234]), payload=st.binary(max_size=300))
def test_any_payload_is_read_or_explained(kind, payload):
    try:
        message = decode(ubx.UbxFrame(kind, payload))
    except ProtocolError as error:
        assert str(error)
    else:
        assert message is None or encode(message)
