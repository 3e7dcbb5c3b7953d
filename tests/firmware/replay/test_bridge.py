"""A lossy link between two UDP sides, and between sides of different kinds."""

import json
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import pytest

from board.runtime.address import Address
from drivers.wire.impairment import Burst, Impairment, Impairments
from firmware import cli
from firmware.client import client
from firmware.codec.reading import Pdu
from firmware.commands import impair
from firmware.lab.laboratory import vectors
from firmware.replay import ears, ends
from firmware.replay.bridge import Bridge, Side, Way
from tests.firmware.commands import fake
from tests.firmware.commands.fake import FakeStation
from tests.firmware.replay.test_rewriting import frame_of
from tests.said import tells

PDUS = [one.pdu for one in vectors()]
HOST = "127.0.0.1"
SEED = "2"  # with it the last of fifty is not lost


def bound() -> socket.socket:
    one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    one.bind((HOST, 0))
    one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
    one.settimeout(5)
    return one


def at(one: socket.socket) -> Address:
    return Address(*one.getsockname())


@pytest.fixture
def peers() -> Iterator[tuple[socket.socket, socket.socket]]:
    with bound() as one, bound() as other:
        yield one, other


def udp_side(name: str, peer: socket.socket, framing: str = "ethernet") -> Side:
    return Side(name, ears.Datagrams(Address(HOST, 0), framing), ends.Datagrams(at(peer), framing))


def listens(side: Side) -> Address:
    assert isinstance(side.ear, ears.Datagrams)
    return at(side.ear.polled)


def carried(peers, sent: list[bytes], wanted: Impairments, framing: str = "ethernet") -> tuple[Way, list[bytes]]:
    """What comes of it at the other side."""
    a, b = udp_side("a", peers[0], framing), udp_side("b", peers[1], framing)
    way = Way(a, b, Impairment[Pdu](wanted))
    for octets in sent:
        peers[0].sendto(octets, listens(a))
    Bridge([way]).run(0.2)
    peers[1].setblocking(False)
    got = []
    try:
        while True:
            got.append(peers[1].recv(65536))
    except BlockingIOError:
        pass
    for one in (a.ear, a.end, b.ear, b.end):
        one.close()  # type: ignore[attr-defined]
    return way, got


def test_every_octet_passes_a_good_way_what_is_broken_as_well(peers):
    sent = [*map(frame_of, PDUS), b"\xff" * 12 + b"\x89\x47\x11", b"nonsense", bytes(1400)]
    way, got = carried(peers, sent, Impairments())
    assert got == sent
    assert (way.heard, way.sent, way.left_out) == (len(sent), len(sent), {})


@pytest.mark.parametrize("framing", ["ethernet", "btp", "pdu"])
def test_what_is_lost_is_counted_to_the_packet(peers, framing):
    sent = [b"\x07\xd1\0\0" * (framing == "btp") + PDUS[0][:6] + number.to_bytes(2) for number in range(300)]
    if framing == "ethernet":
        sent = [frame_of(octets) for octets in sent]
    wanted = Impairments(loss=0.1, burst=Burst(0.02, 0.3), duplicate=0.05, reorder=0.1, reorder_s=0.01, delay_s=0.02)
    way, got = carried(peers, sent, wanted, framing)
    counts = way.impairment.counts
    assert counts.taken == way.heard == 300
    assert len(got) == way.sent == 300 - counts.lost - counts.burst_lost + counts.duplicated
    assert len(set(got)) == 300 - counts.lost - counts.burst_lost
    assert counts.lost > 10
    assert counts.burst_lost > 5


def test_what_the_kernel_could_not_keep_is_counted(peers):
    a, b = udp_side("a", peers[0]), udp_side("b", peers[1])
    assert isinstance(a.ear, ears.Datagrams)
    a.ear.polled.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
    for number in range(200):
        peers[0].sendto(frame_of(PDUS[0][:6] + number.to_bytes(2)), listens(a))
    way = Way(a, b, Impairment[Pdu](Impairments()))
    Bridge([way]).run(0.1)
    assert a.ear.missed > 100
    assert way.heard + a.ear.missed == 200
    for one in (a.ear, a.end, b.ear, b.end):
        one.close()  # type: ignore[attr-defined]


