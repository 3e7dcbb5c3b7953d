"""Faults of a receiver in random order: the driver recovers from each."""

import random
from dataclasses import replace

from board.runtime.errors import InterfaceError, StuckError
from drivers.sim.receiver.habits import Habits
from drivers.sim.receiver.messages import Sky
from tests.drivers.gnss.receiver import Bench
from tests.drivers.test_contract import descriptors

PATIENCE_S = 0.0  # ptys tell when octets are on their way
# Longest time in seconds from the end of a fault to a position. Parts: report of the failure (7 s), start (1 s),
# bring-up (5 s), five epochs that must agree after a jump, a fix.
RECOVERED_S = 20.0
RETRY_S = 1.0


class Station:
    """Host that restarts a failed driver, as a station does; after a StuckError it cycles the power."""

    def __init__(self, bench):
        self.bench = bench
        self.seen = 0
        self.cut = 0
        bench.loop.after(0.0, self.look)

    def look(self):
        bench = self.bench
        bench.loop.after(RETRY_S, self.look)
        if len(bench.host.failures) > self.seen:
            self.seen = len(bench.host.failures)
            bench.driver.stop()
            if isinstance(bench.host.failures[-1], StuckError):
                self.cut += 1
                bench.receiver.power(False)
                bench.receiver.power(True)
            bench.loop.after(RETRY_S / 2, self.start)

    def start(self):
        try:
            self.bench.driver.start(self.bench.host)
        except InterfaceError:
            self.bench.loop.after(RETRY_S, self.start)


def tunnel(receiver):
    receiver.sky = Sky(satellites=0)


def jam(receiver):
    receiver.sky = Sky(jamming=3, satellites=2)


def jump(receiver):
    receiver.sky = Sky(offset=9_000_000)


def hang(receiver):
    receiver.is_mute = True


def stop_listening(receiver):
    receiver.is_deaf = True


def lose_power(receiver):
    receiver.power(False)
    receiver.power(True)


def rubbish(receiver):
    receiver.say(random.Random(5).randbytes(3000))


def heal(receiver):
    receiver.sky = replace(Sky())
    receiver.is_mute = receiver.is_deaf = False


TROUBLE = (tunnel, jam, jump, hang, stop_listening, lose_power, rubbish)


def test_whatever_happens_a_position_is_back_in_time_and_nothing_is_left_behind(loop):
    bench = Bench(loop, Habits(port="uart1")).up()
    station = Station(bench)
    chance = random.Random(4)
    before = len(descriptors())
    for trouble in [*TROUBLE, *chance.choices(TROUBLE, k=5)]:
        trouble(bench.receiver)
        loop.run_for(chance.uniform(1.0, 15.0))
        heal(bench.receiver)
        healed = loop.now
        while not bench.host.fixes or bench.host.fixes[-1].monotonic < healed or not bench.has_fix():
            loop.run_for(0.5)
            assert loop.now - healed < RECOVERED_S, trouble.__name__
        assert bench.host.is_up
        assert len(descriptors()) == before
        del bench.host.fixes[:-1], bench.host.details[:-1]
    assert station.cut <= 2
    bench.close()
