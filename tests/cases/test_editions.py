"""Messages that other programs read wrong, or that this one did: each is of the edition that its header announces."""

import json
from pathlib import Path
from typing import Any

import pytest

from firmware.cli import main
from tests.asn1 import codec, tshark
from tests.asn1.truth import schema

HERE = Path(__file__).parent
CASES = ("cam-156", "cam-179", "cam-v1-capture", "cam-v1-sample", "cam-v1-silent", "srem")


def octets(case: str) -> bytes:
    lines = (HERE / f"{case}.hex").read_text().splitlines()
    return bytes.fromhex(next(line for line in lines if not line.startswith("#")))


def shown(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    """What a command prints as JSON."""
    assert main([*arguments]) == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def failed(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """What a command that fails says."""
    assert main([*arguments]) == 1
    printed = capsys.readouterr()
    assert printed.out == ""
    return printed.err


def vehicle(found: dict[str, Any]) -> dict[str, Any]:
    container = found["message"]["cam"]["camParameters"]["highFrequencyContainer"]
    part: dict[str, Any] = container["basicVehicleContainerHighFrequency"]
    return part


@pytest.mark.parametrize(
    ("case", "edition"),
    [(case, "cam-1.3.2" if "v1" in case else "srem-2.1.1" if case == "srem" else "cam-1.4.1") for case in CASES],
)
def test_a_message_is_of_the_edition_of_its_header_and_encoded_to_the_same_octets(capsys, tmp_path, case, edition):
    found = shown(capsys, "decode", "--json", str(HERE / f"{case}.hex"))
    assert found["edition"] == edition
    assert "is_exact" not in found
    assert "warning" not in found
    (tmp_path / "x.json").write_text(json.dumps(found))
    assert main(["encode", str(tmp_path / "x.json")]) == 0
    assert capsys.readouterr().out == octets(case).hex() + "\n"


@pytest.mark.parametrize("case", CASES)
def test_tshark_reads_the_same_values(tmp_path, capsys, case):
    # Wireshark 4.4 reads a CAM of V1.4.1 as one of V2.1.1, which has the same bits.
    edition = tshark.edition(octets(case))
    assert edition in ("cam-2.1.1", shown(capsys, "decode", "--json", str(HERE / f"{case}.hex"))["edition"])
    message = schema().messages[edition]
    value = codec.captain_messages.find(edition).decode(octets(case))
    (read,) = tshark.leaves_read(tmp_path / "x.pcap", [octets(case)], message.btp_port)
    assert tshark.is_same(read, tshark.leaves_written(schema(), message.pdu, value))


@pytest.mark.parametrize(
    ("case", "curvature", "yaw_rate"),
    [("cam-v1-silent", 386, 434), ("cam-v1-capture", 30_001, 32_767), ("cam-v1-sample", 0, 0)],
)
def test_a_cam_of_protocol_version_1_has_curvature_in_16_bits(capsys, case, curvature, yaw_rate):
    found = vehicle(shown(capsys, "decode", "--json", str(HERE / f"{case}.hex")))
    assert found["curvature"] == {"curvatureValue": curvature, "curvatureConfidence": "onePerMeter-0-00002"}
    assert found["yawRate"]["yawRateValue"] == yaw_rate


def test_a_cam_of_protocol_version_1_that_is_cut_off_is_truncated(capsys):
    said = failed(capsys, "decode", str(HERE / "cam-v1-cut.hex"))
    assert "cam-1.3.2: cam.camParameters.lowFrequencyContainer" in said
    assert "(it is truncated: its 47 octets end inside cam.camParameters.lowFrequencyContainer" in said


def test_explain_of_a_cam_of_protocol_version_1_has_a_row_of_16_bits(capsys):
    assert main(["explain", "--json", str(HERE / "cam-v1-silent.hex")]) == 0
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    (row,) = [row for row in rows if row["path"].endswith("curvatureValue")]
    assert (row["edition"], row["width"], row["value"]) == ("cam-1.3.2", 16, "386 1/30000 1/m")


@pytest.mark.parametrize("command", ["decode", "explain"])
def test_an_edition_that_the_header_does_not_announce_is_refused_without_force(capsys, command):
    case = str(HERE / "cam-v1-silent.hex")
    said = failed(capsys, command, "--edition", "cam-1.4.1", case)
    assert "header: messageID 2 and protocolVersion 1 are those of cam-1.3.2, but --edition is cam-1.4.1" in said
    assert "(omit --edition, name cam-1.3.2, or add --force)" in said
    assert main([command, "--edition", "cam-1.4.1", "--force", case]) == 0
    assert "curvatureValue" in capsys.readouterr().out


def test_json_of_another_edition_than_its_header_is_refused_without_force(capsys, tmp_path):
    found = shown(capsys, "decode", "--json", str(HERE / "cam-v1-silent.hex"))
    (tmp_path / "x.json").write_text(json.dumps(found | {"edition": "cam-1.4.1"}))
    said = failed(capsys, "encode", str(tmp_path / "x.json"))
    assert "cam-1.4.1: header: protocolVersion is 1, this edition has 2\n  (name cam-1.3.2, or add --force)" in said
    # Alone, or with the type, it is of the edition of its header.
    for one in (found["message"], {"edition": "cam", "message": found["message"]}):
        (tmp_path / "y.json").write_text(json.dumps(one))
        assert main(["encode", str(tmp_path / "y.json")]) == 0
        assert capsys.readouterr().out == octets("cam-v1-silent").hex() + "\n"


def test_an_srem_whose_header_has_the_name_of_release_2_is_refused_with_the_right_one(capsys, tmp_path):
    text = (HERE / "srem-messageId.json").read_text()
    said = failed(capsys, "encode", str(HERE / "srem-messageId.json"))
    assert "srem-2.1.1: header: " in said
    assert "messageId is no component of ItsPduHeader; did you mean messageID?" in said
    assert "\n  (the header of srem-2.1.1 has protocolVersion, messageID, stationID)" in said
    text = text.replace("messageId", "messageID").replace("stationId", "stationID")
    (tmp_path / "x.json").write_text(text)
    assert main(["encode", str(tmp_path / "x.json")]) == 0
    pdu = capsys.readouterr().out.strip()
    assert pdu[:12] == "02092d4ea63c"
    found = shown(capsys, "decode", "--json", pdu)
    assert (found["edition"], found["message"]) == ("srem-2.1.1", json.loads(text))


def test_a_time_mark_above_its_range_is_refused_and_the_next_line_is_encoded(capsys):
    assert main(["encode", str(HERE / "spat-timemark.jsonl")]) == 1
    printed = capsys.readouterr()
    assert "timing.minEndTime: out of range: 36002 is not in 0..36001" in printed.err
    found = shown(capsys, "decode", "--json", printed.out.strip())
    state = found["message"]["spat"]["intersections"][0]["states"][0]["state-time-speed"][0]
    assert state["timing"] == {"minEndTime": 36_001}