def test_a_datagram_without_a_whole_btp_header_is_left_out_and_told(peers):
    way, got = carried(peers, [b"\x07\xd1\0", b"\x07\xd1\0\0" + PDUS[1]], Impairments(), "btp")
    assert got == [b"\x07\xd1\0\0" + PDUS[1]]
    assert way.left_out == {"a frame without a message: shorter than a BTP header": 1}


def test_both_ways_are_served_each_with_chances_of_its_own(peers):
    a, b = udp_side("a", peers[0]), udp_side("b", peers[1])
    ways = [
        Way(a, b, Impairment[Pdu](Impairments(loss=0.5))),
        Way(b, a, Impairment[Pdu](Impairments(loss=0.5, seed=2))),
    ]
    frames = [frame_of(PDUS[0][:6] + number.to_bytes(2)) for number in range(100)]
    for octets in frames:
        peers[0].sendto(octets, listens(a))
        peers[1].sendto(octets, listens(b))
    Bridge(ways).run(0.2)
    there, back = (way.impairment.counts.lost for way in ways)
    assert there != back
    got = [peers[1].recv(2048) for _ in range(100 - there)], [peers[0].recv(2048) for _ in range(100 - back)]
    assert got[0] != got[1]
    for one in (a.ear, a.end, b.ear, b.end):
        one.close()  # type: ignore[attr-defined]


def test_messages_of_a_station_become_frames_of_a_link_and_the_other_way_round(peers):
    received = [(b"v2x.cam.", PDUS[1]), (b"v2x.denm.", PDUS[0])]
    with FakeStation(received) as station, client.session() as context:
        place = client.Address(HOST, *station.ports)
        a = Side("a", ears.StationEar(context, place), ends.Pull(context, place))
        b = udp_side("b", peers[1])
        ways = [Way(a, b, Impairment[Pdu](Impairments())), Way(b, a, Impairment[Pdu](Impairments()))]
        for octets in (frame_of(PDUS[3]), b"nonsense"):
            peers[1].sendto(octets, listens(b))
        Bridge(ways).run(0.5)
        heard = [ears.framed(peers[1].recv(2048)) for _ in range(2)]
        assert [(one.octets, one.port) for one in heard] == [(PDUS[1], 2001), (PDUS[0], 2002)]
        assert ways[1].left_out == {"a frame without a message: not GeoNetworking": 1}
        deadline = time.monotonic() + 5
        while not station.requests and time.monotonic() < deadline:
            threading.Event().wait(0.01)
        envelope, pdu, options = station.requests[0]
        assert (envelope, pdu) == (b"v2x.", PDUS[3])
        assert json.loads(options) == {"btp_port": 2004, "traffic_class": 1}
        for one in (a.ear, a.end, b.ear, b.end):
            one.close()  # type: ignore[attr-defined]


def test_how_often_a_user_of_a_station_fell_behind_meanwhile_is_what_it_says(monkeypatch):
    endpoint = dict(fake.STATUS["endpoint"], slow_count=3)
    monkeypatch.setitem(fake.STATUS, "endpoint", endpoint)
    with FakeStation() as station, client.session() as context:
        ear = ears.StationEar(context, client.Address(HOST, *station.ports))
        assert ear.fell_behind() == 0
        endpoint["slow_count"] = 5
        assert ear.fell_behind() == 2
        ear.close()


