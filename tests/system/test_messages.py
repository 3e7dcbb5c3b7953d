"""Message commands from outside: decode, encode, convert, explain, listen."""

import json
import re
import select
import subprocess
from pathlib import Path
from typing import Any

from tests.system.conftest import Bench
from tests.system.station import PATIENCE, PROGRAM, ROOT
from tests.system.user import JOIN_MS

CAM = "02029b260aa393e6005a6f0da4ae7bfb35a238230a6a3d4290581a90a3f67e02e6928b37fee9fea6103fdf93d980"
VECTORS = json.loads((ROOT / "firmware" / "vectors.json").read_text())


def captain(*words: str, given: str | bytes = b"", expect: int = 0) -> subprocess.CompletedProcess[bytes]:
    octets = given.encode() if isinstance(given, str) else given
    ended = subprocess.run([*PROGRAM, *words], input=octets, capture_output=True, timeout=4 * PATIENCE, check=False)
    assert b"Traceback" not in ended.stderr, ended.stderr
    assert ended.returncode == expect, ended.stderr
    return ended


def objects(ended: subprocess.CompletedProcess[bytes]) -> list[dict[str, Any]]:
    return [json.loads(line) for line in ended.stdout.splitlines()]


def test_decode_and_encode_are_inverses_for_every_real_message() -> None:
    given = "\n".join(row["hex"] for row in VECTORS)
    decoded = captain("decode", "--json", given=given)
    assert [row["type"] for row in objects(decoded)] == [row["type"] for row in VECTORS]
    assert captain("encode", given=decoded.stdout).stdout.decode().split() == [row["hex"] for row in VECTORS]


def test_a_pipe_of_the_two_prints_the_octets_again() -> None:
    command = f"'{PROGRAM[0]}' decode --json {CAM} | '{PROGRAM[0]}' encode"
    ended = subprocess.run(["sh", "-c", command], capture_output=True, timeout=8 * PATIENCE, check=True)
    assert ended.stdout.decode() == CAM + "\n"


def test_decode_tells_the_edition_why_it_and_the_fields_with_units() -> None:
    said = captain("decode", CAM).stdout.decode()
    assert said.startswith("cam-1.4.1: ETSI EN 302 637-2 v1.4.1, 46 octets, the argument\n")
    assert "messageID 2 and protocolVersion 2 announce it" in said
    assert re.search(r"speedValue: \d+ \(\d+\.\d\d m/s\)\n", said)


def test_decode_opens_the_frames_of_an_independent_station(frames: dict[str, bytes], tmp_path: Path) -> None:
    names = [name for name in frames if name.startswith("cam")]
    given = "\n".join(frames[name].hex() for name in names)
    decoded = captain("decode", "--json", given=given)
    assert [row["type"] for row in objects(decoded)] == ["cam"] * len(names)
    assert captain("convert", "-o", str(tmp_path / "x.pcap"), given=given).stdout == b""
    again = objects(captain("decode", "--json", str(tmp_path / "x.pcap")))
    assert [row["message"] for row in again] == [row["message"] for row in objects(decoded)]
    assert {row["btp_port"] for row in again} == {2001}


def test_what_does_not_decode_is_told_and_the_next_goes_on() -> None:
    ended = captain("decode", "--json", given=f"{CAM[:-30]}\n{CAM}\n", expect=1)
    broken, whole = objects(ended)
    assert broken["bit"] > 0
    assert broken["path"] in broken["error"]
    assert broken["hint"].startswith("it is truncated")
    assert whole["type"] == "cam"


def test_encode_names_path_value_and_range() -> None:
    (row,) = objects(captain("decode", "--json", CAM))
    row["message"]["header"]["stationID"] = 1 << 32
    said = captain("encode", given=json.dumps(row), expect=1).stderr.decode()
    assert "header.stationID" in said
    assert "4294967296" in said
    assert "0..4294967295" in said


def test_explain_accounts_for_every_bit() -> None:
    rows = objects(captain("explain", "--json", CAM))
    bit = 0
    for row in rows:
        if row["width"]:
            assert row["bit"] == bit, row
            bit += row["width"]
    assert bit == 8 * len(CAM) // 2
    assert "".join(row["bits"] for row in rows if not row["bits"].startswith("0x"))[:16] == f"{0x0202:016b}"
    assert all(row["clause"] for row in rows if row["width"])


def test_convert_needs_no_more_than_a_guess_of_its_flags() -> None:
    base64 = captain("convert", "--to", "base64", CAM).stdout.decode()
    assert captain("convert", "--format", "base64", "--to", "hex", base64.strip()).stdout.decode() == CAM + "\n"
    octets = captain("convert", "--to", "binary", CAM).stdout
    assert octets == bytes.fromhex(CAM)
    assert captain("convert", given=octets).stdout.decode() == CAM + "\n"


def test_the_library_has_the_messages_that_travel_here() -> None:
    held = {row["type"] for row in objects(captain("decode", "--list", "--json"))}
    assert {row["type"] for row in VECTORS} <= held


def test_the_doctor_names_the_messages_of_the_library() -> None:
    command = [*PROGRAM, "doctor", "--json", "--board", "none"]
    said = subprocess.run(command, capture_output=True, timeout=4 * PATIENCE, check=False).stdout
    (found,) = [finding for finding in json.loads(said) if finding["subject"] == "messages"]
    assert found["level"] == "ok"
    assert "cam 1.4.1" in found["text"]


def test_explain_of_a_message_that_does_not_decode_ends_at_its_first_bad_bit() -> None:
    ended = captain("explain", "--json", CAM[:-30], expect=1)
    *rows, last = objects(ended)
    assert rows[-1]["bit"] + rows[-1]["width"] <= last["bit"]
    assert last["hint"].startswith("it is truncated")


def test_listen_carries_the_decoded_message(btp: Bench) -> None:
    ports, pdu = btp.station.ports, bytes.fromhex(CAM)
    station = int.from_bytes(pdu[2:6])
    address = ["--station", f"127.0.0.1:{ports['from_users']}", "--to-users", str(ports["to_users"])]
    command = [*PROGRAM, "listen", *address, "--json", "--decode", "--station-id", str(station), "--count", "1"]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as child:
        try:
            assert child.stdout is not None
            for _ in range(int(2 * PATIENCE * 1000 / JOIN_MS)):
                btp.air.send(pdu)
                if select.select([child.stdout], [], [], JOIN_MS / 1000)[0]:
                    break
            found = json.loads(child.stdout.readline())
        finally:
            child.kill()
    assert found["edition"] == "cam-1.4.1"
    assert found["message"]["header"]["stationID"] == station
    assert found["hex"] == CAM
