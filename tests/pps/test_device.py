"""A PPS device: a thread hands edges over, whatever the kernel does meanwhile."""

import errno
import os
import threading
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from board.runtime.errors import InterfaceError
from pps.device import DEPTH, WAIT_NS, PulseDevice
from pps.pulse import OLDEST_NS, STORM_NS, Clocks, Pulse
from tests.pps.above import Told
from tests.pps.kernel import CAPTUREASSERT, CAPTURECLEAR, GPIO, PATIENCE_S, Kernel
from tests.virtual import VirtualLoop

SECOND = 10**9
T = 1_700_000_000 * SECOND  # a moment of the system's clock
LATE_NS = 40_000  # after the edge the thread wakes up


@pytest.fixture
def loop():
    # Edges come from a thread: real time is what bounds a failure.
    with closing(VirtualLoop(patience_s=2.0)) as loop:
        yield loop


@pytest.fixture
def told():
    return Told()


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "pps0"
    path.touch()
    return path


class Bench:
    """A device, the kernel that is played to it, and clocks: the system's is `system_ns`, raw is 5 s less."""

    def __init__(self, loop, path, told, **options):
        self.loop = loop
        self.path = path
        self.told = told
        self.system_ns = T
        self.kernel = Kernel(**{key: options.pop(key) for key in ("can", "does") if key in options})
        self.device = PulseDevice(loop, path, told, ioctl=self.kernel, clocks=self.clocks, **options)

    def clocks(self):
        return Clocks(self.system_ns, self.system_ns - 5 * SECOND, (self.system_ns - T) / 1e9)

    def edge(self, stamp_ns, late_ns=LATE_NS, **how):
        """An edge while the thread waits for it."""
        self.kernel.wait()
        self.system_ns = stamp_ns + late_ns
        self.kernel.pulse(stamp_ns, **how)

    def hear(self, words):
        """Turn the loop until so much was told."""
        self.loop.run_until(lambda: len(self.told.all) >= words)

    def rest(self):
        """Turn the loop for as long as there is something to do: no thread is in between any more."""
        self.loop.patience_s = 0.0
        self.loop.run_for(10.0)

    def end(self):
        threads = [thread for thread in threading.enumerate() if thread.name == self.path.name]
        self.device.stop()
        self.kernel.fail(errno.ENODEV, times=len(threads))
        for thread in threads:
            thread.join(PATIENCE_S)
            assert not thread.is_alive()
        self.kernel.recover()  # a thread that was about to end by itself has left its error


@pytest.fixture
def make(loop, path, told):
    made = []

    def make(**options):
        made.append(Bench(loop, path, told, **options))
        return made[-1]

    yield make
    for bench in made:
        bench.end()


@pytest.fixture
def bench(make):
    bench = make()
    bench.device.start()
    return bench


def descriptors():
    return len(os.listdir("/proc/self/fd"))


# Edges.


def test_an_edge_is_told_with_when_it_was_by_each_clock(bench, told):
    bench.edge(T + 123)
    bench.hear(1)
    assert told.all == [Pulse(1, T + 123, T + 123 - 5 * SECOND, pytest.approx(123e-9, abs=1e-12))]


def test_edges_are_told_in_their_order(bench, told):
    for count in range(1, 5):
        bench.edge(T + count * SECOND)
        bench.hear(count)
    assert [pulse.sequence for pulse in told.all] == [1, 2, 3, 4]
    assert bench.device.tally.taken == 4


def test_edges_of_before_the_start_are_none_of_ours(make, told):
    bench = make()
    bench.kernel.pulse(T - SECOND, count=41)
    bench.device.start()
    bench.edge(T)
    bench.hear(1)
    assert [pulse.sequence for pulse in told.all] == [42]


