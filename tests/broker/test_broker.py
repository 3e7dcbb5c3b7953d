"""The broker, the client and the certificates that other tests lean on."""

import socket
import ssl

import pytest

from tests.broker.client import Client
from tests.broker.fixtures import Brokers
from tests.broker.mosquitto import Bridge


def test_a_client_with_a_certificate_publishes_and_is_delivered_to(brokers: Brokers) -> None:
    broker = brokers()
    reader = brokers.client(broker, "reader").subscribe("v2x/#")
    writer = brokers.client(broker, "writer")

    writer.publish("v2x/btp/2001", b"one", qos=1, expiry_s=5, user_properties=[("a", "b")])

    message = reader.next()
    assert (message.topic, message.payload, message.qos, message.is_retained) == ("v2x/btp/2001", b"one", 1, False)
    assert message.expiry_s == 5
    assert message.user_properties == (("a", "b"),)


def test_the_plain_listener_is_the_same_broker_and_speaks_3_1_1(brokers: Brokers) -> None:
    broker = brokers()
    reader = brokers.client(broker, "reader").subscribe("t")

    with Client(broker.plain_port, "old", version=3) as old:
        old.publish("t", b"one")

    assert reader.next().payload == b"one"


def test_nothing_is_left_behind_by_what_was_retained_and_cleared(brokers: Brokers) -> None:
    broker = brokers()
    writer = brokers.client(broker, "writer")
    writer.publish("t", b"kept", retain=True)
    writer.publish("t", b"", retain=True)
    writer.publish("u", b"kept", retain=True)

    reader = brokers.client(broker, "reader").subscribe("t", "u")

    message = reader.next()
    assert (message.topic, message.is_retained) == ("u", True)


def test_the_last_will_comes_of_a_client_that_was_cut_and_not_of_one_that_left(brokers: Brokers) -> None:
    broker = brokers()
    reader = brokers.client(broker, "reader").subscribe("t")
    Client(broker.plain_port, "polite", will=("t", b"of the polite")).close()
    Client(broker.plain_port, "gone", will=("t", b"of the gone")).cut()

    assert reader.next().payload == b"of the gone"


def test_noLocal_keeps_own_messages_away(brokers: Brokers) -> None:
    broker = brokers()
    one = brokers.client(broker, "one").subscribe("t", no_local=True)
    one.publish("t", b"own")
    brokers.client(broker, "two").publish("t", b"other")
    assert one.next().payload == b"other"


@pytest.mark.parametrize("wrong", ["none", "strange", "expired"])
def test_a_client_without_a_good_certificate_is_refused(brokers: Brokers, wrong: str) -> None:
    broker = brokers()
    known = brokers.certificates
    shown = {"none": None, "strange": known.strange_client, "expired": known.expired_client}[wrong]
    with pytest.raises((ConnectionError, AssertionError)):
        Client(broker.port, authority=broker.authority, identity=shown)
    assert broker.says("OpenSSL Error|SSL", 1)


@pytest.mark.parametrize(
    ("server", "why"),
    [
        ("expired_server", "certificate has expired"),
        ("other_server", "Hostname mismatch"),
        ("strange_server", "unable to get local issuer certificate|self-signed certificate in certificate chain"),
    ],
)
def test_a_bad_server_is_bad_in_its_own_way(brokers: Brokers, server: str, why: str) -> None:
    broker = brokers(server=getattr(brokers.certificates, server))
    context = ssl.create_default_context(cafile=str(broker.authority.certificate))
    with (
        socket.create_connection(("127.0.0.1", broker.port)) as line,
        pytest.raises(ssl.SSLCertVerificationError, match=why),
    ):
        context.wrap_socket(line, server_hostname="localhost")


def test_a_broker_with_passwords_takes_nobody_else(brokers: Brokers) -> None:
    broker = brokers(passwords={"vm": "secret"})
    brokers.client(broker, user=("vm", "secret"))
    with pytest.raises(AssertionError, match=r"[Nn]ot authori[sz]ed"):
        brokers.client(broker, "other", user=("vm", "wrong"))


def test_a_broker_comes_back_on_the_same_ports(brokers: Brokers) -> None:
    broker = brokers()
    brokers.client(broker, "before")
    broker.kill()
    broker.start()
    brokers.client(broker, "after")


def test_two_bridged_brokers_pass_messages_on_both_ways(brokers: Brokers) -> None:
    far = brokers()
    near = brokers(bridges=(Bridge(far.plain_port, ["# both 1"]),))
    far.says(r"New client connected .* as .*to-\d+")
    here, there = brokers.client(near, "here").subscribe("t/#"), brokers.client(far, "there").subscribe("t/#")
    near.says(r"to-\d+")

    for number in range(100):  # the bridge subscribes at the far side when it is connected
        there.publish("t/back", b"%d" % number)
        if not here.messages.empty():
            break
    assert here.next().topic == "t/back"
    here.publish("t/forth", b"one")
    assert there.next("t/forth").payload == b"one"


def test_a_frozen_broker_answers_when_it_thaws(brokers: Brokers) -> None:
    broker = brokers()
    reader, writer = brokers.client(broker, "reader").subscribe("t"), brokers.client(broker, "writer")
    broker.freeze()
    writer.publish("t", b"one", qos=0)
    assert reader.messages.empty()
    broker.thaw()
    assert reader.next().payload == b"one"
