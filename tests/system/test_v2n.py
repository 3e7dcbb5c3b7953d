"""Contract, section 4: V2N against a real broker with TLS and client certificates, seen by an independent client."""

import base64
import os
import re
import signal
from pathlib import Path
from typing import Any

import pytest

from tests.broker.bad import Listener, old_tls, silent
from tests.broker.fixtures import Brokers
from tests.firmware.profile_table import TABLE
from tests.system.conftest import Bench, Launcher
from tests.system.test_contract_tables import pdu_of
from tests.system.user import mark
from tests.system.v2n import HOST, NAME, STATUS, V2n, connected, launched, text, until, until_up

PDU = bytes.fromhex("02020000053900010203")
PAYLOAD = b"vm(2001): <AgIAAAU5AAECAw==>"  # the example of the contract


@pytest.fixture(scope="module")
def shared(launch_shared: Launcher, brokers_shared: Brokers) -> V2n:
    return connected(launch_shared, brokers_shared)


@pytest.fixture
def v2n(shared: V2n) -> V2n:
    """A connected station, shared by the tests of this module."""
    return shared.settled()


# ---------------------------------------------------------------- to the broker


def test_the_example_of_the_contract_to_the_octet(v2n: V2n) -> None:
    v2n.bench.user.send(b"v2x.cam.", PDU)
    message = v2n.hears()
    assert (message.topic, message.payload) == ("v2x/btp/2001", PAYLOAD)
    assert (message.qos, message.is_retained, message.user_properties) == (1, False, ())


@pytest.mark.parametrize(("number", "name", "port", "_"), TABLE)
def test_each_type_is_published_under_its_port(v2n: V2n, number: int, name: str, port: int, _: int) -> None:
    v2n.bench.user.send(b"v2x.%s." % name.encode(), pdu_of(number))
    message = v2n.hears()
    assert (message.topic, message.payload.decode()) == (f"v2x/btp/{port}", text(HOST, port, pdu_of(number)))


@pytest.mark.parametrize("length", [6, 7, 8, 300, 1499, 1500])
def test_every_length_arrives_whole(v2n: V2n, length: int) -> None:
    pdu = mark()[:6] + bytes(range(256)) * 6
    v2n.bench.user.send(b"v2x.cam.", pdu[:length])
    assert v2n.hears().payload.decode() == text(HOST, 2001, pdu[:length])


def test_a_request_is_confirmed_when_the_broker_has_it(v2n: V2n) -> None:
    reports = v2n.bench.make_reports()
    v2n.bench.user.push_pdu(b"v2x.cam.", PDU, label="mine", interfaces=[NAME])
    accepted, sent = reports.confirms_of("mine", 2)
    assert (accepted["outcome"], accepted["interfaces"]) == ("accepted", [NAME])
    assert (sent["outcome"], sent["interface"], sent["reason"]) == ("sent", NAME, None)
    assert v2n.hears().payload == PAYLOAD


def test_a_message_leaves_by_its_g5_and_by_the_broker_once_each(v2n: V2n) -> None:
    v2n.bench.user.send(b"v2x.cam.", one := mark())
    v2n.bench.user.send(b"v2x.cam.", two := mark())
    assert [v2n.bench.air.hear().pdu for _ in range(2)] == [one, two]
    assert [v2n.hears().payload.decode() for _ in range(2)] == [text(HOST, 2001, pdu) for pdu in (one, two)]


def test_a_thousand_messages_all_arrive_in_order(v2n: V2n) -> None:
    sent = [mark() for _ in range(1000)]
    for number, pdu in enumerate(sent):
        v2n.bench.user.push_pdu(b"v2x.cam.", pdu, lifetime_s=30)
        if number % 100 == 99:  # below the queue of an interface
            wanted = sent[number - 99 : number + 1]
            assert [v2n.hears().payload.decode() for _ in wanted] == [text(HOST, 2001, pdu) for pdu in wanted]


# ---------------------------------------------------------------- from the broker


def test_what_another_publishes_reaches_users_with_its_octets_unchanged(v2n: V2n) -> None:
    v2n.observer.publish("v2x/btp/2001", "other(2001): <AgIAAAU5AAECAw==>")
    received = v2n.bench.user.receive()
    assert (received.envelope, received.pdu) == (b"v2x.cam.", PDU)


def test_what_a_broker_cannot_tell_is_zero_in_the_raw_message(v2n: V2n) -> None:
    v2n.says(PDU)
    fields = v2n.bench.user.receive().fields
    assert fields["sec"] > 1_700_000_000
    unknown = {
        key: value for key, value in fields.items() if key not in ("sec", "usec", "local", "payload_size", "pdu")
    }
    assert set(unknown.values()) == {0, bytes(32), bytes(6)}


