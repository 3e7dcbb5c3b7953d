"""captain lab in its short form: nothing lost, nothing altered, and tshark decodes every frame."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from firmware import cli
from firmware.lab.dissection import dissect
from firmware.lab.pcap import Pcap
from tests.asn1 import tshark
from tests.system.air import single_hop
from tests.system.station import PROGRAM

SHORT = ("--duration", "0.5", "--rate", "10")
TEN = {
    ("denm", 404), ("cam", 160), ("mapem", 536), ("spatem", 203), ("ivim", 73),
    ("cpm", 624), ("cam", 46), ("cam", 143), ("denm", 43), ("cam", 41),
}  # fmt: skip
BESIDE = {("mapem", 8), ("vam", 34)}


def lab(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*PROGRAM, "lab", *arguments], capture_output=True, text=True, timeout=30, check=False)


LINKS = {"udp": (), "veth": ("--veth",), "radio": ("--radio",), "radio+mqtt": ("--radio", "--mqtt")}


@pytest.fixture(scope="module", params=LINKS)
def result(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    link = LINKS[request.param]
    capture = tmp_path_factory.mktemp("lab") / "frames.pcap"
    done = lab(*SHORT, *link, "--json", "--decode", "--capture", str(capture))
    assert done.returncode == 0, done.stderr + done.stdout
    said: dict[str, Any] = json.loads(done.stdout)
    return said | {"capture": capture, "asked": request.param}


def test_every_copy_of_the_ten_arrives_both_ways_and_equal(result: dict[str, Any]) -> None:
    assert result["link"] == result["asked"]
    assert (result["lost"], result["altered"]) == (0, 0)
    rows = {(row["type"], row["octets"], row["from"]): row for row in result["messages"]}
    for kind, octets in TEN:
        for sender in "AB":
            row = rows[kind, octets, sender]
            assert row["sent"] == row["received"] == row["equal"] == 5


def test_by_a_broker_every_copy_arrives_both_ways_and_equal() -> None:
    done = lab(*SHORT, "--mqtt", "--json")
    assert done.returncode == 0, done.stderr + done.stdout
    said = json.loads(done.stdout)
    assert (said["link"], said["lost"], said["altered"], said["ways"]) == ("mqtt", 0, 0, [])
    assert sum(row["equal"] for row in said["messages"]) == 2 * (10 * 5 + 2)


def test_by_radio_and_broker_at_once_each_is_delivered_once_and_it_is_told_which_was_first(
    result: dict[str, Any],
) -> None:
    for station in "AB" if result["asked"] == "radio+mqtt" else "":
        ways = {way["interface"]: way for way in result["ways"] if way["station"] == station}
        assert set(ways) == {"air", "v2n"}
        assert sum(way["first"] for way in ways.values()) == 10 * 5 + 2
        assert sum(way["alone"] for way in ways.values()) == 0


def test_what_the_air_loses_the_broker_brings() -> None:
    done = lab(*SHORT, "--radio", "0.3", "--mqtt", "--json")
    assert done.returncode == 0, done.stderr + done.stdout
    said = json.loads(done.stdout)
    assert (said["lost"], said["altered"]) == (0, 0)
    alone = {(way["station"], way["interface"]): way["alone"] for way in said["ways"]}
    assert alone["A", "v2n"] > 0
    assert alone["A", "air"] == alone["B", "air"] == 0


def test_what_the_air_of_the_radios_loses_is_exactly_what_is_missing() -> None:
    done = lab(*SHORT, "--radio", "0.1", "--json")
    assert done.returncode == 0, done.stderr + done.stdout
    said = json.loads(done.stdout)
    assert said["lost"] == said["lost_on_air"] > 0
    assert said["altered"] == 0


def test_the_other_two_go_once_each_way(result: dict[str, Any]) -> None:
    beside = [row for row in result["messages"] if (row["type"], row["octets"]) in BESIDE]
    assert [row["equal"] for row in beside] == [1] * 4


def test_every_frame_is_captured_and_decoded_and_none_is_malformed(result: dict[str, Any]) -> None:
    messages = [row for row in result["decoded"] if row["port"]]
    assert sum(row["frames"] for row in messages) == 2 * 10 * 5 + 4
    # The MAPEM of 8 octets has protocolVersion 9, which tshark does not know; the VAM is known since Wireshark 4.4.
    beside = {row["port"]: (row["decoded"], row["btp"]) for row in messages if row["port"] in (2003, 2018)}
    assert beside == {2003: (10, 2), 2018: (2, 0) if tshark.KNOWS_RELEASE_2 else (0, 2)}
    others = [row for row in messages if row["port"] not in beside]
    assert sum(row["decoded"] for row in others) == sum(row["frames"] for row in others) == 2 * 9 * 5
    assert not any(row["malformed"] for row in result["decoded"])
    assert {row["port"] for row in messages} == {2001, 2002, 2003, 2004, 2006, 2009, 2018}


def test_the_capture_decodes_to_its_last_field(result: dict[str, Any]) -> None:
    """tshark shows the elements of each message, once for each copy and direction."""
    elements = {"dsrc.MapData_element": 10, "dsrc.SPAT_element": 10, "ivi.IviStructure_element": 10}
    if tshark.KNOWS_RELEASE_2:
        elements |= {"denm.DenmPayload_element": 20, "cam.CamPayload_element": 40, "vam.VruAwareness_element": 2}
        elements |= {"cpmv1.CollectivePerceptionMessagev1_element": 10}
    else:
        elements |= {"denm.DecentralizedEnvironmentalNotificationMessage_element": 20, "cam.CoopAwareness_element": 40}
        elements |= {"cpm.CollectivePerceptionMessage_element": 10}
    columns = [word for element in elements for word in ("-e", element)]
    command = ["tshark", "-n", "-r", str(result["capture"]), "-T", "fields", *columns]
    rows = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    cells = zip(*(row.split("\t") for row in rows), strict=True)
    assert {element: sum(map(bool, column)) for element, column in zip(elements, cells, strict=True)} == elements


def test_without_json_it_is_a_table() -> None:
    done = lab("--duration", "0.1")
    assert done.returncode == 0, done.stderr
    assert "0 lost, 0 altered" in done.stdout
    assert "spatem 203" in done.stdout
    assert "\x1b" not in done.stdout


def test_a_capture_that_cannot_be_written_is_explained() -> None:
    done = lab("--duration", "0.1", "--capture", "/proc/no/where.pcap")
    assert done.returncode == 1
    assert done.stderr.startswith("captain: --capture: /proc/no/where.pcap")
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    "wrong",
    [
        ("--duration", "-1"),
        ("--rate", "0"),
        ("--duration", "long"),
        ("--nonsense",),
        ("--devices", "a:wlan0", "wlan1"),
        ("--mqtt", "--veth"),
        ("--mqtt", "--decode"),
        ("--mqtt", "--capture", "x.pcap"),
    ],
)
def test_wrong_use_is_exit_code_2(wrong: tuple[str, ...]) -> None:
    with pytest.raises(SystemExit, match=f"^{cli.USAGE_ERROR}$"):
        sys.exit(cli.main(["lab", *wrong]))


def test_a_network_namespace_that_is_not_there_is_explained() -> None:
    done = lab("--short", "--devices", "no-such:wlan0", "no-such-either:wlan1")
    assert done.returncode == 1
    assert done.stderr.startswith("captain: network namespace no-such: No such file or directory")


def test_a_message_that_is_cut_short_counts_as_malformed(tmp_path: Path, vectors: list[dict[str, Any]]) -> None:
    cam = next(row["pdu"] for row in vectors if row["type"] == "cam")
    capture = Pcap(tmp_path / "bad.pcap")
    capture.write(single_hop(cam), 0)
    capture.write(single_hop(cam[:30]), 0)
    capture.close()
    (row,) = dissect(tmp_path / "bad.pcap")
    assert (row.frames, row.decoded, row.malformed) == (2, 1, 1)


def test_a_frame_that_is_no_geonetworking_counts_as_malformed(tmp_path: Path) -> None:
    capture = Pcap(tmp_path / "bad.pcap")
    capture.write(bytes(60), 0)
    capture.close()
    assert [row.malformed for row in dissect(tmp_path / "bad.pcap")] == [1]