@pytest.mark.parametrize(("edge", "which"), [("assert", 0), ("clear", 1)])
def test_the_other_edge_is_not_told(make, told, edge, which):
    bench = make(edge=edge, can=GPIO | CAPTURECLEAR, does=CAPTUREASSERT | CAPTURECLEAR)
    bench.device.start()
    bench.edge(T, which=1 - which)
    bench.edge(T + SECOND // 2, which=which)
    bench.hear(1)
    bench.edge(T + SECOND, which=1 - which)
    bench.edge(T + 3 * SECOND // 2, which=which)
    bench.hear(2)
    assert [(pulse.sequence, pulse.system_ns - T) for pulse in told.all] == [(1, SECOND // 2), (2, 3 * SECOND // 2)]


def test_edges_that_the_kernel_counted_and_nobody_saw_are_missed(bench, told):
    bench.edge(T)
    bench.hear(1)
    bench.edge(T + 5 * SECOND, count=5)
    bench.hear(3)
    assert (told.gaps, [pulse.sequence for pulse in told.pulses]) == ([4], [1, 6])
    assert bench.device.tally.missed == 4


def test_the_kernels_count_wraps(make, told):
    bench = make()
    bench.kernel.pulse(T, count=2**32 - 1)
    bench.device.start()
    bench.edge(T + SECOND)
    bench.edge(T + 2 * SECOND)
    bench.hear(2)
    assert [pulse.sequence for pulse in told.all] == [0, 1]


def test_a_loop_that_is_held_up_gets_the_newest_edges_and_how_many_are_missing(bench, told):
    for count in range(DEPTH + 5):
        bench.edge(T + count * SECOND)
    bench.kernel.wait()
    bench.hear(DEPTH + 1)
    assert told.all[0] == 5
    assert [pulse.sequence for pulse in told.pulses] == list(range(6, DEPTH + 6))


@pytest.mark.parametrize("late_ns", [-1, OLDEST_NS + 1], ids=["stepped back", "stepped on, or late"])
def test_an_edge_whose_stamp_is_of_no_use_when_it_is_taken_is_missed(bench, told, late_ns):
    bench.edge(T, late_ns=late_ns)
    bench.edge(T + 3 * SECOND)
    bench.hear(2)
    assert told.all[0] == 1
    assert [pulse.sequence for pulse in told.pulses] == [2]


def test_an_edge_that_comes_while_another_is_taken_is_had_by_a_call_that_does_not_wait(bench):
    bench.edge(T)
    bench.kernel.wait()
    # Start, the thread's first look, the wait that the edge ended, another look, and it waits again.
    assert bench.kernel.waits_ns == [0, 0, WAIT_NS, 0, WAIT_NS]


def test_in_a_storm_of_edges_the_thread_rests_and_the_newest_is_had(bench, told, monkeypatch):
    fetcher = bench.device._fetcher
    rested = []

    def rest(seconds):
        rested.append(seconds)
        bench.kernel.pulse(bench.system_ns, count=1000)
        bench.system_ns += STORM_NS  # and this was the last of them

    monkeypatch.setattr(fetcher._leaves, "wait", rest)
    bench.edge(T)
    bench.edge(T + 1_000_000)
    bench.hear(4)
    bench.kernel.wait()
    assert rested == [0.05]
    assert [what if isinstance(what, int) else what.sequence for what in told.all] == [1, 2, 999, 1002]


# Trouble.


@pytest.mark.parametrize("number", [errno.ETIMEDOUT, errno.EINTR])
def test_an_edge_that_comes_behind_a_call_that_brought_none_is_had_by_one_that_does_not_wait(bench, number):
    bench.kernel.wait()
    bench.kernel.fail(number)
    bench.kernel.wait()
    assert bench.kernel.waits_ns == [0, 0, WAIT_NS, 0, WAIT_NS]


def test_a_time_out_is_no_trouble_as_long_as_the_device_is_there(bench, told):
    bench.kernel.expire()
    bench.kernel.expire()
    bench.edge(T)
    bench.hear(1)
    assert len(told.pulses) == 1


def test_a_signal_is_no_trouble(bench, told):
    bench.kernel.wait()
    bench.kernel.fail(errno.EINTR)
    bench.edge(T)
    bench.hear(1)
    assert len(told.pulses) == 1


@pytest.mark.parametrize("number", [errno.ENODEV, errno.EIO])
def test_a_device_that_ends_is_told_once_and_may_be_started_again(bench, told, number):
    bench.kernel.wait()
    bench.kernel.fail(number)
    bench.hear(1)
    (error,) = told.all
    assert str(error).startswith(f"{bench.path}: {os.strerror(number)}")
    assert error.hint
    bench.device.start()
    bench.edge(T)
    bench.hear(2)
    assert len(told.pulses) == 1


def test_a_device_that_is_gone_is_told_though_its_calls_only_time_out(bench, told):
    bench.kernel.wait()
    bench.path.unlink()
    bench.kernel.expire()
    bench.hear(1)
    assert "it is gone" in str(told.errors[0])


def test_a_device_that_went_and_came_back_is_another(bench, told):
    bench.kernel.wait()
    bench.path.rename(bench.path.with_name("pps0-before"))
    bench.path.touch()
    bench.kernel.expire()
    bench.hear(1)
    assert "it is gone" in str(told.errors[0])


def test_an_edge_before_the_end_is_told_first(bench, told):
    bench.edge(T)
    bench.kernel.wait()
    bench.kernel.fail(errno.ENODEV)
    bench.hear(2)
    assert isinstance(told.all[0], Pulse)
    assert isinstance(told.all[1], InterfaceError)


@pytest.mark.parametrize(("options", "words", "hint"), [
    ({"can": 0x1150}, "stamps no assert edges (capabilities 0x1150)", "stamps no edges"),
    ({"edge": "clear"}, "stamps no clear edges (capabilities 0x1151)", "use the edge assert"),
    ({"can": 0x1051}, "it does not support waiting (capabilities 0x1051)", "pps-gpio"),
    ({"does": 0}, "assert edges are switched off (mode 0x0)", "PPS_SETPARAMS"),
])  # fmt: skip
def test_a_device_that_cannot_do_what_is_needed_is_refused(make, options, words, hint):
    bench = make(**options)
    before = descriptors()
    with pytest.raises(InterfaceError) as refused:
        bench.device.start()
    assert refused.value.message == f"{bench.path}: {words}"
    assert hint in refused.value.hint
    assert descriptors() == before


@pytest.mark.parametrize(("path", "words", "hint"), [
    ("/dev/no-such-pps", "No such file or directory", "dtoverlay=pps-gpio"),
    ("/dev/null", "Inappropriate ioctl for device", "/sys/class/pps"),
])  # fmt: skip
def test_a_path_that_is_no_device_is_refused_by_the_kernel_itself(loop, told, path, words, hint):
    with pytest.raises(InterfaceError, match=f"{path}: {words}") as refused:
        PulseDevice(loop, Path(path), told).start()
    assert hint in refused.value.hint


def test_a_path_that_no_file_can_have_is_refused(loop, told):
    with pytest.raises(InterfaceError, match="embedded null"):
        PulseDevice(loop, Path("/dev/pps\0x"), told).start()


@pytest.mark.parametrize(("number", "hint"), [
    (errno.EACCES, "udev rule"), (errno.EPERM, "udev rule"), (errno.ENODEV, "dtoverlay"), (errno.EBUSY, "dmesg"),
])  # fmt: skip
def test_a_device_that_cannot_be_opened_is_refused_with_what_to_do(make, monkeypatch, number, hint):
    def refuse(*_):
        raise OSError(number, os.strerror(number))

    bench = make()
    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(InterfaceError, match=os.strerror(number)) as refused:
        bench.device.start()
    assert hint in refused.value.hint


def test_a_thread_that_ends_by_a_bug_ends_the_loop(bench):
    bench.kernel.wait()
    bench.kernel.fail(ValueError("a bug"))
    with pytest.raises(RuntimeError, match="its thread ended") as raised:
        bench.hear(1)
    assert isinstance(raised.value.__cause__, ValueError)


# The end.


def test_stopping_does_not_wait_for_the_thread_and_nothing_is_told_after_it(bench, told):
    bench.edge(T)
    bench.kernel.wait()
    bench.device.stop()
    bench.kernel.pulse(T + SECOND)
    bench.end()
    bench.rest()
    assert told.all == []


def test_stopping_twice_is_stopping_once_and_starting_twice_starting_once(bench, told):
    bench.device.start()
    bench.edge(T)
    bench.hear(1)
    bench.device.stop()
    bench.device.stop()
    assert len(told.all) == 1


def test_a_device_may_be_started_again_while_the_thread_of_before_still_waits(bench, told):
    bench.kernel.wait()
    bench.device.stop()
    bench.device.start()
    bench.edge(T)
    bench.hear(1)
    bench.edge(T + SECOND)
    bench.hear(2)
    assert [pulse.sequence for pulse in told.all] == [1, 2]


@pytest.mark.parametrize("count", [1, 4], ids=["at a pulse", "at missed ones"])
def test_whoever_hears_may_stop_it(bench, told, count):
    told.then = bench.device.stop
    bench.edge(T, count=count)
    bench.kernel.wait()
    bench.edge(T + SECOND)
    bench.hear(1)
    bench.end()
    bench.rest()
    assert len(told.all) == 1


def test_whoever_hears_of_the_end_may_start_it_again(bench, told):
    told.then = bench.device.start
    bench.kernel.wait()
    bench.kernel.fail(errno.ENODEV)
    bench.hear(1)
    bench.edge(T)
    bench.hear(2)
    assert isinstance(told.all[1], Pulse)


def test_no_descriptor_is_left_behind(make):
    before = descriptors()
    bench = make()
    for _ in range(3):
        bench.device.start()
        bench.kernel.wait()
        bench.device.stop()
        bench.kernel.pulse(T)
    bench.device.start()
    bench.end()
    assert descriptors() == before


# Anything, in any order.

ACTIONS = st.sampled_from(
    ["edge", "edge", "edges", "other edge", "time-out", "signal", "turn", "turn", "end", "restart"]
)


@settings(max_examples=60)
@given(actions=st.lists(ACTIONS, max_size=40), first=st.sampled_from([0, 7, 2**32 - 3]))
def test_whatever_happens_each_edge_is_told_or_missed_once(loop, path, actions, first):
    told = Told()
    bench = Bench(loop, path, told, can=GPIO | CAPTURECLEAR, does=CAPTUREASSERT | CAPTURECLEAR)
    bench.kernel.pulse(T, count=first)
    last, sessions = bench.kernel.sequences[0], []
    now_ns = T
    bench.device.start()
    try:
        for action in [*actions, "edge"]:
            now_ns += SECOND
            match action:
                case "edge" | "edges":
                    bench.edge(now_ns, count=1 + 3 * (action == "edges"))
                case "other edge":
                    bench.edge(now_ns, which=1)
                case "time-out":
                    bench.kernel.expire()
                case "signal":
                    bench.kernel.wait()
                    bench.kernel.fail(errno.EINTR)
                case "turn":
                    hear_all(bench)
                case "end":
                    bench.kernel.wait()
                    bench.kernel.fail(errno.ENODEV)
                    bench.loop.run_until(lambda: told.errors)
                case "restart":
                    hear_all(bench)
                    bench.device.stop()
            if action in {"end", "restart"}:
                sessions.append((last, list(told.all)))
                last = bench.kernel.sequences[0]
                told.__init__()
                bench.end()
                bench.device.start()
        hear_all(bench)
        assert told.pulses[-1].sequence == bench.kernel.sequences[0]
    finally:
        bench.end()
    for before, all_told in [*sessions, (last, told.all)]:
        expected = before
        for what in all_told:
            if isinstance(what, Pulse):
                expected = (expected + 1) % 2**32
                assert what.sequence == expected
            elif isinstance(what, int):
                expected = (expected + what) % 2**32
            else:
                assert what is all_told[-1]


def hear_all(bench):
    """Turn the loop until it has heard of all edges that there were; the thread waits for another."""
    bench.kernel.wait()
    patience_s, bench.loop.patience_s = bench.loop.patience_s, 0.0
    bench.loop.turn()
    bench.loop.patience_s = patience_s