@pytest.mark.parametrize("topic", ["v2x/btp", "v2x/btp/2001", "v2x/btp/2002"])
def test_both_filters_are_subscribed_to(v2n: V2n, topic: str) -> None:
    v2n.observer.publish(topic, text("other", 2001, pdu := mark()))
    assert v2n.bench.user.receive().pdu == pdu


@pytest.mark.parametrize("qos", [0, 1, 2])
def test_every_quality_of_service_is_delivered_once(v2n: V2n, qos: int) -> None:
    v2n.observer.publish("v2x/btp/2001", text("other", 2001, pdu := mark()), qos=qos)
    assert v2n.bench.user.receive().pdu == pdu
    v2n.hears_nothing_before_a_mark()


@pytest.mark.parametrize(
    "frame", ["{}", "<{}>", "other(2001): <{}> and >more<", "x>y <{}>", "other(2001):<{}>\n", "\0<{}>"]
)
def test_the_text_between_the_first_brackets_counts(v2n: V2n, frame: str) -> None:
    pdu = mark()
    inner = base64.b64encode(pdu).decode()
    v2n.observer.publish("v2x/btp/2001", frame.format(inner if "<" in frame else f"<{inner}>"))
    assert v2n.bench.user.receive().pdu == pdu


def test_own_messages_do_not_come_back(v2n: V2n) -> None:
    v2n.bench.user.send(b"v2x.cam.", mark())
    v2n.hears()
    v2n.hears_nothing_before_a_mark()


def test_a_burst_of_4000_from_the_broker_all_arrives(v2n: V2n) -> None:
    # Two messages of each go to a user who may not have begun to read: the station holds 8192 for one.
    sent = [mark() for _ in range(4000)]
    for pdu in sent:
        v2n.observer.publish("v2x/btp/2001", text("other", 2001, pdu), qos=0)
    heard: list[bytes] = []
    try:
        heard += (v2n.bench.user.receive().pdu for _ in sent)
    except AssertionError as error:
        dropped = v2n.bench.station.drops()
        raise AssertionError(f"{len(heard)} of {len(sent)} came, and then {error}; dropped: {dropped}") from error
    assert heard == sent


# ---------------------------------------------------------------- the connection


def test_it_connects_with_mqtt_5_clean_under_its_own_name(v2n: V2n) -> None:
    assert v2n.broker.says(rf"as {HOST} \(p5, c1, k\d+\)")
    assert v2n.broker.says(rf"{HOST} 1 v2x/btp$")
    assert v2n.broker.says(rf"{HOST} 1 v2x/btp/\+$")


def test_why_it_is_up_names_host_and_port(v2n: V2n) -> None:
    assert f"localhost:{v2n.broker.port}" in until_up(v2n.bench)


def test_the_status_of_the_original_at_start_and_at_stop(launch: Launcher, brokers: Brokers) -> None:
    v2n = connected(launch, brokers)
    message = v2n.observer.next(STATUS)
    assert (message.payload, message.is_retained) == (b"vm: connection established", False)
    v2n.bench.station.stop()
    assert v2n.observer.next(STATUS).payload == b"vm: connection closing - good bye"
    brokers.client(v2n.broker, "marker").publish(STATUS, b"mark")
    assert v2n.observer.until(b"mark") == []  # no last will of one that said good bye


def test_the_last_will_of_a_station_that_was_killed(launch: Launcher, brokers: Brokers) -> None:
    v2n = connected(launch, brokers)
    assert v2n.observer.next(STATUS).payload == b"vm: connection established"
    # The one-file binary was started by another process, which would end it in order.
    os.kill(v2n.bench.station.status()["pid"], signal.SIGKILL)
    assert v2n.observer.next(STATUS).payload == b"vm: lost connection"
    v2n.bench.station.kill()


def test_the_last_will_of_a_client_process_that_was_killed_and_another_takes_over(
    launch: Launcher, brokers: Brokers
) -> None:
    v2n = connected(launch, brokers)
    assert v2n.observer.next(STATUS).payload == b"vm: connection established"
    os.kill(worker_of(v2n.bench), signal.SIGKILL)
    v2n.bench.user.hears_nothing_before_a_mark(v2n.bench.air)  # the other interface goes on
    assert v2n.observer.next(STATUS).payload == b"vm: lost connection"
    assert v2n.observer.next(STATUS).payload == b"vm: connection established"
    until_up(v2n.bench)
    v2n.settled()


def test_own_messages_that_come_back_are_dropped_and_counted(launch: Launcher, brokers: Brokers) -> None:
    v2n = connected(launch, brokers, version="3.1.1")  # which has no noLocal
    v2n.bench.user.send(b"v2x.cam.", mark())
    v2n.hears()
    v2n.hears_nothing_before_a_mark()
    assert v2n.dropped("own-echo", 1)["sample"]
    assert v2n.broker.says(rf"as {HOST} \(p2, c1, k\d+\)")  # mosquitto's name of MQTT 3.1.1


