"""Topic `message.<type>.`: delivered messages with their metadata, for those who ask for it by name."""

import json
from typing import Any

import zmq

from tests.reference.topics import undocumented
from tests.system.conftest import Bench, Launcher
from tests.system.user import JOIN_MS, mark

CAM = bytes.fromhex("02029b260aa393e6005a6f0da4ae7bfb35a238230a6a3d4290581a90a3f67e02e6928b37fee9fea6103fdf93d980")


def next_message(sub: "zmq.Socket[bytes]") -> tuple[bytes, dict[str, Any], bytes]:
    topic, body, pdu = sub.recv_multipart()
    said = json.loads(body)
    assert undocumented("message", said) == []
    return topic, said, pdu


def join(bench: Bench, sub: "zmq.Socket[bytes]") -> int:
    """Wait until messages arrive, and return the sequence of the last one."""
    while not sub.poll(JOIN_MS):
        bench.air.send(mark())
    bench.air.send(last := mark())
    while True:
        _, said, pdu = next_message(sub)
        if pdu == last:
            return int(said["sequence"])


def test_message_topic_has_metadata_and_pdu_and_numbers_each_type(launch_shared: Launcher) -> None:
    bench = launch_shared()
    reports = bench.make_reports()
    run = reports.next("status.")[1]["run"]
    reports.sub.unsubscribe(b"")
    reports.sub.subscribe(b"message.")
    last = join(bench, reports.sub)
    bench.air.send(CAM)
    topic, said, pdu = next_message(reports.sub)
    assert (topic, pdu, said["interface"], said["run"], said["sequence"]) == (
        b"message.cam.", CAM, "g5", run, last + 1,
    )  # fmt: skip


def test_message_topic_is_not_sent_to_a_subscription_to_everything(launch_shared: Launcher) -> None:
    bench = launch_shared()
    everything = bench.make_reports()
    bench.air.send(CAM)
    while not (found := everything.sub.recv_multipart())[0].startswith(b"indication."):
        assert not found[0].startswith(b"message.")
