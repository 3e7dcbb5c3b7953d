"""Flood of 40,000 random inputs: each is counted, and valid messages still pass."""

import json
import random
import socket
from pathlib import Path

import pytest

from drivers.morse import Morse, MorseOptions
from drivers.reason import Reason
from drivers.sim.serial_line import SerialLine
from drivers.uart import Uart, UartOptions
from drivers.udp.driver import Udp, UdpOptions
from drivers.wire import morse, serial_frame
from tests.drivers.host import CAM, SHARED, Host
from tests.drivers.network_benches import EthernetBench

COUNT = 40_000
CAPTURES = json.loads((Path(__file__).parents[1] / "captures" / "frames.json").read_text())
FRAMES = [bytes.fromhex(frame["hex"]) for frame in CAPTURES["frames"]]


def damaged(chance, originals):
    """Yield random octets and damaged originals in turn. An original is cut, lengthened or changed in one place."""
    while True:
        yield chance.randbytes(chance.randrange(120))
        octets = bytearray(chance.choice(originals))
        octets[chance.randrange(len(octets))] = chance.randrange(256)
        yield bytes(octets[: chance.randrange(len(octets) + 1)] if chance.random() < 0.5 else octets)


def resident_kib():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4


class Steady:
    """Check of the resident memory: between a tenth of the flood and its end, it may hardly grow."""

    def __init__(self):
        self.first = 0

    def __call__(self, done):
        if done == COUNT // 10:
            self.first = resident_kib()

    def check(self):
        assert self.first
        assert resident_kib() - self.first < 3000


@pytest.fixture
def steady():
    return Steady()


@pytest.fixture
def counting(loop):
    return Host(loop, keeps=False)


def flood(loop, send, count, steady, messages):
    """Send all inputs in portions that fit into a socket's buffer. Return their number."""
    for done in range(0, COUNT, 100):
        for _ in range(100):
            send(next(messages))
        loop.run_until(lambda expected=done + 100: count() == expected)
        steady(done + 100)


@pytest.mark.parametrize("framing", ["pdu", "btp", "ethernet"])
def test_udp_survives_a_flood_of_noise(loop, counting, steady, framing):
    loop.patience_s = 0.0
    driver = Udp(UdpOptions(framing=framing, listen="127.0.0.1:0"), SHARED)
    driver.start(counting)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.connect(driver.address)
        flood(loop, sender.send, lambda: counting.total, steady, damaged(random.Random(1), FRAMES))
        steady.check()
        driver.refresh()
        assert counting.total == COUNT
        assert Reason.KERNEL_QUEUE not in counting.drops
        before = counting.count
        sender.send(FRAMES[0])
        loop.run_until(lambda: counting.count == before + 1)
    driver.stop()


@pytest.mark.namespace
def test_ethernet_survives_a_flood_of_noise(loop, steady, tmp_path):
    host = Host(loop, keeps=False)
    bench = EthernetBench(loop, tmp_path)
    bench.plug()
    bench.driver.start(host)
    (cable, _) = bench._sockets
    head = FRAMES[0][:14]
    messages = (head + octets for octets in damaged(random.Random(2), [frame[14:] for frame in FRAMES]))
    flood(loop, cable.send, lambda: host.total, steady, messages)
    steady.check()
    bench.driver.refresh()
    assert host.total == COUNT
    before = host.count
    cable.send(FRAMES[0])
    loop.run_until(lambda: host.count == before + 1)


def test_uart_survives_a_flood_of_noise(loop, counting, steady):
    end = SerialLine(loop)
    driver = Uart(UartOptions(device=end.path), SHARED)
    driver.start(counting)
    line = driver._line
    good = serial_frame.encode(2001, CAM)
    chance = random.Random(3)
    messages = damaged(chance, [good, b"V2" * 5 + good])
    for done in range(1, COUNT + 1):
        line._received(next(messages))
        steady(done)
    steady.check()
    assert counting.drops[Reason.FRAMING] > 100
    assert counting.drops[Reason.CHECKSUM] > 100
    assert len(line._frames._waiting) < 2000
    loop.run_for(1)
    before = counting.count
    line._received(good)
    assert counting.count == before + 1
    driver.stop()
    end.unplug()


def hear(driver, file):
    ear = morse.ToneDecoder()
    ear.receive(file)
    driver._running._heard(ear, file)


def test_morse_survives_a_flood_of_noise(counting, steady, tmp_path):
    driver = Morse(MorseOptions(listen=str(tmp_path)), SHARED)
    driver.start(counting)
    file = b"".join(morse.wav(morse.encode(b""), 5))
    chance = random.Random(4)
    messages = damaged(chance, [file[:60], file])
    for done in range(1, COUNT + 1):
        hear(driver, next(messages))
        steady(done)
    steady.check()
    assert counting.total == COUNT
    hear(driver, b"".join(morse.wav(morse.encode(CAM), 5)))
    assert counting.total == COUNT + 1
