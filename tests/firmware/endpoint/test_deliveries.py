"""Messages with their metadata: sequence, budget, and only for users who want them."""

import json
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import pytest
import zmq

from drivers.message import Indication, Position, RxInfo
from drivers.reason import Reason
from firmware.endpoint.deliveries import BUDGET, PERIOD_S, Deliveries
from firmware.endpoint.peers.interest import CountedTopics
from firmware.endpoint.publisher import Publisher
from firmware.endpoint.report import run_id
from firmware.endpoint.users import Users
from firmware.routing.drops import Drops
from firmware.topics import Topics, TypeRow
from tests.firmware.doubles import pdu_of
from tests.virtual import VirtualLoop

CAM, DENM = 2, 1


class Bench:
    """The users' publisher with deliveries, and a subscriber of the report port."""

    def __init__(self, loop: VirtualLoop) -> None:
        self.loop = loop
        self.context = zmq.Context()
        self.topics = Topics()
        self.users = Users(loop, self.context, "inproc://users", self.topics, Drops(), None)
        self.reports = Publisher(loop, self.context, "inproc://report", "report", Drops(), CountedTopics())
        self.drops = Drops()
        self.deliveries = Deliveries(loop, self.reports, self.drops)
        self.subscriber = self.context.socket(zmq.SUB)
        self.subscriber.rcvhwm = 0
        self.subscriber.subscribe(b"message.")
        self.subscriber.connect("inproc://report")

    def deliver(self, message_id: int = CAM, rx: RxInfo | None = None, count: int = 1) -> None:
        one = Indication(
            self.topics.by_number[message_id], pdu_of(message_id), "g5", 7, self.loop.clock(), rx or RxInfo()
        )
        self.users.publish([one] * count)

    def heard(self) -> list[tuple[bytes, dict[str, Any], bytes]]:
        found = []
        while self.subscriber.poll(0):
            topic, body, pdu = self.subscriber.recv_multipart()
            found.append((topic, json.loads(body), pdu))
        return found

    def sequences(self) -> list[int]:
        return [said["sequence"] for _, said, _ in self.heard()]

    def close(self) -> None:
        self.subscriber.close()
        self.users.publisher.close()
        self.reports.close()
        self.context.term()


@pytest.fixture
def bench() -> Iterator[Bench]:
    with closing(VirtualLoop()) as loop, closing(Bench(loop)) as bench:
        bench.users.listeners.append(bench.deliveries)
        yield bench


def test_message_of_a_wanted_type_comes_with_its_metadata_and_pdu(bench: Bench) -> None:
    bench.deliveries.want(b"message.cam.", True)
    rx = RxInfo(rssi_dbm=-71, position=Position(487668000, 114321000), data_rate=12, traffic_class=2, hop_limit=1)
    bench.deliver(rx=rx)
    ((topic, said, pdu),) = bench.heard()
    assert (topic, pdu) == (b"message.cam.", pdu_of(CAM))
    assert (said["run"], said["sequence"], said["type"], said["rssi_dbm"]) == (run_id(), 1, "cam", -71)
    assert said["position"] == {"latitude": 48.7668, "longitude": 11.4321}
    assert (said["data_rate"], said["traffic_class"], said["hop_limit"]) == (12, 2, 1)


def test_message_without_a_known_type_comes_by_the_nameless_topic(bench: Bench) -> None:
    bench.deliveries.want(b"message..", True)
    bench.deliver(200)
    assert [(topic, said["type"]) for topic, said, _ in bench.heard()] == [(b"message..", "")]


def test_sequence_counts_the_messages_of_its_type_before_the_first_subscription_too(bench: Bench) -> None:
    bench.deliver(CAM, count=3)
    bench.deliver(DENM)
    bench.deliveries.want(b"message.cam.", True)
    bench.deliver(CAM, count=2)
    bench.deliver(DENM)
    assert bench.sequences() == [4, 5]


def test_type_that_nobody_wants_any_more_is_counted_and_not_sent(bench: Bench) -> None:
    bench.deliveries.want(b"message.cam.", True)
    bench.deliver()
    bench.deliveries.want(b"message.cam.", False)
    bench.deliver()
    bench.deliveries.want(b"message.cam.", True)
    bench.deliver()
    assert bench.sequences() == [1, 3]


def test_messages_beyond_the_budget_of_their_type_are_numbered_and_counted_as_drops(bench: Bench) -> None:
    bench.deliveries.want(b"message.cam.", True)
    bench.deliveries.want(b"message.denm.", True)
    bench.deliver(count=BUDGET + 10)
    assert bench.sequences() == [*range(1, BUDGET + 1)]
    assert bench.drops.total("report", Reason.DELIVERY_LIMIT) == 10
    bench.deliver(DENM)
    assert bench.sequences() == [1]
    bench.loop.run_for(PERIOD_S)
    bench.deliver()
    assert bench.sequences() == [BUDGET + 11]


def test_type_that_is_added_while_another_is_wanted_is_delivered(bench: Bench) -> None:
    bench.deliveries.want(b"message.cam.", True)
    kind = bench.topics.add(TypeRow(200, "hello", 3000, 3000))
    assert kind is not None
    bench.deliver(200)
    assert bench.heard() == []
    bench.deliveries.want(b"message.hello.", True)
    bench.deliver(200)
    assert [topic for topic, _, _ in bench.heard()] == [b"message.hello."]
