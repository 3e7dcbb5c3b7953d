"""Guide of brokers: its openssl lines, mosquitto.conf, ACL and profile, run word for word."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from paho.mqtt.client import topic_matches_sub

from drivers.message import Ego, Position
from drivers.mqtt import profile as mqtt_profile
from drivers.wire.v2n.message import Identity
from drivers.wire.v2n.profile import Profile
from firmware.lab.certificates import Pair
from tests.broker.client import Client
from tests.broker.fixtures import Brokers
from tests.broker.mosquitto import Mosquitto
from tests.system.station import ROOT

GUIDE = (ROOT / "drivers/guide/brokers.md").read_text()
BLOCKS = re.findall(r"^```(\w+(?: \w+)?)\n(.*?)^```", GUIDE, re.MULTILINE | re.DOTALL)
# If several blocks have the same fence tag, the first one is used: the second `toml` block is the profile.
SHOWN = dict(reversed(BLOCKS))
# Lines in addition to those of the guide: the user of this test, and a log that shows when the broker is ready.
OURS = "user root\nlog_dest stderr\nlog_type notice\nlog_type information\nlog_type error\n"
ACL = [line.split()[1:] for line in SHOWN["conf acl"].splitlines() if line.startswith("pattern ")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder with the files that the guide's first block creates."""
    made = tmp_path_factory.mktemp("broker")
    issued = SHOWN["sh broker"] + "issue other extendedKeyUsage=clientAuth\n"
    subprocess.run(["sh", "-eu"], input=issued, cwd=made, check=True, capture_output=True, text=True)
    return made


@contextmanager
def started(brokers: Brokers, folder: Path) -> Iterator[Mosquitto]:
    made = brokers.stopped()
    text = SHOWN["conf broker"].replace("listener 8883", f"listener {made.port} 127.0.0.1")
    (folder / "acl").write_text(SHOWN["conf acl"])
    for name in ("ca.pem", "broker.pem", "broker.key", "acl"):
        assert f" {name}\n" in text
        text = text.replace(f" {name}\n", f" {folder / name}\n")
    made.file.write_text(OURS + text)
    with made:
        yield made


def client(broker: Mosquitto, folder: Path, name: str) -> Client:
    authority: Any = SimpleNamespace(certificate=folder / "ca.pem")
    return Client(broker.port, name, authority=authority, identity=Pair(folder / f"{name}.pem", folder / f"{name}.key"))


def test_guide_of_brokers_has_the_blocks_that_follow() -> None:
    kinds = ["sh broker", "conf broker", "conf acl", "toml", "sh try", "toml requests", "toml profile", "toml"]
    assert [kind for kind, _ in BLOCKS] == kinds


def test_profile_of_the_guide_publishes_denms_by_tile(tmp_path: Path) -> None:
    file = tmp_path / "fleet.toml"
    file.write_text(SHOWN["toml profile"])
    read = Profile(mqtt_profile.load(str(file)), Identity("own", 1337, "own", ""))
    own = Ego(0, Position(487_668_616, 114_320_680), True)
    (publication,) = read.publications("denm", 2002, b"\2\1", own, 0)
    assert re.fullmatch(r"fleet/denm/own(/[0-3]){20}", publication.topic)
    assert len(read.subscriptions(own)) == 9


def test_keys_are_for_their_owner_alone(folder: Path) -> None:
    assert {path.stat().st_mode & 0o077 for path in folder.glob("*.key")} == {0}


@pytest.mark.parametrize("profile", mqtt_profile.names())
def test_a_station_may_write_and_read_what_its_profile_has(profile: str) -> None:
    read = mqtt_profile.load(profile)
    wanted = {("write", row.topic) for row in read.publish} | {("read", row.topic) for row in read.subscribe}
    wanted |= {("write", read.status.topic)} if read.status and read.status.topic else set()
    for access, topic in wanted:
        filled = re.sub("[{].*?[}]|[+#]", "x", topic.replace("{prefix}", read.prefix))
        allowed = [pattern for may, pattern in ACL if may in (access, "readwrite")]
        assert any(topic_matches_sub(pattern, filled) for pattern in allowed), (access, filled)


def test_two_clients_reach_each_other_and_nobody_reaches_other_topics(brokers: Brokers, folder: Path) -> None:
    with started(brokers, folder) as broker:
        own, other = client(broker, folder, "own"), client(broker, folder, "other")
        other.subscribe("#")
        own.publish("elsewhere", b"must not arrive")
        own.publish("5GCroCo/outQueue/v2x/cam", b"must not arrive")
        own.publish("v2x/btp/2001", b"arrives")
        assert other.next().payload == b"arrives"
        own.close()
        other.close()


def test_what_is_shown_of_a_station_is_accepted_by_the_broker(brokers: Brokers, folder: Path) -> None:
    with started(brokers, folder) as broker:
        text = SHOWN["toml"].replace("localhost:8883", f"localhost:{broker.port}")
        (folder / "captain.toml").write_text(text)
        verb, *words = next(line for line in SHOWN["sh try"].splitlines() if " doctor " in line).split()
        assert verb == "captain"
        ended = subprocess.run(
            [sys.executable, "-m", "firmware", *words],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            capture_output=True,
            text=True,
            check=False,
        )
    assert f"mqtts://localhost:{broker.port}: accepts this client, by TLS" in re.sub(r"\s+", " ", ended.stdout)


def test_the_tap_is_started_with_options_that_it_has(brokers: Brokers, folder: Path) -> None:
    with started(brokers, folder) as broker:
        line = SHOWN["sh try"].splitlines()[-1].replace("localhost:8883", f"localhost:{broker.port}")
        ended = subprocess.run(
            [sys.executable, "-m", "firmware", *line.split()[1:], "--duration", "0.2"],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            capture_output=True,
            text=True,
            check=False,
        )
    assert ended.returncode == 0, ended.stderr
