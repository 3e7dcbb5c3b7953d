"""Bad input of a broker: counted by reason; other interfaces go on."""

import json
import re
from base64 import b64encode
from typing import Any

import pytest

from tests.broker import mute
from tests.broker.bad import FullBacklog, Listener, closing_after, saying, silent
from tests.broker.fixtures import Brokers
from tests.broker.mute import Mute
from tests.system.conftest import Bench, Launcher
from tests.system.user import mark
from tests.system.v2n import HOST, NAME, V2n, connected, launched, text, until, until_up

CAM = bytes.fromhex("020200000539")
JSON = {"message_type": "cam", "message_format": "asn1/uper", "message": {"payload": b64encode(CAM).decode()}}


@pytest.fixture(scope="module")
def shared(launch_shared: Launcher, brokers_shared: Brokers) -> V2n:
    return connected(launch_shared, brokers_shared)


@pytest.fixture
def v2n(shared: V2n) -> V2n:
    return shared.settled()


def count_of(v2n: V2n, reason: str) -> int:
    return v2n.bench.station.drops().get((NAME, reason), 0)


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (b"", "payload"),
        (b"other(2001): ", "payload"),
        (b"other(2001): AgIAAAU5", "payload"),
        (b"other(2001): <AgIAAAU5", "payload"),
        (b"other(2001): AgIAAAU5>", "payload"),
        (b"other(2001): >AgIAAAU5<", "payload"),
        (b"other(2001): <AgIAAAU5=>", "payload"),
        (b"other(2001): <AgIAAAU>", "payload"),
        (b"other(2001): <AgIA AAU5>", "payload"),
        (b"other(2001): <AgIA\nAAU5>", "payload"),
        (b"other(2001): <AgIA-_U5>", "payload"),
        (b"other(2001): <<AgIAAAU5>>", "payload"),
        (b"other(2001): <\xff\xfe>", "payload"),
        (b"\xff\xfe\x00\x01", "payload"),
        (json.dumps(JSON).encode(), "payload"),
        (b'{"cam": "<x>"}', "payload"),
        (b"<" * 60_000, "payload"),
        (b"other(2001): <" + b"A" * 70_000 + b">", "payload"),
        (b"other(2001): <>", "empty-pdu"),
        (b"other(2001): <AgIAAAU=>", "short-pdu"),
        (text("other", 2001, bytes(1501)).encode(), "long-pdu"),
    ],
)
def test_a_payload_that_is_none_is_counted_with_a_sample(v2n: V2n, payload: bytes, reason: str) -> None:
    before = count_of(v2n, reason)
    v2n.observer.publish("v2x/btp/2001", payload)
    v2n.hears_nothing_before_a_mark()
    row = v2n.dropped(reason, before + 1)
    assert row["sample"] or not payload or reason == "empty-pdu"
    assert row["meaning"]
    assert "octets" in row["detail"] or row["detail"].startswith("v2x/btp/2001: ")


@pytest.mark.parametrize(
    "topic", ["v2x/btp/x", "v2x/btp/65536", "v2x/btp/-1", "v2x/btp/", "v2x/btp/+1", "v2x/btp/２００１"]
)
def test_a_topic_outside_the_template_is_counted(v2n: V2n, topic: str) -> None:
    if "+" in topic:
        topic = topic.replace("+", "%2B")  # no client may publish with a wildcard
    before = count_of(v2n, "topic")
    v2n.observer.publish(topic, text("other", 2001, mark()))
    v2n.hears_nothing_before_a_mark()
    assert v2n.dropped("topic", before + 1)["sample"]


@pytest.mark.parametrize("topic", ["v2x/btp/2001/more", "v2x", "V2X/btp/2001", "v2x/status", "other", "/v2x/btp/2001"])
def test_what_is_not_subscribed_to_is_not_even_counted(v2n: V2n, topic: str) -> None:
    before = v2n.bench.station.drops()
    v2n.observer.publish(topic, text("other", 2001, mark()))
    v2n.hears_nothing_before_a_mark()
    assert v2n.bench.station.drops() == before


def test_a_port_that_no_type_has_is_counted(v2n: V2n) -> None:
    before = count_of(v2n, "btp-port")
    v2n.says(mark(), port=9999)
    v2n.hears_nothing_before_a_mark()
    assert v2n.dropped("btp-port", before + 1)["sample"]


@pytest.mark.parametrize("version", [5, "3.1.1"])
def test_ten_megabytes_are_counted_and_not_parsed(launch: Launcher, brokers: Brokers, version: int | str) -> None:
    v2n = connected(launch, brokers, version=version)
    v2n.observer.publish("v2x/btp/2001", b"<" * 10_000_000)
    v2n.hears_nothing_before_a_mark()
    assert bytes.fromhex(v2n.dropped("payload", 1)["sample"]).startswith(b"v2x/btp/2001")
    assert v2n.bench.station.status()["interfaces"][NAME]["restarts"] == 0


def test_what_the_broker_had_kept_is_counted_and_not_passed_on(launch: Launcher, brokers: Brokers) -> None:
    broker = brokers()
    early = brokers.client(broker, "early")
    early.publish("v2x/btp/2001", text("other", 2001, mark()), retain=True)
    early.publish("v2x/btp/2002", b"rubbish", retain=True)
    v2n = connected(launch, brokers, broker)
    v2n.hears_nothing_before_a_mark()
    assert v2n.dropped("retained", 2)["sample"]


def test_a_flood_of_rubbish_is_counted_to_the_last(v2n: V2n) -> None:
    before = count_of(v2n, "payload")
    for _ in range(3000):
        v2n.observer.publish("v2x/btp/2001", b"other(2001): <rubbish", qos=0)
    v2n.hears_nothing_before_a_mark()
    v2n.dropped("payload", before + 3000)


