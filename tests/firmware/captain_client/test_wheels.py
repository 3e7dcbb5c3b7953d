"""Wheels for programs of users, of one message: installed into an empty environment, without network."""

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
import zmq

ROOT = Path(__file__).resolve().parents[3]
CAM = "02029b260aa393e6005a6f0da4ae7bfb35a238230a6a3d4290581a90a3f67e02e6928b37fee9fea6103fdf93d980"

PROGRAM = f"""
import captain_client.aio, captain_messages
from captain_client import Station, UnreachableError
from captain_client.codec import Decoded
print(captain_client.__file__, captain_messages.__file__, Decoded(bytes.fromhex("{CAM}"), "cam").edition.name)
try:
    Station(":1", timeout_s=0.01)
except UnreachableError:
    print("unreachable")
"""


@pytest.fixture(scope="module")
def wheels(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return the wheels by the name of their distribution."""
    folder = tmp_path_factory.mktemp("wheels")
    command = [".ci/wheels", "cam-1.4.1"]
    environment = os.environ | {"TO": str(folder), "CFLAGS": "-O0"}  # an optimised library takes twice as long
    subprocess.run(command, cwd=ROOT, env=environment, check=True, capture_output=True)
    return {path.name.split("-")[0]: path for path in folder.glob("*.whl")}


def test_wheels_in_an_empty_environment_are_imported_from_there(wheels: dict[str, Path], tmp_path: Path):
    python = tmp_path / "venv/bin/python"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", tmp_path / "venv"], check=True)
    pip = [sys.executable, "-m", "pip", "--python", python, "install", "-q", "--no-index", "--no-deps"]
    subprocess.run([*pip, *wheels.values()], check=True)
    site = next((tmp_path / "venv/lib").glob("python*/site-packages"))
    for place in Path(zmq.__file__).parents[1].glob("pyzmq.libs"):
        (site / place.name).symlink_to(place)
    (site / "zmq").symlink_to(Path(zmq.__file__).parent)
    done = subprocess.run([python, "-I", "-c", PROGRAM], cwd=tmp_path, check=True, capture_output=True, text=True)
    client, messages, edition, outcome = done.stdout.split()
    assert {Path(client).parents[1], Path(messages).parent} == {site}
    assert (edition, outcome) == ("cam-1.4.1", "unreachable")


def test_symbols_of_the_message_library_are_those_of_the_stable_abi_of_python_3_10(wheels: dict[str, Path]):
    command = [Path(sys.executable).parent / "abi3audit", "--strict", "--report", wheels["captain_messages"]]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    ((report,),) = [one["wheel"] for one in json.loads(done.stdout)["specs"].values()]
    assert report["result"] == {
        "is_abi3": True,
        "is_abi3_baseline_compatible": True,
        "baseline": "3.10",
        "computed": "3.10",
        "non_abi3_symbols": [],
        "future_abi3_objects": {},
    }


def test_wheel_of_the_client_has_types_licence_and_one_requirement(wheels: dict[str, Path]):
    with zipfile.ZipFile(wheels["captain_client"]) as archive:
        names = set(archive.namelist())
        metadata = archive.read("captain_client-0.1.0.dist-info/METADATA").decode()
    assert {"captain_client/py.typed", "captain_client-0.1.0.dist-info/licenses/LICENSE"} <= names
    assert {
        f"captain_client/{path.name}" for path in (ROOT / "firmware/captain_client/captain_client").glob("*.py")
    } <= names
    assert [line for line in metadata.splitlines() if line.startswith("Requires-")] == [
        "Requires-Python: >=3.10",
        "Requires-Dist: pyzmq>=25",
    ]
