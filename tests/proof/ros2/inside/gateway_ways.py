"""Messages through a gateway, both ways, with their reports."""

import json
import time

import captain_messages
from etsi_its_cam_msgs.msg import CAM

from tests.proof.ros2.inside.gateway_bench import OWN, RX, Bench, WrongError


def connect(test: Bench) -> str:
    test.until(lambda: test.cam.get_subscription_count() and test.denm.get_subscription_count(), "the gateway's topics")
    test.until(
        lambda: test.diagnostics["station"].level != b"\2" if "station" in test.diagnostics else False, "a station"
    )

    def comes() -> bool:  # all subscriptions have travelled when a message and its metadata come
        test.station.indicate("cam", test.numbered(1), RX, OWN, "g5")
        test.spin(0.1)
        return bool(test.cams and test.heard["cam/received/metadata"])

    test.until(comes, "a first message")
    test.spin(0.5)
    return "node, topics and station are there"


def receive(test: Bench) -> str:
    test.cams.clear()
    pdu = test.numbered(4711)
    test.station.indicate("cam", pdu, RX, OWN, "g5")
    message, _ = test.until(lambda: test.cams and test.cams[-1], "a CAM")
    if message != test.typed(pdu, "cam-1.4.1", CAM):
        raise WrongError("another message came")
    return "a typed subscription has the message"


def metadata(test: Bench) -> str:
    notes = test.heard["cam/received/metadata"]
    notes.clear()
    test.cams.clear()
    pdu = test.numbered(4712)
    received_ns = test.station.indicate("cam", pdu, RX, OWN, "g5")
    note = test.until(lambda: next((one for one in notes if one.station_id == 4712), None), "metadata")
    _, info = test.until(lambda: test.cams and test.cams[-1], "a CAM")
    stamp = note.header.stamp.sec * 10**9 + note.header.stamp.nanosec
    own = note.station_time.sec * 10**9 + note.station_time.nanosec
    wanted = {
        "sequence": info["publication_sequence_number"], "station_id": 4712, "btp_port": 2001, "rssi_dbm": -71,
        "data_rate": 12, "message_id": 2, "protocol_version": pdu[0], "traffic_class": 2, "remaining_hop_limit": 3,
        "edition": "cam-1.4.1", "interface": "g5", "source": "02:03:04:05:06:07", "own_latitude": 47.06,
        "own_longitude": 15.47, "sender_latitude": 47.0585, "sender_longitude": 15.46,
    }  # fmt: skip
    for name, value in wanted.items():
        if getattr(note, name) != value:
            raise WrongError(f"{name} is {getattr(note, name)!r}, not {value!r}")
    if (
        (stamp, own) != (received_ns, received_ns + 1_000_000)
        or bytes(note.pdu) != pdu
        or bytes(note.source_mac) != RX.source_mac
    ):
        raise WrongError(f"times, octets or address: {note}")
    return "every field; its sequence is the publication's number"


def metadata_alone(test: Bench) -> str:
    notes = test.heard["cam/received/metadata"]
    notes.clear()
    began = time.monotonic()
    test.station.indicate("cam", test.numbered(4713), RX, OWN, None)
    note = test.until(lambda: next((one for one in notes if one.station_id == 4713), None), "metadata")
    if note.interface or note.btp_port or note.rssi_dbm != -71:
        raise WrongError(f"{note}")
    return f"without an indication after {1000 * (time.monotonic() - began):.0f} ms, with what RawRxMessage has"


def transmit(test: Bench) -> str:
    before = len(test.station.taken)
    pdu = test.numbered(815)
    test.cam.publish(test.typed(pdu, "cam-1.4.1", CAM))
    [frames] = test.until(lambda: test.sent_since(before), "a message at the endpoint")
    if frames[:2] != [b"v2x.", pdu] or "label" not in json.loads(frames[2]):
        raise WrongError(f"{frames}")
    return "a typed publisher's message is at the endpoint, octet for octet"


def left_out(test: Bench) -> str:
    pdu = test.messages["denm"]

    def comes() -> bool:
        test.station.indicate("denm", pdu, RX, OWN, "g5")
        test.spin(0.1)
        return bool(test.denms)

    test.until(comes, "a DENM")
    before = len(test.station.taken)
    test.denm.publish(test.denms[-1])
    [frames] = test.until(lambda: test.sent_since(before), "the DENM at the endpoint")
    bare = captain_messages.find("denm-1.3.1").from_cdr(captain_messages.find("denm-1.3.1").to_cdr(pdu)[0])
    if frames[1] != pdu or bare == pdu:
        raise WrongError("what had no field was not kept")
    return "a DENM with a part without a field goes out again as it came"
