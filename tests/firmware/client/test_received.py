"""Messages of port 5556: `v2x.` joined with `raw.`, and everything else that a peer may send."""

from hypothesis import given
from hypothesis import strategies as st

from drivers.message import RxInfo
from drivers.wire import raw
from firmware.client.received import Message, Pairing

CAM = bytes.fromhex("02020000053900010203")
DENM = bytes.fromhex("0201000005390a")
RECEIVED_NS = 1795182426_461613000
RX = RxInfo(rssi_dbm=-71, source_mac=bytes.fromhex("010203040506"))
RAW = [b"raw.", raw.build(CAM, RECEIVED_NS, RX)]


def test_pairing_raw_before_its_pdu_gives_the_message_its_metadata() -> None:
    pairing = Pairing()
    assert pairing.feed(RAW) is None
    message = pairing.feed([b"v2x.cam.", CAM])
    assert message is not None
    assert (message.type, message.pdu, message.station) == ("cam", CAM, 1337)
    assert (message.rssi_dbm, message.source, message.implausible) == (-71, "01:02:03:04:05:06", ())


def test_pairing_pdu_without_raw_gives_a_message_without_metadata() -> None:
    message = Pairing().feed([b"v2x..", b"\x02"])
    assert message == Message("", b"\x02", None)
    assert (message.station, message.message_id, message.rssi_dbm, message.source) == (None, None, None, "")


def test_pairing_malformed_messages_are_counted_with_the_last_sample() -> None:
    pairing = Pairing()
    for frames in ([b"raw.", b"\xff\xff"], [b"hello"], [b"v2x.", b""], [b"a", b"b", b"c"], [b"\xff\xfe", b""]):
        assert pairing.feed(frames) is None
    assert (pairing.rubbish, pairing.sample) == (5, b"\xff\xfe")


@given(st.lists(st.lists(st.binary(max_size=200) | st.sampled_from([b"raw.", b"v2x.cam.", b"v2x."]), max_size=4)))
def test_pairing_any_frames_never_raises(messages: list[list[bytes]]) -> None:
    pairing = Pairing()
    taken = [pairing.feed(frames) for frames in messages]
    assert all(message is None or isinstance(message, Message) for message in taken)
    assert pairing.rubbish <= len(messages)
    assert len(pairing.sample) <= 32


def test_pairing_raw_before_another_pdu_is_given_to_no_message() -> None:
    pairing = Pairing()
    pairing.feed(RAW)
    assert pairing.feed([b"v2x.denm.", DENM]) == Message("denm", DENM, None)
    assert pairing.feed([b"v2x.cam.", CAM]) == Message("cam", CAM, None)


def test_pairing_heartbeat_is_neither_a_message_nor_malformed() -> None:
    pairing = Pairing()
    assert pairing.feed([b"hb.counter", b'{"heartbeat_counter": 0}']) is None
    assert pairing.rubbish == 0
