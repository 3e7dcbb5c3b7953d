"""MQTT process at a real broker: messages in both directions, TLS, outages."""

import base64
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator

import pytest

from board.runtime.worker import Worker
from drivers.message import Position
from drivers.reason import Reason
from drivers.wire.quadkey import tile
from drivers.wire.v2n import talk
from tests.broker.bad import Listener, old_tls, silent
from tests.broker.fixtures import Brokers, brokers, brokers_shared, certificates
from tests.broker.mosquitto import Mosquitto
from tests.drivers.mqtt.station import CAM, DENM, Station, secured, settings, written
from tests.said import tells
from tests.virtual import VirtualLoop

__all__ = ["brokers", "brokers_shared", "certificates"]

Start = Callable[..., Station]

TILES = """
name = "tiles"
[[publish]]
topic = "t/{quadkey}"
payload = "binary"
[[subscribe]]
topic = "t/{quadkey}/#"
payload = "binary"
"""


@pytest.fixture
def start() -> Iterator[Start]:
    """Return a function that starts processes; they are ended after the test."""
    made: list[Station] = []

    def start(*given, **how) -> Station:
        made.append(Station(*given, **how))
        return made[-1]

    yield start
    for one in made:
        one.close()


@pytest.fixture(scope="module")
def broker(brokers_shared: Brokers) -> Mosquitto:
    """Return a shared broker, which is sufficient for most tests."""
    return brokers_shared()


def of(sender: str, pdu: bytes, port: int = 2001) -> str:
    return f"{sender}({port}): <{base64.b64encode(pdu).decode()}>"


# Messages in both directions.


def test_the_legacy_contract_is_kept_both_ways(brokers, broker, certificates, start):
    observer = brokers.client(broker).subscribe("v2x/#")
    station = start(secured(broker.url, certificates.authority, certificates.client)).up()
    assert observer.next()[:4] == ("v2x/status", b"vm: connection established", 1, False)
    station.send(1, CAM)
    station.until(lambda: 1 in station.sent)
    assert station.sent[1] == (None, "")
    assert observer.next()[:5] == ("v2x/btp/2001", b"vm(2001): <AgIAAAU5AAECAwQ=>", 1, False, 59)
    before = time.time_ns()
    observer.publish("v2x/btp/2002", of("other", DENM, 2002))
    station.until(lambda: station.received)
    (received,) = station.received
    assert (received.pdu, received.btp_port, received.source) == (DENM, 2002, "other")
    assert before <= station.moments_ns[0] <= time.time_ns()
    station.close()
    assert observer.next("v2x/status").payload == b"vm: connection closing - good bye"
    with brokers.client(broker, "last") as last:
        last.publish("v2x/end", b"end")
    assert [message.topic for message in observer.until(b"end")] == []  # no last will


def test_the_process_of_a_station_does_the_same_and_its_last_will_comes_when_it_is_killed(
    brokers, broker, certificates
):
    observer = brokers.client(broker, "watch").subscribe("v2x/status")
    loop = VirtualLoop(patience_s=10.0)
    said: list[bytes] = []
    pids: list[str] = []
    wanted = secured(broker.url, certificates.authority, certificates.client, client_id="vm2", host="vm2")
    worker = Worker(loop, "mqtt", said.append, lambda is_up, why: pids.append(why), command=program())
    worker.start()
    loop.run_until(lambda: pids)
    worker.send(wanted.message())
    loop.run_until(lambda: any(one[0] == talk.STATE and talk.parse_state(one)[0] for one in said))
    assert observer.next().payload == b"vm2: connection established"
    assert os.getpriority(os.PRIO_PROCESS, int(pids[0].split()[1])) > os.getpriority(os.PRIO_PROCESS, 0)
    os.kill(int(pids[0].split()[1]), signal.SIGKILL)
    assert observer.next().payload == b"vm2: lost connection"
    worker.finish()
    loop.close()


def program() -> list[str]:
    return [sys.executable, "-P", "-m", "firmware"]


@pytest.mark.parametrize("version", [5, "3.1.1"])
def test_each_version_of_mqtt_carries_both_ways_and_no_echo(brokers, broker, start, version):
    observer = brokers.client(broker, "o").subscribe("v2x/+")
    station = start(settings(broker.plain_url, version=version, profile="raw", client_id=f"v{version}")).up()
    station.send(1, CAM)
    assert observer.next("v2x/cam").payload == CAM
    observer.publish("v2x/denm", DENM)
    station.until(lambda: station.received and 1 in station.sent)
    station.until(lambda: station.drops or version == 5)
    assert [one.pdu for one in station.received] == [DENM]
    assert station.drops == ({} if version == 5 else {Reason.OWN_ECHO: 1})


