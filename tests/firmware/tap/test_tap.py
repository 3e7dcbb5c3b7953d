"""`captain v2n-tap` against a real broker: TLS, what cannot be read, a broker that goes and comes back."""

import json
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from paho.mqtt.client import DisconnectFlags, MQTTMessage
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.reasoncodes import ReasonCode

from board.runtime.errors import InterfaceError, StationError
from drivers.mqtt.client.window import Accepted
from drivers.mqtt.options import MqttOptions
from drivers.reason import Reason
from drivers.wire.v2n.message import Delivery, RefusedError
from firmware import cli
from firmware.cli import CUT_OFF
from firmware.tap.connection import DROPPED, Connection
from firmware.tap.counts import Counts
from tests.broker.bad import Listener, silent
from tests.broker.fixtures import Brokers
from tests.broker.mosquitto import Mosquitto
from tests.firmware.tap.copies import ROOT, Copy, publish

CAM = "vm(2001): <AgIAAAU5AAECAw==>"


def idle_connection(
    said: list[str],
    take: Callable[[Delivery], None] = lambda delivery: None,
    refuse: Callable[[RefusedError, Delivery], None] = lambda error, delivery: None,
    answer_s: float = 10.0,
    **options: str,
) -> Connection:
    """A connection that is not opened."""
    settings = MqttOptions(url="mqtt://localhost", **options)
    return Connection(settings, [("t", 0)], take, refuse, said.append, answer_s)


def secured(broker: Mosquitto, brokers: Brokers, *more: str) -> list[str]:
    """Options for TLS with a good certificate."""
    client = brokers.certificates.client
    ca = str(broker.authority.certificate)
    return ["--url", broker.url, "--ca", ca, "--certificate", str(client.certificate), "--key", str(client.key), *more]


def test_over_TLS_with_a_client_certificate_each_message_is_an_object(brokers: Brokers) -> None:
    broker = brokers()
    with Copy(*secured(broker, brokers, "--json", "--count", "1")) as copy:
        brokers.client(broker, "writer").publish("v2x/btp/2001", CAM)
        assert copy.result()[0] == 0
        (record,) = map(json.loads, copy.lines)
    assert record.pop("received") > 1.7e9
    assert record == {
        "type": "cam",
        "station_id": 1337,
        "message_id": 2,
        "protocol_version": 2,
        "octets": 10,
        "btp_port": 2001,
        "topic": "v2x/btp/2001",
        "source": "vm",
        "hex": "02020000053900010203",
    }


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"--ca": "stranger"}, "signed by an authority that is not known here"),
        ({"--certificate": "", "--key": ""}, "asks for a certificate of this client"),
        # The broker's alert may be lost with the connection: it has not read CONNECT when it closes that.
        ({"--certificate": "strange_client", "--key": "strange_client"}, "knows no authority|before CONNACK"),
    ],
)
def test_each_failure_of_TLS_ends_it_with_its_reason(
    brokers: Brokers, capsys: pytest.CaptureFixture[str], changed: dict[str, str], words: str
) -> None:
    broker = brokers()
    pairs = dict(zip(*[iter(secured(broker, brokers))] * 2, strict=True))
    for option, name in changed.items():
        made = getattr(brokers.certificates, name) if name else None
        path = getattr(made, option.removeprefix("--"), None) if option != "--ca" else made.certificate
        pairs[option] = str(path or "")
    assert cli.main(["v2n-tap", *[word for pair in pairs.items() for word in pair]]) == 1
    said = capsys.readouterr().err
    assert f"mqtts://localhost:{broker.port}: " in said
    assert re.search(words, said)


