"""Programs of firmware/guide/json.md: one sends a CAM as JSON, the other one prints received CAMs."""

import json
import re
import subprocess
import sys
from pathlib import Path

import captain_messages as messages
import pytest

from tests.system.conftest import Bench, Launcher
from tests.system.station import PATIENCE, PROGRAM, ROOT
from tests.system.test_guide_messages import CAM, lines

PAGE = (ROOT / "firmware/guide/json.md").read_text()
PROGRAMS = {name: code for code, name in re.findall(r"^```python\n(# (\w+\.py)\n.*?)^```", PAGE, re.M | re.S)}


@pytest.fixture(scope="module")
def bench(launch_shared: Launcher) -> Bench:
    return launch_shared(station={"position": {"latitude": 48.7668, "longitude": 11.4321}})


def container(pdu: bytes) -> dict[str, object]:
    """Return the high-frequency container of a CAM."""
    cam = json.loads(messages.find("cam-1.4.1").to_json(pdu, plain=True))["cam"]
    found: dict[str, object] = cam["camParameters"]["highFrequencyContainer"]["basicVehicleContainerHighFrequency"]
    return found


def test_send_json_of_the_guide_sends_a_cam_of_its_values(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "send_json.py").write_text(PROGRAMS["send_json.py"])
    subprocess.run(
        [sys.executable, tmp_path / "send_json.py", bench.station.address("pull")], check=True, timeout=PATIENCE
    )
    sent = container(bench.air.hear().pdu)
    assert sent["speed"] == {"speedValue": 13.9, "speedConfidence": "unavailable"}
    assert sent["heading"] == {"headingValue": 90, "headingConfidence": "unavailable"}


def test_captain_send_of_the_guide_sends_a_cam_of_its_values(bench: Bench) -> None:
    (line,) = re.findall(r"^captain send '(.*?)' --plain$", PAGE, re.M | re.S)
    pull, report = bench.station.ports["pull"], bench.station.ports["report"]
    where = ["--pull", str(pull), "--report", str(report)]
    subprocess.run([*PROGRAM, "send", line, "--plain", *where], check=True, timeout=PATIENCE, capture_output=True)
    assert container(bench.air.hear().pdu)["speed"] == {"speedValue": 13.9, "speedConfidence": "unavailable"}


def test_receive_json_of_the_guide_prints_station_and_latitude(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "receive_json.py").write_text(PROGRAMS["receive_json.py"])
    command = [sys.executable, "-u", tmp_path / "receive_json.py", bench.station.address("report")]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as child:
        try:
            assert next(lines(bench, child, CAM)) == "2602961571 50.0401189 None\n"
        finally:
            child.kill()