@pytest.mark.parametrize("qos", [0, 1])
def test_a_thousand_messages_come_in_their_order(brokers, broker, start, qos):
    observer = brokers.client(broker, "o").subscribe("v2x/btp/2001")
    station = start(settings(broker.plain_url, qos=qos)).up()
    for number in range(1000):
        station.until(lambda number=number: number - len(station.sent) < 20)
        station.send(number, CAM + number.to_bytes(2))
    station.until(lambda: len(station.sent) == 1000)
    assert {outcome for outcome, _ in station.sent.values()} == {None}
    assert [observer.next().payload for _ in range(1000)] == [
        of("vm", CAM + n.to_bytes(2)).encode() for n in range(1000)
    ]


def test_a_burst_of_the_broker_is_received_whole_by_a_station_that_reads(brokers, broker, start):
    observer = brokers.client(broker, "o")
    station = start(settings(broker.plain_url)).up()
    for number in range(2000):
        observer.publish("v2x/btp/2001", of("other", CAM + number.to_bytes(2)), qos=0)
        station.until(lambda number=number: len(station.received) > number - 200)
    station.until(lambda: len(station.received) == 2000)
    assert [one.pdu[-2:] for one in station.received] == [number.to_bytes(2) for number in range(2000)]


def test_what_a_station_is_too_slow_for_is_dropped_and_counted_and_no_denm_is(brokers, broker, start):
    observer = brokers.client(broker, "o")
    station = start(settings(broker.plain_url)).up()
    sent = 0
    # If the process is slower than the broker, the station reads meanwhile and fewer messages are dropped: send more.
    while station.drops.get(Reason.RECEIVE_QUEUE, 0) <= 1000 and sent < 30_000:
        for number in range(sent, sent := sent + 3000):
            pdu = DENM if number % 100 == 0 else CAM
            observer.publish("v2x/btp/2001", of("other", pdu + number.to_bytes(2)), qos=1)
        station.until(lambda: len(station.received) + station.drops.get(Reason.RECEIVE_QUEUE, 0) == sent)
    assert station.drops[Reason.RECEIVE_QUEUE] > 1000
    assert [one.pdu for one in station.received if one.pdu[1] == 1] == [
        DENM + number.to_bytes(2) for number in range(0, sent, 100)
    ]


def test_an_expired_request_does_not_reach_the_broker(brokers, broker, start):
    observer = brokers.client(broker, "o").subscribe("v2x/btp/+")
    station = start(settings(broker.plain_url)).up()
    station.send(1, CAM, lifetime=-0.1)
    station.send(2, DENM)
    station.until(lambda: len(station.sent) == 2)
    assert station.sent[1][0] is Reason.EXPIRED
    assert observer.next().payload == of("vm", DENM).encode()


def test_rubbish_is_counted_by_name_and_what_follows_is_received(brokers, broker, start):
    observer = brokers.client(broker, "o")
    observer.publish("v2x/btp/9", of("other", CAM), retain=True)
    try:
        station = start(settings(broker.plain_url)).up()
        for payload in ("<", "<>", "<###>", "no brackets", '{"json": 1}', b"\xff\xfe", of("other", b"1"), ""):
            observer.publish("v2x/btp/2001", payload)
        observer.publish("v2x/btp/" + "\u202e" * 9, of("other", CAM))
        observer.publish("v2x/btp/2001", of("other", bytes(1501)))
        observer.publish("v2x/btp/2001", bytes(10_000_000))
        observer.publish("v2x/btp/2001", of("other", CAM))
        station.until(lambda: station.received and sum(station.drops.values()) >= 12)
    finally:
        observer.publish("v2x/btp/9", b"", retain=True)
    assert station.is_up
    assert [one.pdu for one in station.received] == [CAM]
    assert station.drops == {
        Reason.RETAINED: 1,
        Reason.PAYLOAD: 7,  # with that of 10 MB
        Reason.EMPTY_PDU: 1,
        Reason.SHORT_PDU: 1,
        Reason.LONG_PDU: 1,
        Reason.TOPIC: 1,
    }


