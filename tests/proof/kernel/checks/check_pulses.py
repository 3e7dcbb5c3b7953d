"""pps/device.py on pps-ktimer and pps-gpio, and pps/edges.py on gpio-sim: what the kernel stamps, counts and takes away."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, suppress
from itertools import pairwise
from pathlib import Path

import pytest

from board.description import LineDescription
from board.edges import BUFFER
from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop, Timer
from pps.device import WAIT_NS, PulseDevice
from pps.edges import Edges
from pps.pulse import Clocks, Pulse, read_clocks
from tests.pps.above import Told
from tests.proof.kernel.checks.gpio_sim import GpioSim
from tests.proof.kernel.checks.kernel import Seen, load, run, until

PPS = Path("/dev/pps0")
LINE = 4
DRIVER = Path("/sys/bus/platform/drivers/pps-gpio")
ASSERT = Path("/sys/class/pps/pps0/assert")  # as the kernel itself writes its last stamp down: 1699374899.440174342#445

AGAIN_S = 1.0  # an edge that has not been told by then is too old to be (OLDEST_NS)
AGREE_NS = 20_000_000  # of two clocks: an emulated guest is slow, and may be held up between two readings


@pytest.fixture
def told() -> Told:
    return Told()


@pytest.fixture
def ktimer() -> Iterator[None]:
    """A pulse each second, of the kernel's own ticks."""
    load("pps-ktimer")
    yield
    if PPS.exists():
        run("rmmod", "pps_ktimer")


@pytest.fixture
def chip() -> Iterator[GpioSim]:
    with GpioSim("quad", {LINE: "PPS_IN"}) as made:
        yield made


@pytest.fixture
def pps_gpio(chip: GpioSim) -> Iterator[GpioSim]:
    """pps-gpio at a line that is pulled here."""
    load("pps-gpio")
    load("pps-line", label="quad", offset=LINE)
    yield chip
    run("rmmod", "pps_line")


def edge(chip: GpioSim, kind: str = "rising") -> tuple[Clocks, Clocks]:
    """An edge of a kind, and one of the other; the clocks before and after the first."""
    before = read_clocks()
    chip.pull(LINE, is_high=kind == "rising")
    after = read_clocks()
    chip.pull(LINE, is_high=kind == "falling")
    return before, after


def pull_until(loop: Loop, is_so: Callable[[], object], pull: Callable[[], object]) -> None:
    """Pull a line, and again while it is not so: an edge that a guest held up takes too late is not told, but missed."""
    again: Timer | None = None

    def pulled() -> None:
        nonlocal again
        pull()
        again = loop.after(AGAIN_S, pulled)

    pulled()
    until(loop, is_so)
    assert again is not None
    again.cancel()


def assert_each_between(told: Told, around: Sequence[tuple[Clocks, Clocks]]) -> None:
    """Each edge that is told is between the clocks around its pull; fewer are told as missed."""
    assert sum(told.gaps) < len(told.pulses)
    for pulse in told.pulses:
        assert_between(pulse, *around[pulse.sequence - 1])


def missed(told: Told) -> str:
    return f", {sum(told.gaps)} missed" if told.gaps else ""


def counted() -> int:
    """Edges, as the kernel counts them."""
    return int(ASSERT.read_text().partition("#")[2])


def assert_between(pulse: Pulse, before: Clocks, after: Clocks) -> None:
    """A stamp of the kernel's is between two of ours, by each clock."""
    for place in range(3):
        slack = AGREE_NS if place < 2 else AGREE_NS / 1e9
        assert before[place] - slack <= pulse[place + 1] <= after[place] + slack


