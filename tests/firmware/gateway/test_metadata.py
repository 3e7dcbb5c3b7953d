"""Metadata as octets: read again by the rules of CDR and the order of Metadata.msg."""

import math
import re
import struct
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from firmware.gateway.captain_gateway.captain_gateway.metadata import Note, cdr
from firmware.gateway.captain_gateway.captain_gateway.pairing import How, Reception
from tests.firmware.gateway.real import CAM

GATEWAY = Path(__file__).parents[3] / "firmware" / "gateway"
LINE = re.compile(r"^([\w/]+)(\[\d*\])? +(\w+) *(#.*)?$", re.MULTILINE)
NUMBERS = {"uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "uint64": "Q", "float64": "d"}
PARTS = {"builtin_interfaces/Time": ("int32", "uint32"), "std_msgs/Header": ("builtin_interfaces/Time", "string")}
RECEPTION = Reception(
    1_795_182_426_461_613_000, 1_795_182_426_466_613_000, (470600000, 154700000), (470585000, 154600000), -71, 12, 2, 3, 2,
    36, bytes.fromhex("020304050607"),
)  # fmt: skip


class Reader:
    """XCDR1, little endian: a number is aligned by its size, counted from behind the encapsulation."""

    def __init__(self, octets: bytes) -> None:
        assert octets[:4] == b"\0\1\0\0"
        self.octets, self.at = octets[4:], 0

    def value(self, kind: str, array: str | None = None) -> Any:
        if array is not None:
            count = int(array[1:-1]) if array != "[]" else self.value("uint32")
            return [self.value(kind) for _ in range(count)]
        if kind in PARTS:
            return [self.value(part) for part in PARTS[kind]]
        if kind == "string":
            length = self.value("uint32")
            text, self.at = self.octets[self.at : self.at + length], self.at + length
            assert text[-1:] == b"\0"
            return text[:-1].decode()
        form = struct.Struct("<" + NUMBERS[kind])
        self.at += -self.at % form.size
        [found] = form.unpack_from(self.octets, self.at)
        self.at += form.size
        return found


def read(octets: bytes) -> dict[str, Any]:
    """By the lines of the definition; constants are none of them."""
    text = (GATEWAY / "captain_gateway_msgs" / "msg" / "Metadata.msg").read_text()
    reader = Reader(octets)
    found = {name: reader.value(kind, array or None) for kind, array, name, _ in LINE.findall(text)}
    assert reader.at == len(reader.octets)
    return found


def test_every_field_is_where_the_definition_has_it():
    note = Note(7, CAM, RECEPTION, "cam-1.4.1", ("cam.[3]", "cam.b"), 1_795_182_427_000_000_001)
    found = read(cdr(note, How("g5", 2001, "02:03:04:05:06:07"), b"captain"))
    assert found.pop("header") == [[1795182426, 461613000], "captain"]
    assert found.pop("station_time") == [1795182426, 466613000]
    assert found.pop("gateway_time") == [1795182427, 1]
    assert bytes(found.pop("pdu")) == CAM
    assert bytes(found.pop("source_mac")) == RECEPTION.source_mac
    assert found == {
        "sequence": 7, "own_latitude": 47.06, "own_longitude": 15.47, "sender_latitude": 47.0585, "sender_longitude": 15.46,
        "station_id": int.from_bytes(CAM[2:6], "big"), "btp_port": 2001, "rssi_dbm": -71, "data_rate": 12,
        "security_its_aid": 36, "message_id": 2, "protocol_version": 2, "traffic_class": 2, "remaining_hop_limit": 3,
        "security_status": 2, "edition": "cam-1.4.1", "interface": "g5", "source": "02:03:04:05:06:07",
        "left_out": ["cam.[3]", "cam.b"],
    }  # fmt: skip


def test_what_is_not_known_is_zero_empty_or_no_number():
    found = read(cdr(Note(1, CAM, None, "cam-1.4.1", (), 5_000_000_007), None, b"captain"))
    assert found["header"] == [[5, 7], "captain"]  # when it was published, for want of anything better
    assert found["station_time"] == [0, 0]
    assert math.isnan(found["own_latitude"])
    assert math.isnan(found["sender_longitude"])
    assert (found["btp_port"], found["rssi_dbm"], found["interface"], found["left_out"]) == (0, 0, "", [])


@given(
    frame=st.text("abc", max_size=9), interface=st.text(max_size=9), source=st.text(max_size=9),
    left_out=st.lists(st.text(max_size=9), max_size=3), pdu=st.binary(min_size=6, max_size=40),
)  # fmt: skip
def test_texts_of_any_length_leave_the_rest_in_its_place(frame, interface, source, left_out, pdu):
    note = Note(1, pdu, RECEPTION, "cam", tuple(left_out), 1)
    texts = [text.replace("\0", "") for text in (interface, source)]
    found = read(cdr(note, How(texts[0], 1, texts[1]), frame.encode()))
    assert (found["header"][1], found["interface"], found["source"]) == (frame, *texts)
    assert found["left_out"] == left_out
    assert bytes(found["pdu"]) == pdu
