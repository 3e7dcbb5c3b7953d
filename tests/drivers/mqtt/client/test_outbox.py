"""Outbox of the MQTT process while the station is busy."""

import socket

import pytest

from drivers.mqtt.client.outbox import DEPTH, MOST_SAID, Outbox
from drivers.reason import Reason
from drivers.wire.v2n import talk
from drivers.wire.v2n.message import ReceivedPdu

CAM = bytes.fromhex("0202000005390001020304")
DENM = bytes.fromhex("0201000005390001020304")
FULL = b"\x99" * 1000


class Bench:
    """Outbox with the station's end of its channel, and a list of dropped messages."""

    def __init__(self) -> None:
        self.near, self.far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.far.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 8192)
        self.near.setblocking(False)
        self.dropped: list[bytes] = []
        self.outbox = Outbox(self.far, frozenset({1}), self.dropped.append)

    def fill(self) -> None:
        """Fill the channel, as if the station were busy."""
        while not self.outbox.is_waiting:
            self.outbox.say(FULL)

    def heard(self) -> list[bytes]:
        """Return all further messages that the station reads, without those that filled the channel."""
        found: list[bytes] = []
        while True:
            try:
                found.append(self.near.recv(65536))
            except BlockingIOError:
                if not self.outbox.is_waiting:
                    return [one for one in found if one != FULL]
                self.outbox.flush()

    def receive(self, pdu: bytes) -> None:
        self.outbox.say(talk.received(1, ReceivedPdu(pdu, 2001, "other")))


@pytest.fixture
def bench():
    made = Bench()
    yield made
    made.near.close()
    made.far.close()


def pdus(messages: list[bytes]) -> list[bytes]:
    return [talk.parse_received(one)[1].pdu for one in messages if one[0] == talk.RECEIVED]


def test_what_a_station_can_read_is_sent_at_once(bench):
    bench.receive(CAM)
    assert not bench.outbox.is_waiting
    assert pdus([bench.near.recv(65536)]) == [CAM]


def test_what_waits_keeps_its_order_behind_answers_and_denms(bench):
    bench.fill()
    sent = [CAM + b"1", DENM + b"2", CAM + b"3", DENM + b"4"]
    for pdu in sent:
        bench.receive(pdu)
    bench.outbox.say(talk.sent(7))
    heard = bench.heard()
    assert heard[0] == talk.sent(7)
    assert pdus(heard) == [DENM + b"2", DENM + b"4", CAM + b"1", CAM + b"3"]


def test_the_oldest_makes_room_and_a_denm_only_when_there_is_nothing_else(bench):
    bench.fill()
    for number in range(DEPTH):
        bench.receive((DENM if number % 2 else CAM) + number.to_bytes(2))
    for number in range(DEPTH):
        bench.receive(DENM + (DEPTH + number).to_bytes(2))
    dropped = [int.from_bytes(pdu[-2:]) for pdu in bench.dropped]
    assert dropped == [*range(0, DEPTH, 2), *range(1, DEPTH, 2)]
    assert len(pdus(bench.heard())) == DEPTH


def test_answers_are_never_dropped_and_signs_of_life_do_not_pile_up(bench):
    bench.fill()
    for number in range(1000):
        bench.outbox.say(talk.sent(number))
        bench.outbox.say(talk.ALIVE_NOW)
        bench.outbox.say(talk.details({"n": number}))
    heard = bench.heard()
    assert [talk.parse_sent(one)[0] for one in heard if one[0] == talk.SENT] == list(range(1000))
    assert len(heard) <= 1000 + MOST_SAID


def test_states_and_drops_do_not_pile_up_and_are_said_to_be_taken_or_not(bench):
    bench.fill()
    taken = [bench.outbox.say(talk.state(bool(number % 2), str(number))) for number in range(1000)]
    taken += [bench.outbox.say(talk.dropped(Reason.TOPIC, 1)) for _ in range(1000)]
    assert sum(taken) <= MOST_SAID
    assert len(bench.heard()) == sum(taken)
    assert bench.outbox.say(talk.state(True, "now"))


def test_a_station_that_has_left_is_no_error(bench):
    bench.near.close()
    for _ in range(3):
        bench.receive(CAM)
    bench.outbox.flush()
    assert not bench.outbox.is_waiting
