"""User-defined message, added with one command: used from Python, from C and by captain decode at once."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from asn1 import cli as program

ROOT = Path(__file__).resolve().parents[2]
ASN = """
Potholes DEFINITIONS AUTOMATIC TAGS ::= BEGIN
IMPORTS ItsPduHeader, Latitude, Longitude FROM ITS-Container;
Pothole ::= SEQUENCE { header ItsPduHeader, latitude Latitude, longitude Longitude, depth Depth }
Depth ::= INTEGER { unknown(255) } (0..255)
END
"""
VALUE = {
    "header": {"protocolVersion": 2, "messageID": 240, "stationID": 7},
    "latitude": 470654321,
    "longitude": 154512345,
    "depth": 12,
}


def sh(*command: object, **environment: str) -> str:
    """What a command prints, with these in its environment. Raises AssertionError with what it said where it fails."""
    words = [str(word) for word in command]
    done = subprocess.run(
        words, capture_output=True, text=True, check=False, cwd=ROOT, env={**os.environ, **environment}
    )
    assert done.returncode == 0, f"{words}\n{done.stdout}{done.stderr}"
    return done.stdout


def octets() -> str:
    """VALUE by hand: whole octets of the header, then each number from its lower bound (X.691 11.5.6)."""
    bits = f"{470654321 + 900000000:031b}{154512345 + 1800000000:032b}{12:08b}"
    bits += "0" * (-len(bits) % 8)
    return "02" + "f0" + "00000007" + int(bits, 2).to_bytes(len(bits) // 8, "big").hex()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """With the schema in own/, C sources in c/, the Python module in python/."""
    folder = tmp_path_factory.mktemp("experimental")
    (folder / "potholes.asn").write_text(ASN)
    add = ["add", folder / "potholes.asn", "--pdu", "Pothole", "--name", "pothole", "--id", 240, "--port", 2999]
    assert program.main([*map(str, add), "--to", str(folder / "own")]) == 0
    for form in ("sources", "python"):
        generate = ["generate", "pothole", "--with", folder / "own", "--form", form, "--to", folder / form]
        sh(sys.executable, "-m", "asn1", *generate, CFLAGS="-O0")
    return folder


def test_it_is_encoded_and_decoded_from_python(folder: Path):
    code = f"import captain_messages as m; o = m.find('pothole').encode({VALUE!r}); print(o.hex(), m.find('pothole').decode(o))"
    assert sh(sys.executable, "-c", code, PYTHONPATH=str(folder / "python")) == f"{octets()} {VALUE}\n"


def test_it_is_decoded_from_c(folder: Path):
    sources = folder / "sources"
    example = ROOT / "asn1" / "template" / "example" / "tree.c"
    sh(
        "gcc",
        "-std=c11",
        "-O0",
        f"-I{sources / 'include'}",
        example,
        *(sources / "src").glob("*.c"),
        "-o",
        folder / "tree",
    )
    assert "depth: 12" in sh(folder / "tree", "pothole", octets())


def test_captain_decode_knows_it_by_its_message_id(folder: Path):
    said = sh(sys.executable, "-m", "firmware", "decode", octets(), PYTHONPATH=str(folder / "python"))
    assert said.startswith("pothole: ")
    assert "depth: 12" in said
