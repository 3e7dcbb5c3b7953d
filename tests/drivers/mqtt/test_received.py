"""Messages of a broker in the session: delivered, refused, own echoes."""

from drivers.mqtt.client.echo import KEPT_S, MOST, Echoes
from drivers.reason import Reason
from drivers.wire.v2n import talk
from drivers.wire.v2n.message import ReceivedPdu
from tests.drivers.mqtt.model import CAM, Bench, vcaptain


def test_a_received_pdu_is_passed_on_with_its_moment_port_and_source():
    bench = vcaptain().accept()
    bench.deliver("v2x/btp/2001", b"other(2001): <AgIAAAU5AAECAwQ=>")
    assert [talk.parse_received(one) for one in bench.all(talk.RECEIVED)] == [
        (1_795_182_426_000_000_000, ReceivedPdu(CAM, 2001, "other"))
    ]


def test_a_delivery_that_is_refused_is_counted_once_a_beat_with_a_sample():
    bench = Bench().accept()
    for _ in range(3):
        bench.deliver("v2x/cam", b"\x01")
    bench.deliver("elsewhere", CAM)
    bench.deliver("v2x/cam", CAM, is_retained=True)
    assert bench.drops == {}
    bench.run(1.0)
    assert bench.drops == {Reason.SHORT_PDU: 3, Reason.TOPIC: 1, Reason.RETAINED: 1}
    bench.run(5.0)
    assert sum(bench.drops.values()) == 5


def test_another_station_that_says_the_same_is_heard():
    # Two roadside units send the same MAPEM. With MQTT 5.0, a broker does not return a client's own messages (noLocal).
    bench = Bench().accept()
    bench.send(1)
    bench.deliver("v2x/cam", CAM)
    assert len(bench.all(talk.RECEIVED)) == 1


def test_the_same_payload_in_another_topic_is_no_echo():
    bench = Bench(version="3.1.1").accept()
    bench.send(1)
    bench.deliver("v2x/denm", CAM)
    assert len(bench.all(talk.RECEIVED)) == 1


def test_own_messages_that_come_back_by_an_old_broker_are_known_for_five_seconds():
    bench = Bench(version="3.1.1").accept()
    bench.send(1)
    bench.run(KEPT_S - 0.1)
    bench.deliver("v2x/cam", CAM)
    bench.deliver("v2x/cam", CAM + b"\x00")
    assert len(bench.all(talk.RECEIVED)) == 1
    bench.run(0.2)
    bench.deliver("v2x/cam", CAM)
    assert len(bench.all(talk.RECEIVED)) == 2
    bench.run(1.0)
    assert bench.drops == {Reason.OWN_ECHO: 1}


def test_echoes_are_known_from_when_they_left_last():
    echoes = Echoes()
    echoes.add("t", b"a", 0.0)
    echoes.add("t", b"b", 1.0)
    echoes.add("t", b"a", 4.0)
    assert [echoes.holds("t", b"a", 8.9), echoes.holds("t", b"b", 6.0), echoes.holds("t", b"a", 9.0)] == [
        True,
        False,
        False,
    ]


def test_echoes_are_bounded():
    echoes = Echoes()
    for number in range(2 * MOST):
        echoes.add("t", b"%d" % number, 0.0)
    assert len(echoes._until) <= MOST
    assert echoes.holds("t", b"%d" % (2 * MOST - 1), 1.0)