@pytest.mark.parametrize("version", [5, "3.1.1"])
def test_payload_of_ten_megabytes_is_counted_and_not_parsed(brokers, broker, start, version):
    observer = brokers.client(broker, "o")
    for qos in (0, 1):
        observer.publish("v2x/btp/2001", b"<" + bytes(10_000_000) + b">", qos=qos, retain=True)
        try:
            station = start(settings(broker.plain_url, version=version, client_id=f"large{version}{qos}")).up()
            observer.publish("v2x/btp/2001", of("other", CAM))
            station.until(lambda station=station: station.received and station.drops)
        finally:
            observer.publish("v2x/btp/2001", b"", retain=True)
        assert station.drops[Reason.PAYLOAD] == 1
        assert station.samples[Reason.PAYLOAD].startswith(b"v2x/btp/2001")
        assert "73728 octets" in station.whys[Reason.PAYLOAD]
        assert [is_up for is_up, _ in station.states] == [False, True]


# TLS and who may come in.


def tls_cases() -> dict[str, tuple[Callable, str]]:
    """Return for each TLS case: the function that creates broker and settings, and the words of the expected error."""
    return {
        "expired": (lambda c: ({"server": c.expired_server}, {}), "its certificate has expired"),
        "host": (lambda c: ({"server": c.other_server}, {}), "its certificate is for another host"),
        "authority": (
            lambda c: ({"server": c.strange_server}, {}),
            "signed by an authority that is not known here; name that one's certificate in ca",
        ),
        "none": (lambda c: ({}, {"identity": None}), "asks for a certificate of this client"),
        "none-1.3": (
            lambda c: ({"version": "tlsv1.3"}, {"identity": None}),
            "asks for a certificate of this client; name one in certificate and key",
        ),
        "own expired": (lambda c: ({}, {"identity": c.expired_client}), "certificate of this client: it has expired"),
        "own stranger": (
            lambda c: ({}, {"identity": c.strange_client}),
            "knows no authority that has signed the certificate of this client",
        ),
    }


@pytest.mark.parametrize("case", tls_cases())
def test_tls_that_fails_is_named_with_what_to_do(brokers, certificates, start, case):
    make, words = tls_cases()[case]
    of_broker, of_client = make(certificates)
    broker = brokers(**of_broker)
    identity = of_client.get("identity", certificates.client)
    station = start(secured(broker.url, certificates.authority, identity))
    why = station.down(words)
    assert why.startswith(f"mqtts://localhost:{broker.port}: ")
    assert not any(is_up for is_up, _ in station.states)


def test_a_broker_of_old_tls_is_named(certificates, start):
    with Listener(silent, old_tls(certificates.authority, certificates.server)) as listener:
        station = start(secured(f"mqtts://localhost:{listener.port}", certificates.authority, certificates.client))
        station.down(f"localhost:{listener.port}", "does not support TLS 1.2 or later")


def test_a_port_without_tls_is_named(broker, certificates, start):
    station = start(secured(f"mqtts://localhost:{broker.plain_port}", certificates.authority, certificates.client))
    station.down("check that this port takes TLS")


def test_a_port_with_tls_is_named(broker, start):
    station = start(settings(f"mqtt://127.0.0.1:{broker.port}"))
    station.down("mqtts:// in url")


def test_handshake_that_stalls_is_given_up(certificates, start):
    with Listener(silent) as listener:
        url = f"mqtts://localhost:{listener.port}"
        station = start(secured(url, certificates.authority, certificates.client, connect_s=0.3))
        station.down("TLS handshake", "0.3 s")


def test_an_address_is_checked_against_the_certificate_as_well(broker, certificates, start):
    start(secured(f"mqtts://127.0.0.1:{broker.port}", certificates.authority, certificates.client)).up()


@pytest.mark.parametrize("unread", [0, 3])
@pytest.mark.parametrize(
    ("is_killed", "last_word"), [(True, b"vm: lost connection"), (False, b"vm: connection closing - good bye")]
)
def test_who_leaves_with_messages_unread_has_said_good_bye_and_who_was_killed_has_not(
    brokers, start, unread, is_killed, last_word
):
    broker = brokers()
    observer = brokers.client(broker, "observer").subscribe("v2x/status", no_local=True)
    station = start(settings(broker.plain_url)).up()
    assert observer.next().payload == b"vm: connection established"
    for _ in range(unread):
        observer.publish("v2x/btp/2002", of("other", DENM, 2002))
    station.close(is_killed=is_killed)
    assert observer.next().payload == last_word


def test_a_password_lets_in_and_a_wrong_one_does_not(brokers, start, tmp_path):
    broker = brokers(passwords={"me": "right"})
    right = written(tmp_path / "right", "right\n")
    wrong = written(tmp_path / "wrong", "wrong\n")
    start(settings(broker.plain_url, username="me", password_file=right)).up()
    station = start(settings(broker.plain_url, username="me", password_file=wrong, client_id="other"))
    station.down("refuses the connection: ", "password_file")
    station.close()
    station = start(settings(broker.plain_url, username="me", password_file=wrong, client_id="old", version="3.1.1"))
    station.down("refuses the connection: ", "password_file")
    anonymous = start(settings(broker.plain_url, client_id="nobody"))
    anonymous.down("refuses the connection: ")


