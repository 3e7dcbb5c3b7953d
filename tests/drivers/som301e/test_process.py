"""V2Xcast library: layouts, errors by text and number, threads, queues of its process."""

import ctypes
import os
import struct
import subprocess
import sys
from pathlib import Path
from threading import Event, Thread

import pytest

from board.runtime.errors import InterfaceError
from drivers.message import NO_MAC, NOT_SECURED, Area, Position, RxInfo, Security, SecurityStatus, Shape
from drivers.som301e import shared_library
from drivers.som301e.library import CasterKind, classify, handler_number
from drivers.som301e.outbox import DEPTH, Outbox
from drivers.som301e.watchdog import Watch
from drivers.wire import v2xcast as wire
from tests.drivers.host import CAM, DENM, request
from tests.drivers.radio import ROOT, library

MAC = bytes.fromhex("010203040506")

# Layouts.


class Security_(ctypes.Structure):  # noqa: N801
    _fields_ = (
        ("status", ctypes.c_uint32),
        ("its_aid", ctypes.c_uint32),
        ("ssp_len", ctypes.c_uint8),
        ("ssp", ctypes.c_uint8 * 32),
    )


class Place(ctypes.Structure):
    _fields_ = (("latitude", ctypes.c_int32), ("longitude", ctypes.c_int32))


class Shape_(ctypes.Structure):  # noqa: N801
    _fields_ = (
        ("type", ctypes.c_uint32),
        ("a", ctypes.c_uint16),
        ("b", ctypes.c_uint16),
        ("angle", ctypes.c_uint16),
    )


class Received(ctypes.Structure):
    _fields_ = (
        ("sec", ctypes.c_long),
        ("usec", ctypes.c_long),
        ("rssi", ctypes.c_int16),
        ("data_rate", ctypes.c_uint16),
        ("traffic_class", ctypes.c_uint8),
        ("hops", ctypes.c_uint8),
        ("security", Security_),
        ("position", Place),
        ("area", Shape_),
        ("mac", ctypes.c_uint8 * 6),
    )


class ToSend(ctypes.Structure):
    _fields_ = (
        ("port", ctypes.c_uint16),
        ("data_rate", ctypes.c_uint8),
        ("power", ctypes.c_int8),
        ("traffic_class", ctypes.c_uint8),
        ("security", Security_),
        ("position", Place),
        ("area", Shape_),
        ("has", ctypes.c_bool * 7),
    )


def test_rx_info_is_laid_out_as_the_compiler_would():
    # Layout in the SDK on 64-bit machines: 96 octets; offsets: rssi 16, security 24, position 68, area 76, MAC 88.
    assert ctypes.sizeof(Received) == wire.RX_INFO.size == 96
    offsets = {name: getattr(Received, name).offset for name in ("rssi", "security", "position", "area", "mac")}
    assert offsets == {"rssi": 16, "security": 24, "position": 68, "area": 76, "mac": 88}
    ssp = (ctypes.c_uint8 * 32)(*b"\x01\x02")
    info = Received(
        1_795_182_426, 461_613, -71, 12, 2, 1, Security_(2, 36, 2, ssp), Place(470_585_000, 154_600_000),
        Shape_(2, 300, 100, 45), (ctypes.c_uint8 * 6)(*MAC),
    )  # fmt: skip
    rx, stamp_ns = wire.parse_rx_info(bytes(info))
    assert stamp_ns == 1_795_182_426_461_613_000
    assert rx == RxInfo(
        None, -71, 12, 2, 1, Security(SecurityStatus.VERIFIED_PKT, 36, b"\x01\x02"),
        Position(470_585_000, 154_600_000), Area(Shape.ELLIPSE, Position(), 300, 100, 45), MAC,
    )  # fmt: skip


