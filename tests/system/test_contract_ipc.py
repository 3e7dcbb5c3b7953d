"""Contract, section 1: the two sockets of interface processes, and the golden vectors of section 3 through them."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
import zmq

from tests.system.conftest import Bench, Launcher
from tests.system.rawrx import decode
from tests.system.test_contract_raw import GOLDEN, PDU
from tests.system.user import mark


class Process(NamedTuple):
    """Interface process: PUB of one frame to ipc_in, SUB of two frames from ipc_out."""

    bench: Bench
    out: "zmq.Socket[bytes]"
    into: "zmq.Socket[bytes]"
    folder: Path


@pytest.fixture(scope="module")
def shared(launch_shared: Launcher, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Process]:
    folder = tmp_path_factory.mktemp("i") / "v2x" / "not" / "there"
    into, out = f"ipc://{folder}/in/0", f"ipc://{folder}/out/0"
    bench = launch_shared("btp", endpoint={"ipc_in": into, "ipc_out": out, "local_info": False})
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    pub, sub = context.socket(zmq.PUB), context.socket(zmq.SUB)
    for each in (pub, sub):
        each.linger = 0
        each.rcvtimeo = 5000
    pub.connect(into)
    sub.connect(out)
    sub.subscribe(b"")
    process = Process(bench, sub, pub, folder)
    _join(process)
    yield process
    context.destroy(linger=0)


@pytest.fixture
def process(shared: Process) -> Process:
    shared.bench.settled()
    _drain(shared)
    return shared


def _join(process: Process) -> None:
    """Wait until a RawRxMessage of the process arrives at the user, and a user's message at the process."""
    bench = process.bench
    while not bench.user.sub.poll(20) or bench.user.sub.recv_multipart()[0] == b"hb.counter":
        process.into.send(bytes.fromhex(GOLDEN[0]))
    while not process.out.poll(20):
        bench.user.send(b"v2x.cam.", mark())
    bench.user.send(b"v2x.cam.", last := mark())
    while bench.air.hear().pdu != last:
        pass
    _drain(process)
    process.into.send(bytes.fromhex(GOLDEN[1]))
    while bench.user.sub.recv_multipart() != [b"raw.", bytes.fromhex(GOLDEN[1])]:
        pass
    assert bench.user.sub.recv_multipart() == [b"v2x.cam.", PDU]


def _drain(process: Process) -> None:
    process.bench.user.send(b"v2x.cam.", last := mark())
    while process.out.recv_multipart()[-1] != last:
        pass
    while process.bench.air.hear().pdu != last:
        pass


def test_missing_directories_are_made(process: Process) -> None:
    assert (process.folder / "in" / "0").is_socket()
    assert (process.folder / "out" / "0").is_socket()


@pytest.mark.parametrize("golden", GOLDEN)
def test_golden_vectors_come_out_as_they_went_in(process: Process, golden: str) -> None:
    process.into.send(bytes.fromhex(golden))
    received = process.bench.user.receive()
    assert received.raw.hex() == golden
    assert (received.envelope, received.pdu) == (b"v2x.cam.", PDU)


def test_a_message_of_a_user_leaves_in_two_frames_envelope_and_pdu(process: Process) -> None:
    process.bench.user.send(b"v2x.denm.", b"\2\1\0\0\5\x39 denm")
    assert process.out.recv_multipart() == [b"v2x.denm.", b"\2\1\0\0\5\x39 denm"]


def test_a_message_classified_by_its_header_leaves_under_its_type(process: Process) -> None:
    process.bench.user.send(b"v2x.", b"\2\4\0\0\5\x39 spatem")
    assert process.out.recv_multipart()[0] in (b"v2x.spatem.", b"v2x.")


def test_what_the_process_received_is_not_sent_back_to_it(process: Process) -> None:
    process.into.send(bytes.fromhex(GOLDEN[1]))
    assert process.bench.user.receive().pdu == PDU
    process.bench.user.send(b"v2x.cam.", last := mark())
    assert process.out.recv_multipart()[-1] == last


BAD = [
    b"",
    b"\x60",
    b"\x60" + bytes(20),
    bytes.fromhex(GOLDEN[0])[:-1],
    bytes.fromhex(GOLDEN[0])[:74],
    b"\xff" * 84,
    bytes(84),
    b"\x60" * 5000,
]


@pytest.mark.parametrize("octets", BAD, ids=range(len(BAD)))
def test_octets_that_are_no_raw_message_are_dropped_and_counted(process: Process, octets: bytes) -> None:
    before = sum(process.bench.station.drops().values())
    process.into.send(octets)
    process.into.send(bytes.fromhex(GOLDEN[1]))
    assert process.bench.user.receive().pdu == PDU
    assert sum(process.bench.station.drops().values()) == before + 1


@pytest.mark.parametrize("cut", range(84))
def test_a_raw_message_that_ends_anywhere_too_early_harms_nothing(process: Process, cut: int) -> None:
    process.into.send(bytes.fromhex(GOLDEN[1])[:cut])
    process.into.send(bytes.fromhex(GOLDEN[0]))
    assert process.bench.user.receive().raw.hex() == GOLDEN[0]


def test_two_frames_where_one_is_due_do_not_disturb_the_next(process: Process) -> None:
    process.into.send_multipart([bytes.fromhex(GOLDEN[0]), b"more"])
    process.into.send(bytes.fromhex(GOLDEN[1]))
    while process.bench.user.receive().raw.hex() != GOLDEN[1]:
        pass


def test_the_decoder_of_these_tests_reads_the_golden_vectors() -> None:
    fields = decode(bytes.fromhex(GOLDEN[1]))
    assert (fields["sec"], fields["usec"], fields["rssi"]) == (1795182426, 461613, -71)
    assert (fields["latitude"], fields["longitude"]) == (470585000, 154600000)
    assert (fields["data_rate"], fields["traffic_class"], fields["hop_limit"]) == (12, 2, 1)
    assert fields["mac"] == bytes((1, 2, 3, 4, 5, 6))
