"""User-defined message of the guide: added, used from Python and C, decoded, and sent from one station to another."""

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import captain_messages
import pytest

from asn1 import cli as program
from tests.system.conftest import Bench, Launcher
from tests.system.station import ROOT
from tests.system.user import JOIN_MS, Reports, User

PAGE = (ROOT / "asn1/guide/own-messages.md").read_text()


def block(fence: str, start: str = "") -> str:
    """Return the block of the guide with this fence and this start."""
    (found,) = re.findall(rf"^```{re.escape(fence)}\n({re.escape(start)}.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    return str(found)


def sh(*command: object, **environment: str) -> str:
    """Return the output of a command that has these variables. Raises AssertionError with the output if it fails."""
    words = [str(word) for word in command]
    done = subprocess.run(
        words, capture_output=True, text=True, check=False, cwd=ROOT, env={**os.environ, **environment}
    )
    assert done.returncode == 0, f"{words}\n{done.stdout}{done.stderr}"
    return done.stdout


def octets() -> str:
    """Encode the guide's JSON by hand: whole octets of the header, then each number from its lower bound (X.691 11.5.6)."""
    bits = f"{487668000 + 900000000:031b}{114320000 + 1800000000:032b}{4095:012b}{4095:012b}{3601:012b}"
    bits += f"{800001 + 100000:020b}{15:04b}{5:08b}" + "".join(f"{octet:08b}" for octet in b"hello") + f"{80:07b}"
    bits += "0" * (-len(bits) % 8)
    return "02" + "c8" + f"{900001:08x}" + int(bits, 2).to_bytes(len(bits) // 8, "big").hex()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the guide's files: schema in own/, registration in types.toml, C in sources/, Python in python/."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "hello.asn").write_text(block("asn1"))
    (folder / "hello.json").write_text(block("json"))
    (folder / "hello.py").write_text(block("python complete"))
    _, command, file, *options = block("sh add").split()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CAPTAIN_TYPES", str(folder / "types.toml"))
        assert program.main([command, str(folder / file), *options, "--to", str(folder / "own")]) == 0
    for form in ("sources", "python"):
        generate = ["generate", "hello", "--with", folder / "own", "--format", form, "--to", folder / form]
        sh(sys.executable, "-m", "asn1", *generate, CFLAGS="-O0")
    return folder


def test_own_message_of_the_guide_is_encoded_and_decoded_from_python(folder: Path) -> None:
    code = "import captain_messages as m, sys; print(m.find('hello').to_json(bytes.fromhex(sys.argv[1])))"
    said = sh(sys.executable, "-c", code, octets(), PYTHONPATH=str(folder / "python"))
    assert json.loads(said) == json.loads(block("json"))["message"]


def test_own_message_of_the_guide_is_decoded_from_c(folder: Path) -> None:
    sources = folder / "sources"
    example = ROOT / "asn1" / "backends" / "cmake" / "template" / "example" / "tree.c"
    files = [example, *(sources / "src").glob("*.c")]
    sh("gcc", "-std=c11", "-O0", f"-I{sources / 'include'}", *files, "-o", folder / "tree")
    assert "battery: 80" in sh(folder / "tree", "hello", octets())


def test_own_message_of_the_guide_is_encoded_and_decoded_on_the_command_line(folder: Path) -> None:
    captain = (sys.executable, "-m", "firmware")  # a binary knows the messages of its build only
    library = str(folder / "python")
    assert sh(*captain, "encode", folder / "hello.json", PYTHONPATH=library) == f"{octets()}\n"
    assert f"captain decode {octets()}\n" in PAGE
    said = sh(*captain, "decode", octets(), PYTHONPATH=library)
    assert said.startswith("hello: ")
    assert "battery: 80" in said
    made = sh(*captain, "encode", "--example", "hello", "battery=7", "text=hi", PYTHONPATH=library)
    assert "battery: 7\n" in sh(*captain, "decode", made.strip(), PYTHONPATH=library)


def test_registration_of_the_guide_is_what_the_command_writes_and_prints(folder: Path) -> None:
    written = (folder / "types.toml").read_text()
    assert tomllib.loads(written) == tomllib.loads(block("toml types"))
    (row,) = tomllib.loads(written)["types"]
    values = f"messageID {row['number']}, BTP port {row['btp_port']}, traffic class {row['traffic_class']}"
    assert f"type {row['name']}, {values}, priority {row['priority']}, lifetime 1 s\n" in block("text add")


def test_own_message_of_the_guide_sent_at_one_station_arrives_at_the_other(
    folder: Path, launch: Launcher, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CAPTAIN_TYPES", str(folder / "types.toml"))
    a, b = launch.station(), launch.station()
    at_a, at_b = (f"127.0.0.1:{launch.port()}" for _ in "ab")
    for station, name, listen, peer in ((b, "b", at_b, at_a), (a, "a", at_a, at_b)):
        assert "[[types]]" not in block("toml", f"# {name}.toml")
        station.configure({"air": {"driver": "udp", "framing": "ethernet", "listen": listen, "peers": [peer]}})
        station.start()
    user = launch.user(b)
    assert user.sub.recv_multipart()[0] == b"hb.counter"  # a heartbeat shows that the subscription has arrived
    sh(sys.executable, folder / "hello.py", a.address("pull"), PYTHONPATH=str(folder / "python"))
    received = user.receive()
    assert (received.envelope, received.pdu.hex()) == (b"v2x.hello.", octets())


def test_own_message_as_json_arrives_as_json_if_the_program_has_its_library(
    folder: Path, launch: Launcher, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CAPTAIN_TYPES", str(folder / "types.toml"))
    monkeypatch.setenv("PYTHONPATH", str(folder / "python"))  # a binary does not read it
    bench = launch("ethernet")
    reports = bench.make_reports()
    bench.user.push_pdu(b"v2x.hello.", block("json").encode(), label="hello", form="json")
    if "CAPTAIN" in os.environ:
        (refused,) = reports.confirms_of("hello", 1)
        assert refused["reason"] == "bad-json"
        return
    assert [one["outcome"] for one in reports.confirms_of("hello", 2)] == ["accepted", "sent"]
    assert bench.air.hear() == (3000, bytes.fromhex(octets()))
    reports.sub.subscribe(b"plain.hello.")
    said = hears(bench, reports, bytes.fromhex(octets()), b"plain.hello.")
    assert said["message"]["text"] == "hello"


def hears(bench: Bench, reports: Reports, pdu: bytes, topic: bytes) -> dict[str, Any]:
    """Send a PDU until its JSON arrives, and return the object."""
    while True:
        bench.air.send(pdu, 3000)
        while reports.sub.poll(JOIN_MS):
            found, body = reports.sub.recv_multipart()
            if found == topic:
                said: dict[str, Any] = json.loads(body)
                return said


def test_own_message_that_is_added_while_stations_run_is_sent_as_json_and_received_decoded(
    folder: Path, launch: Launcher, monkeypatch: pytest.MonkeyPatch
) -> None:
    types, module = folder / "later.toml", folder / "of_later" / Path(captain_messages.__file__).name
    module.parent.mkdir()
    module.symlink_to(captain_messages.__file__)
    monkeypatch.setenv("CAPTAIN_TYPES", str(types))
    monkeypatch.setenv("PYTHONPATH", str(module.parent))
    monkeypatch.setattr(
        "tests.system.station.PROGRAM", [str(ROOT / ".venv/bin/captain")]
    )  # a binary has no `make codec`
    a, b = launch.station(), launch.station()
    at_a, at_b = (f"127.0.0.1:{launch.port()}" for _ in "ab")
    for station, listen, peer in ((a, at_a, at_b), (b, at_b, at_a)):
        station.configure({"air": {"driver": "udp", "framing": "ethernet", "listen": listen, "peers": [peer]}})
        station.start()
    user = launch.user(a)
    of_a, of_b = launch.reports(a, user), launch.reports(b, launch.user(b))
    of_b.sub.subscribe(b"plain.hello.")
    runs = [reports.next("status.")[1]["run"] for reports in (of_a, of_b)]
    assert outcomes(user, of_a) == ["refused"]

    types.write_text((folder / "types.toml").read_text())
    (new,) = (folder / "python").glob("captain_messages*.so")
    os.replace(shutil.copy(new, module.parent / "new"), module)
    while "sent" not in outcomes(user, of_a):
        pass
    while not of_b.sub.poll(JOIN_MS) or not (found := of_b.sub.recv_multipart())[0].startswith(b"plain.hello."):
        outcomes(user, of_a)
    assert json.loads(found[1])["message"]["text"] == "hello"
    assert [reports.next("status.")[1]["run"] for reports in (of_a, of_b)] == runs


def outcomes(user: User, reports: Reports) -> list[str]:
    """Send the message of the guide as JSON, and return the outcomes of its confirms."""
    user.push_pdu(b"v2x.", block("json").encode(), label="hello", form="json")
    first = reports.confirms_of("hello", 1)[0]["outcome"]
    return [first] if first == "refused" else [first, reports.confirms_of("hello", 1)[0]["outcome"]]
