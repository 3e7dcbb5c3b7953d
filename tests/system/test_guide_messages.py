"""Programs of asn1/guide/python.md: one reads fields, the other one sends a credible CAM."""

import re
import select
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import captain_messages as messages
import pytest

from board.time.scales import generation_delta_time, nearest_its_time_ms
from tests.system.conftest import Bench
from tests.system.station import PATIENCE, ROOT
from tests.system.user import JOIN_MS

PAGE = (ROOT / "asn1/guide/python.md").read_text()
PROGRAMS = {
    name: code
    for code, name in re.findall(r"^```python complete\n(# (\w+\.py)\n.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
}
CAM = bytes.fromhex("02029b260aa393e6005a6f0da4ae7bfb35a238230a6a3d4290581a90a3f67e02e6928b37fee9fea6103fdf93d980")
SPEED, PERIOD = 10.0, 0.5  # values of the guide: m/s, s
LATE_S = 5.0  # tolerance, because a test machine may be busy
WRAP = 65536


@contextmanager
def running(folder: Path, name: str, address: str) -> Iterator["subprocess.Popen[bytes]"]:
    (folder / name).write_text(PROGRAMS[name])
    with subprocess.Popen([sys.executable, folder / name, address], stdout=subprocess.PIPE) as child:
        try:
            yield child
        finally:
            child.kill()


def lines(bench: Bench, child: "subprocess.Popen[bytes]", pdu: bytes) -> Iterator[str]:
    """Send a PDU again and again, and yield the lines that the program prints."""
    assert child.stdout is not None
    for _ in range(int(PATIENCE * 1000 / JOIN_MS)):
        bench.air.send(pdu, 2002 if pdu[1] == 1 else 2001)
        if select.select([child.stdout], [], [], JOIN_MS / 1000)[0]:
            yield child.stdout.readline().decode()
    raise AssertionError("the program has not printed what it should")


def test_receive_fields_prints_fields_of_valid_and_path_of_truncated_messages(btp: Bench, tmp_path: Path) -> None:
    denm = messages.find("denm-1.3.1")
    header = {"protocolVersion": 2, "messageID": 1, "stationID": 7}
    place = messages.find("cam").decode(CAM)["cam"]["camParameters"]["basicContainer"]["referencePosition"]
    management = {
        "actionID": {"originatingStationID": 7, "sequenceNumber": 1}, "detectionTime": 0, "referenceTime": 0,
        "eventPosition": place, "stationType": 5,
    }  # fmt: skip
    situation = {"informationQuality": 0, "eventType": {"causeCode": 3, "subCauseCode": 0}}
    warning = denm.encode({"header": header, "denm": {"management": management, "situation": situation}})
    said = {
        CAM: "cam-1.4.1 of station 2602961571 latitude=500401189 longitude=144050093 speed=2028 heading=425\n",
        warning: "denm-1.3.1 of station 7 cause=3\n",
        denm.encode({"header": header, "denm": {"management": management}}): "denm-1.3.1 of station 7 cause=None\n",
        CAM[:40]: "cam-1.4.1: cam.camParameters",
        b"\x09" + CAM[1:]: "v2x.cam.: unknown protocolVersion or messageID\n",
    }
    with running(tmp_path, "receive_fields.py", btp.station.address("to_users")) as child:
        for pdu, start in said.items():
            assert any(line.startswith(start) for line in lines(btp, child, pdu))


def test_send_cam_sends_a_credible_cam_of_now_that_moves(btp: Bench, tmp_path: Path) -> None:
    with running(tmp_path, "send_cam.py", btp.station.address("from_users")):
        first, second = btp.air.hear(), btp.air.hear()
    assert first.port == second.port == 2001
    cam = messages.find("cam-1.4.1")
    values = []
    for heard in (first, second):
        cam.validate(heard.pdu)
        values.append(cam.decode(heard.pdu))
    assert values[0]["header"] == {"protocolVersion": 2, "messageID": 2, "stationID": 900001}
    age = generation_delta_time(nearest_its_time_ms(time.time())) - values[1]["cam"]["generationDeltaTime"]
    assert age % WRAP < LATE_S * 1000
    between = values[1]["cam"]["generationDeltaTime"] - values[0]["cam"]["generationDeltaTime"]
    assert 1000 * PERIOD <= between % WRAP < LATE_S * 1000
    places = [one["cam"]["camParameters"]["basicContainer"]["referencePosition"] for one in values]
    assert places[0]["latitude"] == places[1]["latitude"] == 487668000
    east_m = (places[1]["longitude"] - places[0]["longitude"]) / 1e7 * 111_320 * 0.659  # cosine of 48.7668 degrees
    assert east_m == pytest.approx(SPEED * between % WRAP / 1000, abs=0.2)
    vehicle = values[0]["cam"]["camParameters"]["highFrequencyContainer"][1]
    assert (vehicle["speed"]["speedValue"], vehicle["heading"]["headingValue"]) == (1000, 900)
