"""Contract, section 5, and bad input: failures of other programs do not harm the station."""

import contextlib
import socket
from typing import Any

import zmq

from tests.system.air import single_hop
from tests.system.conftest import Bench, Launcher
from tests.system.user import air_hears_nothing_before_a_mark, mark

CAM = bytes.fromhex("020200000539")
LARGE = CAM + bytes(1400)

# Number of messages in flight between test and station: they fit into the smallest queue of the kernel.
WINDOW = 100


def memory_kb(bench: Bench) -> int:
    memory: int = bench.station.status()["memory_kb"]
    return memory


def test_payloads_shorter_than_a_header_from_user_and_air_do_not_end_it(launch: Launcher) -> None:
    bench = launch("pdu")
    for length in range(6):
        bench.user.send(b"v2x.", CAM[:length])
        bench.user.push_pdu(b"v2x.", CAM[:length])
        bench.air.throw(CAM[:length])
    air_hears_nothing_before_a_mark(bench.user, bench.air)
    bench.user.hears_nothing_before_a_mark(bench.air)
    drops = bench.station.until(lambda status: sum(row["count"] for row in status["drops"]) == 18)["drops"]
    assert {(row["where"], row["reason"]): row["count"] for row in drops} == {
        (where, reason): count
        for where in ("from_users", "pull", "g5")
        for reason, count in (("empty-pdu", 1), ("short-pdu", 5))
    }


def test_a_burst_of_20000_from_a_user_all_leaves(launch: Launcher) -> None:
    bench = launch("pdu")
    heard = 0
    for sent in range(20_000):
        bench.user.send(b"v2x.cam.", CAM + sent.to_bytes(4, "big"))
        if sent % WINDOW == WINDOW - 1:
            heard += sum(bench.air.hear().pdu[6:] >= b"" for _ in range(WINDOW))
    assert heard == 20_000
    assert bench.station.drops() == {}


def test_a_burst_of_20000_pushed_at_once_leaves_or_is_counted(launch: Launcher) -> None:
    bench = launch("pdu")
    for _ in range(20_000):
        bench.user.push_pdu(b"v2x.cam.", CAM)
    bench.user.push_pdu(b"v2x.denm.", b"\2\1last")
    before = 1 + bench.station.status()["interfaces"]["g5"]["sent"]["cam"]
    status = bench.station.until(lambda status: status["interfaces"]["g5"]["sent"].get("denm") == 1)
    sent = status["interfaces"]["g5"]["sent"]
    assert before <= 1 + sent["cam"]
    assert bench.station.drops() == {}
    assert sent["cam"] + sent["denm"] == status["endpoint"]["accepted"] == status["endpoint"]["requests"]


def test_a_burst_of_20000_from_the_air_all_arrives(launch: Launcher) -> None:
    bench = launch("pdu")
    sent = [CAM + number.to_bytes(4, "big") for number in range(20_000)]
    for start in range(0, len(sent), WINDOW):
        for each in sent[start : start + WINDOW]:
            bench.air.send(each)
        for each in sent[start : start + WINDOW]:
            assert bench.user.receive().pdu == each
    assert bench.station.drops() == {}


def test_a_burst_from_the_air_without_a_pause_is_delivered_or_counted(launch: Launcher) -> None:
    bench = launch("pdu")
    received = bench.station.status()["interfaces"]["g5"]["received"]["cam"]
    for _ in range(20_000):
        bench.air.send(CAM)

    def accounted(status: dict[str, Any]) -> int:
        lost = sum(row["count"] for row in status["drops"])
        return int(status["interfaces"]["g5"]["received"]["cam"] - received + lost)

    status = bench.station.until(lambda status: accounted(status) == 20_000)
    assert {row["reason"] for row in status["drops"]} <= {"kernel-queue"}
    delivered = status["interfaces"]["g5"]["received"]["cam"] - received
    assert [bench.user.receive().pdu for _ in range(delivered)] == [CAM] * delivered


def test_an_interface_that_is_down_holds_a_bounded_queue_and_nobody_up(launch: Launcher) -> None:
    bench = launch(
        "pdu",
        options={"g5": {}},
        more='[interfaces.gone]\ndriver = "ethernet"\ndevice = "nosuchdevice0"\nqueue = 50\n',
    )
    for number in range(1000):
        bench.user.send(b"v2x.cam.", sent := CAM + number.to_bytes(4, "big"))
        assert bench.air.hear().pdu == sent
    gone = bench.station.status()["interfaces"]["gone"]
    assert gone["state"] in ("waiting", "down")
    assert "nosuchdevice0" in gone["why"]
    assert gone["queue"]["longest"] <= gone["queue"]["capacity"] == 50


def test_the_only_interface_being_down_keeps_a_bounded_queue_and_explains_the_rest(launch: Launcher) -> None:
    station = launch.station()
    station.configure({"gone": {"driver": "ethernet", "device": "nosuchdevice0", "queue": 50}})
    station.start()
    user = launch.user(station)
    for number in range(1000):
        user.push_pdu(b"v2x.cam.", CAM + number.to_bytes(4, "big"), lifetime_s=60)
    user.push_pdu(b"v2x.nonsense.", CAM)
    status = station.until(lambda status: any(row["reason"] == "bad-envelope" for row in status["drops"]))
    queue = status["interfaces"]["gone"]["queue"]
    dropped = sum(row["count"] for row in status["drops"] if row["where"] != "pull" or row["reason"] != "bad-envelope")
    assert queue["longest"] <= queue["capacity"] == 50
    assert queue["length"] + dropped == 1000