def test_a_broker_that_is_not_there_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["v2n-tap", "--url", "mqtt://127.0.0.1:1"]) == 1
    assert "mqtt://127.0.0.1:1: 127.0.0.1: refuses the connection" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--url", "mqtt://broker.example"], "without TLS to another machine"),
        (["--url", "http://localhost"], "neither mqtts:// nor mqtt://"),
        (["--url", "mqtt://localhost", "--username", "me"], "username is given without password_file"),
        (["--url", "mqtt://localhost", "--session-expiry-s", "60"], "only with --client-id"),
        (["--url", "mqtt://localhost", "--keep", "2"], "only with --record"),
        (["--url", "mqtt://localhost", "--record", "x.jsonl", "--keep", "2"], "only with --max-octets"),
    ],
)
def test_what_does_not_go_together_is_wrong_usage(
    options: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["v2n-tap", *options]) == cli.USAGE_ERROR
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    "options",
    [
        *(["--tile", "4"], ["--group", "a/b"], ["--type", "nosuch"], ["--count", "0"]),
        *(["--filter", text] for text in ("a/#/b", "a/+b", "", "$share/g/a", "a\udcff", "a\x1b", "a" * 70_000)),
    ],
)
def test_a_value_that_cannot_be_is_wrong_usage(options: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(["v2n-tap", "--url", "mqtt://localhost", *options])
    assert ended.value.code == cli.USAGE_ERROR
    assert f"argument {options[0]}" in capsys.readouterr().err


def test_what_cannot_be_read_is_counted_by_reason_and_the_next_message_passes(brokers: Brokers) -> None:
    broker = brokers()
    with Copy("--url", broker.plain_url, "--json", "--count", "1", "--filter", "v2x/#") as copy:
        writer = brokers.client(broker, "writer")
        for topic, payload in (
            ("v2x/btp/2001", "no brackets"),
            ("v2x/btp/2001", "vm(2001): <no base64>"),
            ("v2x/btp/2001", "vm(2001): <AgI=>"),
            ("v2x/other", CAM),
        ):
            writer.publish(topic, payload)
        writer.publish("v2x/btp/2001", CAM)
        _, said = copy.result()
    assert "1 messages in" in said
    assert re.search("unreadable: 2 payload: .*no base64", said)
    assert "unreadable: 1 short-pdu" in said
    assert re.search("unreadable: 1 topic: .*v2x/other", said)


def test_it_connects_again_and_says_how_long_it_was_without(brokers: Brokers) -> None:
    broker = brokers()
    with Copy("--url", broker.plain_url, "--profile", "raw", "--json") as copy:
        publish(brokers.client(broker, "one"), 0, 3)
        copy.wait_for(3)
        broker.kill()
        broker.start()
        broker.says("captain-tap-")
        broker.says(r"captain-tap-\S+ \d v2x|\$share")
        publish(brokers.client(broker, "two"), 3, 3)
        copy.wait_for(6)
        code, said = copy.end()
    assert code == 0
    assert copy.numbers == list(range(6))
    assert "connecting again" in said
    assert re.search(r"connection lost 1 x, \d+\.\d s without it", said)


def test_another_client_of_its_name_is_suspected(brokers: Brokers) -> None:
    # MQTT 3.1.1: a broker of version 5 may name the other client, as mosquitto 2.0.21 does and 2.0.11 does not.
    broker = brokers()
    with Copy("--url", broker.plain_url, "--client-id", "same", "--version", "3.1.1", "--quiet") as copy:
        brokers.client(broker, "same")
        broker.says("New client connected from .* as same", 3)  # it came back
        _, said = copy.end()
    assert "another client has the same client_id" in said


def test_a_broker_that_names_the_other_client_ends_it_with_a_remedy() -> None:
    connection = idle_connection([], client_id="same")
    connection._network._is_accepted = True
    flags, code = DisconnectFlags(True), ReasonCode(PacketTypes.DISCONNECT, identifier=0x8E)
    connection._network._on_disconnect(None, None, flags, code, None)
    with pytest.raises(StationError, match="another client has connected with the same client_id, same") as ended:
        connection.turn(0.0)
    assert "--client-id" in ended.value.hint


def test_text_of_a_broker_that_ends_the_connection_is_not_its_reason_code() -> None:
    said: list[str] = []
    connection = idle_connection(said)
    connection.is_up, connection._up_at = True, 1.0
    connection.lost("ends the connection: Server shutting down (Session taken over)", 7.0, code=0x8B)
    assert said[0].endswith("(Session taken over) (after 6.0 s); connecting again")


def test_while_it_cannot_connect_again_it_says_each_other_reason_once() -> None:
    said: list[str] = []
    connection = idle_connection(said)
    connection.is_up, connection._up_at = True, 1.0
    connection.lost("has closed the connection", 7.0)
    for why in (*["refuses it"] * 3, *["no route to it"] * 2, "refuses it"):
        connection.failed(why, 8.0)
    assert said == [
        "captain: mqtt://localhost:1883: has closed the connection (after 6.0 s); connecting again",
        *(
            f"captain: mqtt://localhost:1883: {why}; trying again and again"
            for why in ("refuses it", "no route to it", "refuses it")
        ),
    ]


def test_a_topic_that_is_no_utf_8_is_counted_and_the_next_message_passes() -> None:
    counts, taken = Counts(), list[Delivery]()
    connection = idle_connection([], taken.append, counts.refuse)
    for topic in (b"v2x/\xff\xfe", b"v2x/cam"):
        message = MQTTMessage(topic=topic)
        message.payload = b"\x02\x02"
        connection._network._on_message(None, None, message)
    connection.turn(0.0)
    assert taken == [("v2x/cam", b"\x02\x02", False, False)]
    assert counts.unread[Reason.TOPIC] == (1, r"topic b'v2x/\xff\xfe' is not UTF-8", b"\x02\x02")


def test_a_delivery_that_the_broker_repeats_is_counted() -> None:
    taken: list[Delivery] = []
    connection = idle_connection([], taken.append)
    for is_repeated in (False, True):
        connection.received(Delivery("t", b"x", is_repeated=is_repeated), 1.0)
    assert connection.counts["repeated"] == 1
    assert len(taken) == 2


def test_an_answer_that_does_not_come_ends_the_first_try_with_its_name() -> None:
    connection = idle_connection([], answer_s=0.0)
    connection._answer_by, connection._awaited = 0.0, "no SUBACK"
    with pytest.raises(InterfaceError, match="mqtt://localhost:1883: no SUBACK within 0 s"):
        connection.turn(0.0)


def test_a_subscription_that_is_refused_is_named_and_one_of_sys_is_not_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    connection = idle_connection([])
    asked: list[object] = []
    monkeypatch.setattr(connection._network, "subscribe", asked.append)
    connection.connected(Accepted(), 1.0)
    with pytest.raises(InterfaceError, match="refuses the subscription to t: Not authorized"):
        connection.subscribed({"t": "Not authorized"}, 1.0)
    connection.subscribed({}, 2.0)
    assert asked == [[("t", 0)], [(DROPPED, 0)]]
    connection.subscribed({DROPPED: "Not authorized"}, 2.0)
    assert connection.is_up


def test_a_broker_that_stalls_is_waited_for_no_longer_than_is_wanted(
    brokers: Brokers, capsys: pytest.CaptureFixture[str]
) -> None:
    mute = brokers.keep(Listener(silent))
    began = time.monotonic()
    for scheme in ("mqtt", "mqtts"):
        url = f"{scheme}://127.0.0.1:{mute.port}"
        assert cli.main(["v2n-tap", "--url", url, "--duration", "0.5", "--quiet"]) == 1
        assert f"captain: {url}: " in capsys.readouterr().err
    assert time.monotonic() - began < 4.0  # a second each


def test_Ctrl_C_leaves_the_broker_and_has_the_status_of_a_shell(brokers: Brokers) -> None:
    broker = brokers()
    with Copy("--url", broker.plain_url, "--client-id", "tapped") as copy:
        code, said = copy.end(signal.SIGINT)
    assert code == 130
    assert "0 messages in" in said
    broker.says("Client tapped disconnected")


def test_only_wanted_types_are_shown_and_the_others_counted(brokers: Brokers) -> None:
    broker = brokers()
    with Copy("--url", broker.plain_url, "--lines", "--type", "denm", "--count", "1") as copy:
        writer = brokers.client(broker, "writer")
        writer.publish("v2x/btp/2001", CAM)
        writer.publish("v2x/btp/2002", "vm(2002): <AgEAAAU5AAECAw==>")
        _, said = copy.result()
    assert re.fullmatch(
        r"\d\d:\d\d:\d\d\.\d{3}  denm of station 1337  10 octets  port 2002  vm  v2x/btp/2002\n", copy.lines[0]
    )
    assert "1 of other types" in said


def test_the_table_has_a_row_for_each_type_and_station(brokers: Brokers) -> None:
    broker = brokers()
    with Copy("--url", broker.plain_url, "--count", "3") as copy:
        writer = brokers.client(broker, "writer")
        for _ in range(3):
            writer.publish("v2x/btp/2001", CAM)
        assert copy.result()[0] == 0
    assert re.search(r"^cam +1337 +3 ", "".join(copy.lines), re.MULTILINE)


def test_it_records_while_it_shows(brokers: Brokers, tmp_path: Path) -> None:
    broker = brokers()
    options = ("--record", str(tmp_path / "drive.jsonl"), "--max-messages", "4", "--count", "10", "--quiet")
    with Copy("--url", broker.plain_url, "--profile", "raw", *options) as copy:
        publish(brokers.client(broker, "writer"), 0, 10)
        assert copy.result()[0] == 0
    parts = [path.read_text().splitlines() for path in sorted(tmp_path.iterdir())]
    assert [len(part) for part in parts] == [4, 4, 2]
    assert [json.loads(line)["hex"][12:] for part in parts for line in part] == [f"{at:08x}" for at in range(10)]


@pytest.mark.parametrize("version", ["5", "3.1.1"])
def test_ten_megabytes_are_never_parsed_and_the_next_message_passes(brokers: Brokers, version: str) -> None:
    broker = brokers()
    with Copy("--url", broker.plain_url, "--json", "--version", version, "--count", "1") as copy:
        writer = brokers.client(broker, "writer")
        writer.publish("v2x/btp/2001", b"<" + b"A" * 10_000_000 + b">")
        writer.publish("v2x/btp/2001", CAM)
        code, said = copy.result()
    assert code == 0
    assert len(copy.lines) == 1
    assert "unreadable: 1 payload" in said


def test_a_reader_that_leaves_ends_it_quietly(brokers: Brokers) -> None:
    broker = brokers()
    command = [sys.executable, "-m", "firmware", "v2n-tap", "--url", broker.plain_url, "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stderr.readline()
        process.stdout.close()
        brokers.client(broker, "writer").publish("v2x/btp/2001", CAM)
        said = process.stderr.read()
        assert process.wait(20) == CUT_OFF
    assert "Traceback" not in said


def test_what_the_broker_says_that_it_dropped_is_told_from_the_first_count_on() -> None:
    connection = idle_connection([])
    for count in (b"7", b"9", b"rubbish", b"8" * 30, b"2", b"12"):
        connection.received(Delivery(DROPPED, count), 1.0)
    assert connection.counts["dropped"] == 5