def test_tx_info_is_laid_out_as_the_compiler_would():
    assert ctypes.sizeof(ToSend) == wire.TX_INFO.size == 80
    area = Area(Shape.RECTANGLE, Position(-1, 2), 500, 250, 90)
    message = wire.to_send(wire.send(3, request(CAM, 7, area)._replace(traffic_class=0x85)))
    info = ToSend.from_buffer_copy(message.tx_info)
    assert (message.caster, message.number, message.pdu) == (3, 7, CAM)
    assert (info.port, info.traffic_class, info.position.latitude, info.position.longitude) == (2001, 5, -1, 2)
    assert (info.area.type, info.area.a, info.area.b, info.area.angle) == (1, 500, 250, 90)
    assert list(info.has) == [True, False, False, True, False, True, True]
    without = ToSend.from_buffer_copy(wire.to_send(wire.send(0, request(CAM))).tx_info)
    assert list(without.has) == [True, False, False, True, False, False, False]


def test_an_rx_info_of_zeros_tells_nothing():
    assert wire.parse_rx_info(bytes(96)) == (RxInfo(None, None, 0, 0, 0, NOT_SECURED, Position(), None, NO_MAC), 0)


@pytest.mark.parametrize("octets", [b"\xff" * 96, bytes(range(96)), bytes(24) + b"\x09" * 72])
def test_an_rx_info_of_nonsense_is_taken_without_an_error(octets):
    rx, _ = wire.parse_rx_info(octets)
    assert rx.area is None
    assert rx.security is NOT_SECURED


@pytest.mark.parametrize(
    ("age_ns", "is_believed"),
    [(0, True), (1_900_000_000, True), (2_100_000_000, False), (-90_000_000, True), (-200_000_000, False)],
)
def test_the_time_stamp_of_the_module_counts_while_it_is_plausible(age_ns, is_believed):
    now_ns = 1_795_182_426_500_000_000
    seconds, nanoseconds = divmod(now_ns - age_ns, 10**9)
    info = struct.pack("@ll80x", seconds, nanoseconds // 1000)
    found = wire.parse_received(wire.received(1, now_ns, info, CAM))
    assert (found.caster, found.pdu) == (1, CAM)
    assert found.received_ns == (now_ns - age_ns if is_believed else now_ns)


# Errors.


@pytest.mark.parametrize(
    ("call", "code", "text", "kind"),
    [
        ("rx", -6173, "Caster RX timeout", CasterKind.TIMEOUT),
        ("rx", -9999, "Caster RX Timeout", CasterKind.TIMEOUT),
        (
            "rx",
            -6175,
            "Caster RX fail due to thread id mismatch between create caller and rx caller",
            CasterKind.THREAD,
        ),
        ("create", -6154, "Caster create fail due to caster number over limit", CasterKind.LIMIT),
        ("create", -6156, "Caster create fail due to V2Xcast service is not available", CasterKind.ABSENT),
        ("tx", -6171, "Caster TX fail due to packet overload", CasterKind.LENGTH),
        ("rx", -6173, "something that nobody has seen", CasterKind.OTHER),
        ("rx", -6173, "", CasterKind.TIMEOUT),
        ("rx", -6171, "", CasterKind.TIMEOUT),
        ("tx", -6171, "", CasterKind.LENGTH),
        ("create", -6150, "", CasterKind.ABSENT),
        ("release", -6173, "", CasterKind.OTHER),
    ],
)
def test_an_error_is_told_by_its_text_and_by_its_number_where_it_has_none(call, code, text, kind):
    assert classify(call, code, text) is kind


@pytest.mark.parametrize(
    ("written", "number"),
    [
        ("05 ff ff ff ff ff ff ff", 5),
        ("00 ff ff ff ff ff ff ff", 0),
        ("05 00 00 00 ff ff ff ff", 5),
        ("00 01 00 00 ff ff ff ff", 256),
    ],
)
def test_a_handler_is_read_whether_8_or_32_bits_of_it_were_written(written, number):
    assert handler_number(bytes.fromhex(written)) == number


# The simulated library is called from a separate program, because it has one radio per process.

SCRIPT = """
import sys
from threading import Thread
from drivers.som301e.library import Buffers, CallError, CasterKind, Library

def elsewhere(call):
    thread = Thread(target=call)
    thread.start()
    thread.join()

def outcome(call):
    try:
        return call()
    except CallError as error:
        return f"{error.kind.name}: {error.message}"

radio = Library(sys.argv[1])
radio.init()
receiver, sender = radio.create("192.168.1.3", 1, 1), radio.create("192.168.1.3", 0, 0)
"""


def run(script, settings):
    """Return the output of a script on a radio with these settings."""
    command = [sys.executable, "-c", SCRIPT + script, library()]
    environment = {**os.environ, "CAPTAIN_SIM_RADIO": f"listen=127.0.0.1:0 {settings}", "PYTHONPATH": str(ROOT)}
    found = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=20)
    assert found.returncode == 0, found.stderr
    return found.stdout.splitlines()


