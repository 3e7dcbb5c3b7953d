"""Options of an mqtt interface, and files that they name: each mistake has a remedy."""

import errno
import os
from pathlib import Path

import pytest

import drivers.mqtt.uplink
from board.runtime.describe import read
from board.runtime.errors import BlockedError, ConfigurationError
from drivers.mqtt.driver import Mqtt
from drivers.mqtt.options import MqttOptions
from tests.drivers.fake_worker import FakeWorker
from tests.drivers.host import SHARED

URL = "mqtts://broker.example:8883"


@pytest.fixture(autouse=True)
def _fake(monkeypatch):
    monkeypatch.setattr(drivers.mqtt.uplink, "Worker", FakeWorker)
    monkeypatch.setattr(FakeWorker, "made", [])


@pytest.mark.parametrize(
    ("options", "what", "remedy"),
    [
        ({"url": "http://broker.example"}, 'url: neither mqtts:// nor mqtt://: "http://broker.example"', "mqtts://"),
        ({"url": ""}, 'url: neither mqtts:// nor mqtt://: ""', "mqtts://broker.example:8883"),
        ({"url": "mqtts://:99999"}, 'url: no host: "mqtts://:99999"', "mqtts://broker.example:8883"),
        ({"url": "mqtts://me:word@broker.example"}, "url: names a user", "username and password_file"),
        ({"url": "mqtts://a/b"}, 'url: text after the port: "mqtts://a/b"', "mqtts://broker.example:8883"),
        ({"url": "mqtts://[::1"}, 'url: invalid IPv6 address in brackets: "mqtts://[::1"', "mqtts://"),
        ({"url": "mqtts://a:abc"}, 'url: invalid port: "mqtts://a:abc"', "1 to 65535"),
        ({"url": "mqtts://a:65536"}, 'url: invalid port: "mqtts://a:65536"', "1 to 65535"),
        ({"url": "mqtts://a:0"}, 'url: invalid port: "mqtts://a:0"', "1 to 65535"),
        ({"url": "mqtt://broker.example"}, "without TLS to another machine", "plaintext = true"),
        ({"url": "mqtt://localhost", "ca": "x"}, "without TLS", "mqtts://"),
        ({"profile": "vcaptian"}, 'unknown profile "vcaptian"', "did you mean vcaptain?"),
        ({"certificate": "c.pem"}, "certificate is given without key", "both or none"),
        ({"key": "c.key"}, "key is given without certificate", "both or none"),
        ({"username": "me"}, "username is given without password_file", "both or none"),
        ({"password_file": "f"}, "password_file is given without username", "both or none"),
        ({"client_id": "a/b"}, "client_id: 'a/b' has '/'", "it is one level of a topic"),
        ({"client_id": "a\0"}, "client_id: 'a\\x00' has '\\x00'", "leave it out"),
        ({"client_id": "x" * 256}, "client_id: has 256 octets", "255 at most"),
        ({"host": "vm(1)"}, "host: 'vm(1)' has '('", "payloads have (port) behind it"),
        ({"uuid": "a b"}, "uuid: 'a b' has ' '", "leave it out"),
        (
            {"prefix": "v2x/#"},
            "prefix: 'v2x/#' has '#'",
            "MQTT does not allow wildcards in topics of published messages",
        ),
        ({"prefix": "$share/g"}, "prefix: '$share/g' starts with $", "the broker's own"),
        (
            {"status_topic": "a/+/#"},
            "status_topic: 'a/+/#' has '+'",
            "MQTT does not allow wildcards in topics of published messages",
        ),
        ({"status_topic": "$SYS/x"}, "status_topic: '$SYS/x' starts with $", "the broker's own"),
        ({"status_topic": "a\n"}, "has '\\n'", "leave it out"),
        ({"device": "a-name-much-too-long"}, "invalid name of a network device", "ip -brief link"),
        ({"depths": [18, 14]}, "[18, 14] is not a minimum and a maximum", "[14, 18]"),
        ({"depths": [14]}, "is not a minimum and a maximum", "[14, 18]"),
        ({"depths": [0, 14]}, "depths[0]: 0 is out of range", "at least 1 and at most 30"),
        (
            {"profile": "nap", "editions": ["cpm-9"]},
            "editions: unknown edition 'cpm-9'",
            "one of cpm-2.1.1, cpm-2.1.1-ext",
        ),
        (
            {"editions": ["cpm-2.1.1"]},
            "editions: option without effect: profile vcaptain never encodes messages",
            "remove the key",
        ),
        ({"version": 4}, "version: 4 is not a choice", "known: 5"),
        ({"qos": 2}, "qos: 2 is out of range", "at most 1"),
        ({"keep_alive_s": 1}, "keep_alive_s: 1 is out of range", "at least 5"),
        ({"max_in_flight": 0}, "max_in_flight: 0 is out of range", "at least 1"),
        ({"keepalive_s": 20}, "keepalive_s: is not a known key", "did you mean keep_alive_s?"),
    ],
)
def test_option_with_a_mistake_is_refused_by_its_key_with_a_remedy(options, what, remedy):
    with pytest.raises(ConfigurationError) as caught:
        read(MqttOptions, {"url": URL, **options}, "captain.toml: interfaces.v2n")
    assert caught.value.message.startswith("captain.toml: interfaces.v2n")
    assert what in caught.value.message
    assert remedy in caught.value.message


@pytest.mark.parametrize(
    "options",
    [
        {"url": "mqtt://127.0.0.1"},
        {"url": "mqtt://broker.example", "plaintext": True},
        {"profile": "my.toml"},
        {"status_topic": "v2xstatus", "prefix": "fleet/a"},
        {"certificate": "c.pem", "key": "c.key", "username": "me", "password_file": "f"},
    ],
)
def test_options_that_go_together_are_taken(options):
    assert read(MqttOptions, {"url": URL, **options}, "captain.toml: interfaces.v2n")


@pytest.mark.parametrize("option", ["ca", "profile"])
def test_option_that_names_an_absent_file_fails_the_start_by_its_path(host, tmp_path, option):
    path = tmp_path / "absent.toml"
    with pytest.raises(BlockedError) as caught:
        Mqtt(MqttOptions(url=URL, **{option: str(path)}), SHARED).start(host)
    assert caught.value.message == f"{option} {path}: {os.strerror(errno.ENOENT)}"
    assert option in caught.value.hint
    assert FakeWorker.made == []


def test_a_fifo_is_no_file_of_certificates_and_is_not_waited_for(host, tmp_path):
    path = tmp_path / "ca.pem"
    os.mkfifo(path)
    with pytest.raises(BlockedError, match="not a regular file"):
        Mqtt(MqttOptions(url=URL, ca=str(path)), SHARED).start(host)


@pytest.mark.parametrize("option", ["key", "password_file"])
@pytest.mark.parametrize("mode", [0o640, 0o604, 0o660])
def test_a_secret_that_others_may_read_fails_the_start_with_the_command_that_helps(host, tmp_path, option, mode):
    path = Path(tmp_path / "secret")
    path.write_text("x")
    path.chmod(mode)
    other = "certificate" if option == "key" else "username"
    (tmp_path / "other").write_text("x")
    more = {other: str(tmp_path / "other")} if option == "key" else {other: "me"}
    driver = Mqtt(MqttOptions(url=URL, **{option: str(path)}, **more), SHARED)
    with pytest.raises(BlockedError, match="others may read it") as caught:
        driver.start(host)
    assert caught.value.hint == f"chmod 600 {path}"
    path.chmod(0o600)
    driver.start(host)
    assert len(FakeWorker.made) == 1