def test_summary_of_a_way_names_how_often_its_user_fell_behind(peers, capsys, monkeypatch):
    monkeypatch.setattr(ears.StationEar, "fell_behind", lambda ear: 2)
    station = FakeStation([(b"v2x.cam.", PDUS[1])])
    place = client.Address(HOST, *station.ports)
    with station, client.session() as context:
        a, b = Side("a", ears.StationEar(context, place), ends.Pull(context, place)), udp_side("b", peers[1])
        way = Way(a, b, Impairment[Pdu](Impairments()))
        said = "\n".join(impair.lines([way]))
        assert json.loads(impair.as_json([way]))["ways"][0]["fell_behind"] == 2
        for one in (a.ear, a.end, b.ear, b.end):
            one.close()  # type: ignore[attr-defined]
    assert tells(said, "user of the station", "behind 2 times; ", "losses")


@pytest.mark.parametrize(
    ("a", "b"),
    [
        ("udp::29001,:29001", "udp::29002,:29003"),
        ("udp::29001,:29002", "udp::29002,:29003"),
        ("udp::29001,:29002", "udp::29003,:29001"),
        ("udp:0.0.0.0:29001,:29001", "udp::29002,:29003"),
        ("udp:0.0.0.0:29001,127.0.0.7:29001", "udp::29002,:29003"),
        ("udp:0.0.0.0:29001,224.0.0.251:29001", "udp::29002,:29003"),
        ("ethernet:lo", "ethernet:lo"),
        ("station:127.0.0.1:29001", "station::29001"),
    ],
)
def test_way_that_would_carry_its_own_frames_for_ever_is_refused(a, b, capsys):
    assert cli.main(["impair", a, b, "--duration", "0.1"]) == 2
    assert tells(capsys.readouterr().err, "captain: ", "receive messages", "this program sends")


def test_at_any_address_of_this_machine_nothing_is_heard_of_what_goes_to_another(capsys, monkeypatch):
    monkeypatch.setattr(Bridge, "run", lambda bridge, duration: None)
    monkeypatch.setattr(ends.Datagrams, "__init__", lambda end, to, framing: None)
    monkeypatch.setattr(ends.Datagrams, "close", lambda end: None)
    monkeypatch.setattr(ends.Datagrams, "unheard", 0, raising=False)
    away = "192.0.2.1:29001"  # RFC 5737: nobody's
    assert cli.main(["impair", f"udp:0.0.0.0:29001,{away}", f"udp::29002,{away}"]) == 0


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("wire:a", "invalid side"),
        ("udp:", "invalid side"),
        ("udp:127.0.0.1:9001", "LISTEN,PEER"),
        ("udp:127.0.0.1,127.0.0.1:9", "port"),
        ("station:host:99999", "99999"),
    ],
)
def test_a_side_that_is_none_says_how_to_write_it(text, told, capsys):
    with pytest.raises(SystemExit):
        cli.main(["impair", text, "ethernet:lo"])
    assert told in capsys.readouterr().err


def test_the_program_says_when_it_stands_there_and_at_its_end_what_it_did(peers):
    with bound() as free_a, bound() as free_b:
        listen_a, listen_b = at(free_a), at(free_b)
    sides = [f"udp:{listen_a},{at(peers[0])}", f"udp:{listen_b},{at(peers[1])}"]
    child = subprocess.Popen(
        [sys.executable, "-m", "firmware", "impair", *sides, "--json", "--loss", "0.5", "--seed", SEED],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert child.stdout is not None
    assert child.stderr is not None
    with child, child.stdout, child.stderr:
        assert child.stderr.readline().startswith(b"captain: lossy link between udp:")
        for number in range(50):
            peers[0].sendto(frame_of(PDUS[0][:6] + number.to_bytes(2)), listen_a)
        while frame_of(PDUS[0][:6] + (49).to_bytes(2)) != peers[1].recv(2048):
            pass
        child.send_signal(signal.SIGTERM)
        told = json.loads(child.stdout.read())
        assert child.wait() == 0
    there, back = told["ways"]
    assert (there["heard"], there["taken"], back["heard"]) == (50, 50, 0)
    assert there["sent"] == 50 - there["lost"]