@pytest.mark.parametrize("settings", ["", "sdk=1.7", "handler_bits=32", "texts=0", "sdk=1.7 texts=0 handler_bits=32"])
def test_idle_and_foreign_threads_are_told_apart_in_every_version(settings):
    lines = run(
        """
print(radio.receive(receiver, Buffers(), 1))
elsewhere(lambda: print(outcome(lambda: radio.receive(receiver, Buffers(), 1)).partition(":")[0]))
elsewhere(lambda: print(outcome(lambda: radio.transmit(sender, bytes(80), b"pdu")).partition(":")[0]))
radio.release(receiver)
radio.release(sender)
radio.deinit()
print("left")
""",
        settings,
    )
    assert lines == ["None", "THREAD", "THREAD", "left"]


def test_every_misuse_of_a_handler_has_an_error_of_its_own():
    lines = run(
        """
elsewhere(lambda: print(outcome(lambda: radio.release(receiver))))
for call in (
    lambda: radio.transmit(receiver, bytes(80), b"pdu"),
    lambda: radio.receive(sender, Buffers(), 1),
    lambda: radio.transmit(sender, bytes(80), bytes(1501)),
    lambda: radio.transmit(99, bytes(80), b"pdu"),
    lambda: radio.create("somewhere", 0, 0),
    lambda: radio.create("192.168.1.3", 77, 0),
    lambda: [radio.create("192.168.1.3", 0, 0) for _ in range(3)],
):
    print(outcome(call))
""",
        "limit=4",
    )
    assert lines == [
        "THREAD: Caster release: thread id mismatch (-6206)",
        "OTHER: Caster TX: communication mode mismatch (-6164)",
        "OTHER: Caster RX: communication mode mismatch (-6176)",
        "LENGTH: Caster TX: packet overload, at most 1500 octets (-6171)",
        "OTHER: Caster TX: caster does not exist (-6162)",
        "OTHER: Caster create: invalid IP (-6153)",
        "ABSENT: Caster create: V2Xcast service is not available (-6156)",
        "LIMIT: Caster create: caster number over limit (-6154)",
    ]


@pytest.mark.parametrize("settings", ["loss=2", "peers=nowhere", "fail=walk:-1:1", "down", "seed=", "mac=1:2", "x=1"])
def test_a_setting_that_is_not_understood_is_named(settings):
    with pytest.raises(AssertionError, match=f"not understood: {settings}"):
        run("", settings)


# `make test` needs only gcc; `make portable` installs clang as well.
COMPILERS = [name for name in ("gcc", "clang") if name == "gcc" or "CAPTAIN_PORTABLE" in os.environ]