def test_many_different_unknown_envelopes_grow_nothing(launch: Launcher) -> None:
    bench = launch("pdu")
    for number in range(5_000):
        bench.user.push_pdu(b"v2x.warm%d." % number, CAM)
    bench.station.until(lambda status: _count(status, "bad-envelope") == 5_000)
    before = memory_kb(bench)
    for number in range(50_000):
        bench.user.push_pdu(b"v2x.type%d." % number, CAM)
    status = bench.station.until(lambda status: _count(status, "bad-envelope") == 55_000)
    assert len(status["drops"]) == 1
    assert status["memory_kb"] < before + 2000
    bench.user.push_pdu(b"v2x.cam.", sent := mark())
    assert bench.air.hear().pdu == sent


def test_many_different_stations_and_types_from_the_air_grow_nothing(launch: Launcher) -> None:
    bench = launch("pdu", reception={"duplicate_window_s": 0})
    _throw_numbers(bench, 10_000, 1)
    before = memory_kb(bench)
    _throw_numbers(bench, 40_000, 2)
    assert memory_kb(bench) < before + 2000


def _throw_numbers(bench: Bench, count: int, salt: int) -> None:
    """Send PDUs with different stationIDs and types, WINDOW at a time."""
    for start in range(0, count, WINDOW):
        for number in range(start, start + WINDOW):
            bench.air.throw(bytes((salt, number % 251)) + number.to_bytes(4, "big"))
        for _ in range(2 * WINDOW):
            bench.user.next_frames()


def _count(status: dict[str, Any], reason: str) -> int:
    return sum(row["count"] for row in status["drops"] if row["reason"] == reason)


def test_a_subscriber_that_never_reads_costs_the_others_nothing(launch: Launcher) -> None:
    bench = launch("pdu")
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    deaf = context.socket(zmq.SUB)
    deaf.rcvhwm = 1
    deaf.setsockopt(zmq.RCVBUF, 4096)
    deaf.subscribe(b"")
    deaf.connect(bench.station.address("to_users"))
    _receive_all(bench, 2000)
    before = memory_kb(bench)
    _receive_all(bench, 10_000)
    # The socket's high-water mark limits the waiting messages: 8,192 of 1.5 kB are 13 MB.
    assert memory_kb(bench) < before + 40_000
    assert bench.station.drops() == {("to_users", "subscriber-slow"): 1}
    context.destroy(linger=0)
    _receive_all(bench, 100)


def _receive_all(bench: Bench, count: int) -> None:
    for start in range(0, count, WINDOW):
        for _ in range(WINDOW):
            bench.air.send(LARGE)
        for _ in range(2 * WINDOW):
            assert bench.user.next_frames()[0] in (b"raw.", b"v2x.cam.")
        assert start < count


def test_octets_that_are_no_zmtp_on_every_port_do_not_end_it(launch: Launcher) -> None:
    bench = launch("pdu")
    for port in bench.station.ports.values():
        for octets in (b"GET / HTTP/1.1\r\n\r\n", b"\xff" * 64, b"\xff\0\0\0\0\0\0\0\x01\x7f\3", bytes(200), b""):
            with socket.create_connection(("127.0.0.1", port)) as stranger:
                stranger.sendall(octets)
    air_hears_nothing_before_a_mark(bench.user, bench.air)
    bench.user.hears_nothing_before_a_mark(bench.air)


def test_a_frame_of_megabytes_ends_only_its_senders_connection(launch: Launcher) -> None:
    bench = launch("pdu")
    giant = launch.user(bench.station)
    before = memory_kb(bench)
    for _ in range(20):
        giant.push_pdu(b"v2x.cam.", bytes(2_000_000))
    bench.user.push_pdu(b"v2x.cam.", sent := mark())
    assert bench.air.hear().pdu == sent
    assert memory_kb(bench) < before + 20_000


def test_an_idle_station_sleeps(launch: Launcher) -> None:
    """A polling loop would wake a thousand times a second; two heartbeats and a status need a few wake-ups."""
    bench = launch("pdu")
    before = _wakeups(bench)
    bench.user.beat()
    bench.user.beat()
    assert _wakeups(bench) - before < 100


def _wakeups(bench: Bench) -> int:
    with open(f"/proc/{bench.station.status()['pid']}/status") as lines:
        row = next(line for line in lines if line.startswith("voluntary_ctxt_switches"))
    return int(row.split()[1])


def test_control_octets_of_any_kind_do_not_end_it(launch: Launcher) -> None:
    bench = launch("pdu")
    for line in (b"\n", b"{}\n", b"[]\n", b"null\n", b'{"do":"dance"}\n', b"\xff\xfe\n", b"[" * 1000 + b"\n"):
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as control:
            control.settimeout(5)
            control.connect(str(bench.station.control))
            control.sendall(line)
            answer = control.recv(65536)
            assert b'"ok": false' in answer or b'"ok":false' in answer, (line, answer)
    for line in (b"", b'{"do":', b"{" * 100_000):
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as control, contextlib.suppress(BrokenPipeError):
            control.connect(str(bench.station.control))
            control.sendall(line)
    assert bench.station.status()["station"]


def test_unknown_frames_of_geonetworking_neighbours_leave_memory_flat(launch: Launcher) -> None:
    bench = launch("ethernet")
    _throw_sources(bench, 4_000, b"\2\1")
    before = memory_kb(bench)
    _throw_sources(bench, 8_000, b"\2\2")
    assert memory_kb(bench) < before + 3000


def _throw_sources(bench: Bench, count: int, prefix: bytes) -> None:
    """Send single-hop broadcasts, each from a different neighbour."""
    for start in range(0, count, WINDOW):
        for number in range(start, start + WINDOW):
            bench.air.throw(single_hop(CAM, source=prefix + number.to_bytes(4, "big")))
        for _ in range(2 * WINDOW):
            bench.user.next_frames()