def test_pulses_of_the_kernels_timer_are_told_in_sequence(ktimer: None, loop: Loop, told: Told, seen: Seen) -> None:
    device = PulseDevice(loop, PPS, told)
    device.start()
    until(loop, lambda: len(told.pulses) >= 5)
    last = told.pulses[-1]
    stamp_ns = int(ASSERT.read_text().partition("#")[0].replace(".", ""))
    device.stop()
    assert (counted(), stamp_ns) == (last.sequence, last.system_ns)
    assert [later.sequence - earlier.sequence for earlier, later in pairwise(told.pulses)] == [1] * 4
    intervals_ns = [later.system_ns - earlier.system_ns for earlier, later in pairwise(told.pulses)]
    raw_ns = [later.raw_ns - earlier.raw_ns for earlier, later in pairwise(told.pulses)]
    assert all(0.9e9 < each < 2e9 for each in intervals_ns)
    assert raw_ns == pytest.approx(intervals_ns, abs=AGREE_NS)
    shown = ", ".join(f"{each / 1e9:.4f}" for each in intervals_ns)
    apart = max(abs(ours - theirs) for ours, theirs in zip(raw_ns, intervals_ns, strict=True))
    seen(
        f"#{told.pulses[0].sequence} to #{last.sequence}, {shown} s apart; by the raw clock within {apart / 1000:.0f} us"
    )


def test_two_readers_have_each_pulse(ktimer: None, loop: Loop, seen: Seen) -> None:
    both = [Told(), Told()]
    devices = [PulseDevice(loop, PPS, told) for told in both]
    for device in devices:
        device.start()
    until(loop, lambda: all(len(told.pulses) >= 3 for told in both))
    for device in devices:
        device.stop()
    first, second = ([(pulse.sequence, pulse.system_ns) for pulse in told.pulses[:3]] for told in both)
    assert set(first) & set(second)
    assert not [told.gaps for told in both if told.gaps]
    seen(f"#{first[0][0]} to #{first[-1][0]}, the same stamps")


def test_a_driver_that_goes_while_it_is_waited_for_is_told(ktimer: None, loop: Loop, told: Told, seen: Seen) -> None:
    device = PulseDevice(loop, PPS, told)
    device.start()
    until(loop, lambda: told.pulses)
    run("rmmod", "pps_ktimer")
    took_s = until(loop, lambda: told.errors)
    with pytest.raises(InterfaceError, match="No such file"):
        device.start()
    load("pps-ktimer")
    device.start()
    count = len(told.pulses)
    until(loop, lambda: len(told.pulses) > count)
    device.stop()
    seen(f"{told.errors[0].message}, {took_s:.1f} s later; and pulses again")