@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_simulated_library_compiles_without_a_warning(compiler, tmp_path):
    sources = sorted(map(str, (ROOT / "drivers" / "sim" / "radio").glob("*.c")))
    flags = ["-std=c11", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-fsyntax-only"]
    subprocess.run([compiler, *flags, *sources], check=True)


# Which library.


def elf(class_=2, data=1, kind=3, machine=62):
    order = "<" if data == 1 else ">"
    return b"\x7fELF" + bytes((class_, data, 1)) + bytes(9) + struct.pack(order + "HH", kind, machine)


def another(*machines):
    """Return the first of these machines that differs from the one of this program, with its name."""
    own = shared_library.own_architecture().machine
    return next((machine, shared_library.MACHINES[machine]) for machine in machines if machine != own)


FOREIGN, FOREIGN_NAME = another(183, 62)
SMALL, SMALL_NAME = another(40, 3)


@pytest.mark.parametrize(
    ("octets", "text"),
    [
        (elf(machine=FOREIGN), f"is built for {FOREIGN_NAME}, 64 bit; the station runs as"),
        (elf(1, machine=SMALL), f"is built for {SMALL_NAME}, 32 bit; the station runs as"),
        (elf(2, 2, machine=21), "is built for machine 21, 64 bit; the station runs as"),
        (b"", "not a shared library: it begins with nothing"),
        (b"!<arch>\n" + bytes(20), "not a shared library: it begins with 21 3c 61 72"),
        (elf(kind=1), "not a shared library"),
        (elf()[:10], "not a shared library"),
    ],
)
def test_a_library_that_cannot_be_loaded_is_named_before_anybody_tries(octets, text, tmp_path):
    path = tmp_path / "libeu_v2xcast.so"
    path.write_bytes(octets)
    with pytest.raises(InterfaceError) as caught:
        shared_library.check(str(path))
    assert caught.value.message.startswith(f"{path}: {text}")


def test_a_directory_is_no_library(tmp_path):
    with pytest.raises(InterfaceError, match="cannot be opened: Is a directory"):
        shared_library.check(str(tmp_path))


def test_a_library_of_this_machine_passes_and_another_file_is_noticed(tmp_path):
    path = tmp_path / "libeu_v2xcast.so"
    path.write_bytes(Path(library()).read_bytes())
    shared_library.check(str(path))
    before = shared_library.identity(str(path))
    path.unlink()
    assert shared_library.identity(str(path)) is None
    path.write_bytes(Path(library()).read_bytes() + b"\0")
    assert shared_library.identity(str(path)) not in (None, before)


# Messages that wait for the station.


@pytest.fixture
def outbox():
    return Outbox(3, frozenset({1}))


def take(outbox, count):
    """Return the next `count` messages. Fail if there are fewer."""
    found = [outbox.take() for _ in range(count)]
    assert outbox._next() is None
    return found


def test_what_is_said_goes_first_then_what_is_urgent_then_the_casters_in_turn(outbox):
    for number in range(3):
        outbox.put(0, CAM, b"cam%d" % number)
    outbox.put(2, CAM, b"spatem")
    outbox.put(1, DENM, b"denm")
    outbox.put(0, DENM, b"denm of another caster")
    outbox.say(b"state")
    assert take(outbox, 7) == [
        b"state", b"denm", b"denm of another caster", b"cam0", b"spatem", b"cam1", b"cam2",
    ]  # fmt: skip


def test_a_flood_of_one_caster_takes_no_place_of_another(outbox):
    for number in range(1000):
        outbox.put(0, CAM, b"%d" % number)
    outbox.put(1, CAM, b"mapem")
    found = take(outbox, DEPTH + 1)
    assert found[1] == b"mapem"
    assert found[0] == b"%d" % (1000 - DEPTH)  # the oldest messages were dropped
    assert outbox.take_dropped() == 1000 - DEPTH
    assert outbox.take_dropped() == 0


@pytest.mark.parametrize("pdu", [b"", b"\x01"])
def test_what_has_no_header_is_not_urgent(outbox, pdu):
    outbox.put(0, pdu, b"short")
    outbox.put(1, DENM, b"denm")
    assert take(outbox, 2) == [b"denm", b"short"]


def test_who_waits_for_something_to_say_gets_it_and_is_let_go_at_the_end(outbox):
    found = []
    reader = Thread(target=lambda: found.extend(iter(outbox.take, None)))
    reader.start()
    outbox.say(b"state")
    while not found:
        Event().wait(0.001)
    outbox.close()
    reader.join(5)
    assert (found, reader.is_alive()) == ([b"state"], False)


def test_a_call_that_does_not_return_is_told_once_and_one_that_does_is_not():
    told, done = [], Event()
    watch = Watch(lambda what: (told.append(what), done.set()), lambda: None, check_s=0.005)
    try:
        with watch.call("eu_caster_release of caster 3 rx", 60.0):
            pass
        with watch.call("eu_caster_tx of caster 0 tx", 0.02):
            watcher = Thread(target=watch.run)
            watcher.start()
            assert done.wait(5)
        watcher.join(5)
    finally:
        watch.stop()
    assert told == ["eu_caster_tx of caster 0 tx has not returned for 0.02 s"]