def test_a_password_that_was_corrected_is_used_at_the_next_try(brokers, start, tmp_path):
    broker = brokers(passwords={"me": "right"})
    path = tmp_path / "password"
    station = start(settings(broker.plain_url, username="me", password_file=written(path, "wrong")))
    station.down("refuses")
    written(path, "right")
    station.up()


def test_key_that_others_may_read_is_refused_before_anything_is_connected(certificates, start, tmp_path):
    identity = certificates.client
    key = written(tmp_path / "key", identity.key.read_text(), 0o640)
    station = start(settings("mqtts://localhost:1", certificate=str(identity.certificate), key=key))
    station.until(lambda: station.faults)
    ((what, remedy),) = station.faults
    assert tells(what, f"key {key}: ", "0640")
    assert remedy == f"chmod 600 {key}"
    assert station.states == []


# Outages.


def test_what_a_broker_that_dies_has_not_acknowledged_reaches_the_next(brokers, start):
    broker = brokers()
    station = start(settings(broker.plain_url, keep_alive_s=5)).up()
    broker.freeze()
    for number in range(20):
        station.send(number, CAM + bytes([number]))
    station.read(0.2)
    assert not station.sent
    broker.kill()
    station.down(f":{broker.plain_port}: ")
    broker.start()
    station.up().until(lambda: len(station.sent) == 20)
    assert {outcome for outcome, _ in station.sent.values()} == {None}


def test_a_broker_that_comes_back_is_subscribed_again(brokers, start):
    broker = brokers()
    station = start(settings(broker.plain_url)).up()
    broker.stop()
    station.down(f":{broker.plain_port}: ")
    broker.start()
    station.up()
    with brokers.client(broker, "o") as observer:
        observer.publish("v2x/btp/2001", of("other", CAM))
        station.until(lambda: station.received)


def test_a_request_expires_on_time_while_the_broker_is_away(brokers, start):
    broker = brokers()
    station = start(settings(broker.plain_url)).up()
    broker.stop()
    station.down("refuses the connection; no broker listens there")
    before = time.monotonic()
    station.send(1, lifetime=0.3)
    station.until(lambda: station.sent)
    assert station.sent[1][0] is Reason.EXPIRED
    assert 0.29 <= time.monotonic() - before < 1.0


def test_a_kept_session_delivers_what_came_meanwhile(brokers, broker, start):
    kept = settings(broker.plain_url, clean=False, session_expiry_s=60, client_id="kept")
    start(kept).up().close()
    with brokers.client(broker, "o") as observer:
        observer.publish("v2x/btp/2001", of("other", CAM))
    station = start(kept).up()
    station.until(lambda: station.received)
    start(settings(broker.plain_url, client_id="kept")).up()  # and a clean start ends it


@pytest.mark.parametrize("version", [5, "3.1.1"])
def test_tiles_of_an_earlier_process_are_not_delivered_any_more(brokers, broker, start, tmp_path, version):
    profile = written(tmp_path / "tiles.toml", TILES)
    kept = settings(broker.plain_url, clean=False, client_id=f"tiles{version}", profile=profile, version=version)
    first = start(kept)
    first.move(481_000_000, 117_000_000)
    first.until(lambda: any(one["subscriptions"] == 9 for one in first.details))
    first.close()
    second = start(kept)
    second.until(lambda: any(one["connections"] for one in second.details))
    with brokers.client(broker, "o") as observer:
        observer.publish("t/" + "/".join(tile(Position(481_000_000, 117_000_000), 17).digits()), CAM, qos=0)
        second.move(-338_000_000, 1_512_000_000)
        second.until(lambda: second.details[-1]["subscriptions"] == 9)
        observer.publish("t/" + "/".join(tile(Position(-338_000_000, 1_512_000_000), 17).digits()), DENM, qos=0)
        second.until(lambda: bool(second.received))
    assert [one.pdu for one in second.received] == [DENM]
    start(settings(broker.plain_url, client_id=f"tiles{version}")).up()  # which ends the session


def test_two_clients_of_the_same_name_put_each_other_out_ever_more_slowly_and_say_why(broker, start):
    both = [start(settings(broker.plain_url, client_id="same")) for _ in range(2)]
    for station in both:
        station.until(
            lambda station=station: any("another client has the same client_id" in why for _, why in station.states)
        )