# ---------------------------------------------------------------- peers that are not brokers


def is_unaffected(bench: Bench) -> None:
    """The other interface works both ways, and what waits for the broker is bounded."""
    for _ in range(300):
        bench.user.send(b"v2x.cam.", pdu := mark())
        assert bench.air.hear().pdu == pdu
    bench.user.hears_nothing_before_a_mark(bench.air)
    queue = bench.station.status()["interfaces"][NAME]["queue"]
    assert queue["length"] <= queue["capacity"]


@pytest.mark.parametrize(
    "listener",
    [
        pytest.param(FullBacklog, id="no answer to SYN"),
        pytest.param(lambda: Listener(silent), id="the TLS handshake stalls"),
        pytest.param(lambda: Listener(closing_after(0)), id="closes at once"),
        pytest.param(lambda: Listener(saying(b"HTTP/1.1 400 Bad Request\r\n\r\n")), id="is a web server"),
    ],
)
def test_what_is_no_broker_holds_nobody_up(launch: Launcher, brokers: Brokers, listener: Any) -> None:
    port = brokers.keep(listener()).port
    bench = launched(launch, brokers, f"mqtts://localhost:{port}")
    is_unaffected(bench)
    why = until(bench, lambda state, why: state != "up" and str(port) in why)
    assert "localhost" in why


@pytest.mark.parametrize("kind", [mute.CONNACK, mute.SUBACK])
def test_a_broker_that_never_acknowledges_is_not_up(launch: Launcher, brokers: Brokers, kind: int) -> None:
    broker = brokers.keep(Mute(frozenset({kind})))
    bench = plain(launch, brokers, broker.port)
    broker.next(mute.CONNECT if kind == mute.CONNACK else mute.SUBSCRIBE)
    is_unaffected(bench)
    assert bench.station.status()["interfaces"][NAME]["state"] != "up"


def test_without_PUBACK_a_request_expires_and_says_so(launch: Launcher, brokers: Brokers) -> None:
    broker = brokers.keep(Mute(frozenset({mute.PUBACK})))
    bench = plain(launch, brokers, broker.port)
    until_up(bench)
    reports = bench.make_reports()
    bench.user.push_pdu(b"v2x.cam.", mark(), label="mine", interfaces=[NAME], lifetime_s=0.3)
    _, dropped = reports.confirms_of("mine", 2)
    assert (dropped["outcome"], dropped["reason"]) == ("dropped", "expired")
    is_unaffected(bench)


@pytest.mark.parametrize(("code", "words"), [(0x87, "not authori[sz]ed"), (0x8A, "banned")])
def test_a_refusal_is_told_in_the_brokers_words(launch: Launcher, brokers: Brokers, code: int, words: str) -> None:
    bench = plain(launch, brokers, brokers.keep(Mute(connack=code)).port)
    until(bench, lambda state, why: state != "up" and re.search(words, why, re.IGNORECASE) is not None)
    is_unaffected(bench)


def test_a_subscription_that_is_refused_is_told_beside_that_it_is_up(launch: Launcher, brokers: Brokers) -> None:
    bench = plain(launch, brokers, brokers.keep(Mute(suback=0x87)).port)
    until(bench, lambda state, why: state == "up" and re.search("v2x/btp.*not authori[sz]ed", why, re.I) is not None)
    is_unaffected(bench)


def test_a_publication_that_the_broker_refuses_is_a_failed_request(launch: Launcher, brokers: Brokers) -> None:
    broker = brokers.keep(Mute(puback=0x97))  # quota exceeded
    bench = plain(launch, brokers, broker.port)
    until_up(bench)
    reports = bench.make_reports()
    bench.user.push_pdu(b"v2x.cam.", mark(), label="mine", interfaces=[NAME])
    _, failed = reports.confirms_of("mine", 2)
    assert (failed["outcome"], failed["reason"]) == ("dropped", "send-failed")


@pytest.mark.parametrize(
    "octets",
    [
        pytest.param(b"\xff" * 64, id="a reserved type"),
        pytest.param(b"\x30\xff\xff\xff\xff\xff", id="a length of five octets"),
        pytest.param(b"\x30\x02\x00\xff", id="a topic beyond the packet"),
        pytest.param(b"\x40\x02\xff\xff", id="an acknowledgement of nothing"),
        pytest.param(b"\x20\x03\x00\x00\x00" * 3, id="connected again and again"),
        pytest.param(mute.publication("v2x/btp/2001", b"\xff" * 70_000), id="longer than was announced"),
        pytest.param(b"\x30\x07\x00\x02\xff\xfe\x00ab", id="a topic that is no text"),
        pytest.param(b"\x30\x09\x00\x01v\x04\x7f\x00\x00\x00b", id="an unknown property"),
    ],
)
def test_octets_that_are_no_mqtt_cost_a_connection_at_most(launch: Launcher, brokers: Brokers, octets: bytes) -> None:
    broker = brokers.keep(Mute())
    bench = plain(launch, brokers, broker.port)
    until_up(bench)
    broker.throw(octets)
    is_unaffected(bench)
    until_up(bench)
    publication = mute.publication("v2x/btp/2001", text("other", 2001, pdu := mark()).encode())
    broker.throw(publication)
    # The connection that is given up may still be the one that is up.
    bench.user.forget_until(pdu, lambda: broker.throw(publication))


def plain(launch: Launcher, brokers: Brokers, port: int) -> Bench:
    """A station that speaks to a broker without TLS."""
    return launched(launch, brokers, f"mqtt://127.0.0.1:{port}", ca=None, certificate=None, key=None, host=HOST)