def test_messages_under_its_own_name_are_its_own_whoever_sends_them(launch: Launcher, brokers: Brokers) -> None:
    v2n = connected(launch, brokers)
    v2n.says(mark(), host=HOST)
    v2n.hears_nothing_before_a_mark()
    assert v2n.dropped("own-echo", 1)["sample"]


def test_a_broker_that_comes_back_is_subscribed_to_again(launch: Launcher, brokers: Brokers) -> None:
    v2n = connected(launch, brokers)
    v2n.broker.kill()
    why = until(v2n.bench, lambda state, _: state != "up")
    assert f"localhost:{v2n.broker.port}" in why
    v2n.bench.user.hears_nothing_before_a_mark(v2n.bench.air)
    v2n.broker.start()
    until_up(v2n.bench)
    again = brokers.client(v2n.broker, "again").subscribe("v2x/btp/+", no_local=True)
    V2n(v2n.bench, v2n.broker, again).settled()


def test_two_stations_hear_each_other_through_the_broker(launch: Launcher, brokers: Brokers) -> None:
    v2n = connected(launch, brokers)
    other = launched(launch, brokers, v2n.broker.url, host="rsu", client_id="rsu")
    until_up(other)
    v2n.bench.user.send(b"v2x.cam.", pdu := mark())
    assert other.user.receive().pdu == pdu
    other.user.send(b"v2x.cam.", pdu := mark())
    assert v2n.bench.user.receive().pdu == pdu


def test_a_password_is_taken_from_its_file(launch: Launcher, brokers: Brokers, tmp_path: Path) -> None:
    broker = brokers(passwords={"vehicle": "secret"})
    file = tmp_path / "password"
    file.write_text("secret\n")
    file.chmod(0o600)
    until_up(launched(launch, brokers, broker.url, username="vehicle", password_file=str(file)))


# ---------------------------------------------------------------- causes of failure, reported by name


def why_not(launch: Launcher, brokers: Brokers, url: str, words: str, **options: Any) -> Bench:
    """The station says why it is not connected, and its other interface works."""
    bench = launched(launch, brokers, url, **options)
    why = until(bench, lambda state, why: state != "up" and re.search(words, why, re.IGNORECASE) is not None)
    assert re.search(r"localhost:\d+", why), f"{why} names no host and port"
    bench.user.hears_nothing_before_a_mark(bench.air)
    return bench


@pytest.mark.parametrize(
    ("server", "words"),
    [
        ("expired_server", "expired"),
        ("other_server", "for another host"),
        ("strange_server", "not known"),
    ],
)
def test_a_brokers_bad_certificate_is_refused_by_name(
    launch: Launcher, brokers: Brokers, server: str, words: str
) -> None:
    broker = brokers(server=getattr(brokers.certificates, server))
    why_not(launch, brokers, broker.url, words)
    assert not [line for line in broker.log if f" as {HOST} " in line]


@pytest.mark.parametrize(
    ("client", "words"),
    [(None, "certificate"), ("expired_client", "expired"), ("strange_client", "unknown|CA")],
)
def test_an_own_certificate_that_the_broker_refuses(
    launch: Launcher, brokers: Brokers, client: str | None, words: str
) -> None:
    shown = getattr(brokers.certificates, client) if client else None
    files = (
        {"certificate": str(shown.certificate), "key": str(shown.key)} if shown else {"certificate": None, "key": None}
    )
    why_not(launch, brokers, brokers().url, words, **files)


def test_a_broker_with_old_tls_alone(launch: Launcher, brokers: Brokers) -> None:
    context = old_tls(brokers.certificates.authority, brokers.certificates.server)
    listener = brokers.keep(Listener(silent, context))
    why_not(launch, brokers, f"mqtts://localhost:{listener.port}", "version|TLS 1")


def test_a_wrong_password(launch: Launcher, brokers: Brokers, tmp_path: Path) -> None:
    broker = brokers(passwords={"vehicle": "secret"})
    file = tmp_path / "password"
    file.write_text("wrong\n")
    file.chmod(0o600)
    why_not(launch, brokers, broker.url, "not authori[sz]ed|password", username="vehicle", password_file=str(file))


def test_nobody_listens(launch: Launcher, brokers: Brokers) -> None:
    why_not(launch, brokers, f"mqtts://localhost:{launch.port()}", "refuses")


def worker_of(bench: Bench) -> int:
    """The process with the client: a descendant of the station."""
    assert bench.station.child is not None
    waiting = [bench.station.child.pid]
    while waiting:
        pid = waiting.pop()
        words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
        if b"--worker" in words and b"mqtt" in words:
            return pid
        waiting += map(int, Path(f"/proc/{pid}/task/{pid}/children").read_text().split())
    raise AssertionError("no process with an MQTT client")