def test_a_line_of_pps_gpio_is_stamped_when_it_is_pulled(pps_gpio: GpioSim, loop: Loop, told: Told, seen: Seen) -> None:
    device = PulseDevice(loop, PPS, told)
    device.start()
    around: list[tuple[Clocks, Clocks]] = []
    for count in range(1, 4):
        pull_until(loop, lambda: len(told.pulses) >= count, lambda: around.append(edge(pps_gpio)))  # noqa: B023
    device.stop()
    assert_each_between(told, around)
    late_us = [(pulse.system_ns - around[pulse.sequence - 1][0].system_ns) // 1000 for pulse in told.pulses]
    seen(f"{Path('/sys/class/pps/pps0/name').read_text().strip()}: {late_us} us after the pull began{missed(told)}")


def test_silence_is_no_trouble_and_what_nobody_took_is_missed(
    pps_gpio: GpioSim, loop: Loop, told: Told, seen: Seen
) -> None:
    device = PulseDevice(loop, PPS, told)
    device.start()
    silence = loop.after(2.5 * WAIT_NS / 1e9, lambda: None)
    until(loop, lambda: not silence.is_pending)
    assert told.all == []
    for _ in range(50):
        edge(pps_gpio)
    pause = loop.after(0.5, lambda: None)
    until(loop, lambda: not pause.is_pending)
    pull_until(loop, lambda: sum(told.gaps) + len(told.pulses) == counted(), lambda: edge(pps_gpio))
    device.stop()
    assert told.gaps
    seen(f"{2.5 * WAIT_NS / 1e9} s without; of {counted()} edges {sum(told.gaps)} are missed")


def test_pps_gpio_that_is_unbound_is_told_and_had_again(pps_gpio: GpioSim, loop: Loop, told: Told, seen: Seen) -> None:
    device = PulseDevice(loop, PPS, told)
    device.start()
    (DRIVER / "unbind").write_text("pps-gpio")
    took_s = until(loop, lambda: told.errors)
    (DRIVER / "bind").write_text("pps-gpio")
    device.start()
    pull_until(loop, lambda: told.pulses, lambda: edge(pps_gpio))
    device.stop()
    seen(f"{told.errors[0].message}, {took_s:.1f} s later; and pulses again")


def test_a_line_that_pps_gpio_has_is_refused_by_name(pps_gpio: GpioSim, loop: Loop, told: Told, seen: Seen) -> None:
    with pytest.raises(InterfaceError, match="in use by pps") as refused:
        Edges(loop, LineDescription(line="PPS_IN"), told).start()
    assert "/dev/pps0" in refused.value.hint
    seen(refused.value.message)


@pytest.mark.parametrize("kind", ["rising", "falling"])
def test_edges_of_a_line_are_stamped_when_it_is_pulled(
    kind: str, chip: GpioSim, loop: Loop, told: Told, seen: Seen
) -> None:
    chip.pull(LINE, is_high=kind == "falling")
    edges = Edges(
        loop, LineDescription(chip="quad", offset=LINE), told, kind="rising" if kind == "rising" else "falling"
    )
    edges.start()
    around: list[tuple[Clocks, Clocks]] = []
    for count in range(1, 4):
        pull_until(loop, lambda: len(told.pulses) >= count, lambda: around.append(edge(chip, kind)))  # noqa: B023
    edges.stop()
    assert_each_between(told, around)
    seen(f"{edges.where}: #{told.pulses[0].sequence} to #{told.pulses[-1].sequence}{missed(told)}")


def test_edges_beyond_what_the_kernel_keeps_are_missed(chip: GpioSim, loop: Loop, told: Told, seen: Seen) -> None:
    # By clocks of long ago no edge is too old to be told. Of a burst the kernel may count less than came: a line has no
    # interrupt while the one before is still dealt with.
    edges = Edges(loop, LineDescription(line="PPS_IN"), told, clocks=lambda: Clocks(0, 0, 0.0))
    edges.start()
    pull_until(loop, lambda: told.gaps, lambda: [edge(chip) for _ in range(BUFFER + 24)])
    edges.stop()
    kept = len(told.all) - told.all.index(told.gaps[0]) - 1
    assert kept == BUFFER
    seen(f"{told.gaps[0]} are missed, {kept} are there")


def test_a_chip_that_is_unplugged_is_told_and_had_again(chip: GpioSim, loop: Loop, told: Told, seen: Seen) -> None:
    edges = Edges(loop, LineDescription(line="PPS_IN"), told)
    edges.start()
    chip.unplug()
    took_s = until(loop, lambda: told.errors)
    chip.plug()
    edges.start()
    pull_until(loop, lambda: told.pulses, lambda: edge(chip))
    edges.stop()
    seen(f"{told.errors[0].message}, {took_s:.1f} s later; and edges again")


def test_a_stopped_device_lets_go_of_its_driver(ktimer: None, told: Told, seen: Seen) -> None:
    with closing(Loop()) as loop:
        for _ in range(20):
            device = PulseDevice(loop, PPS, told)
            device.start()
            device.stop()
        until(loop, lambda: not _open_devices())
    seen("20 times started and stopped; nothing is open")


def _open_devices() -> list[Path]:
    found = []
    for link in Path("/proc/self/fd").iterdir():
        with suppress(FileNotFoundError):  # the listing's own
            found.append(link.readlink())
    return [path for path in found if path == PPS]
