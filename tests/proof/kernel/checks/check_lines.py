"""board/line.py on gpio-sim: the kernel's own character devices, whose lines are pulled and looked at from below."""

from collections.abc import Iterator

import pytest

from board.description import LineDescription
from board.line import Lines, OutputLine
from board.runtime.errors import InterfaceError
from tests.proof.kernel.checks.gpio_sim import GpioSim
from tests.proof.kernel.checks.kernel import Seen


@pytest.fixture
def chip() -> Iterator[GpioSim]:
    with GpioSim("quad", {3: "SLOT1_RESET"}) as made:
        yield made


def test_a_line_is_found_by_the_label_of_its_chip(chip: GpioSim, seen: Seen) -> None:
    line = OutputLine(LineDescription(chip="quad", offset=5, initial="inactive"))
    levels = [chip.is_high(5)]
    for is_active in (True, False):
        line.set(is_active)
        assert line.is_active is is_active
        levels.append(chip.is_high(5))
    line.close()
    assert levels == [False, True, False]
    seen(f"{chip.device}, label quad, line 5: low, high, low")


def test_a_line_is_found_by_its_name_and_is_active_low(chip: GpioSim, seen: Seen) -> None:
    line = OutputLine(LineDescription(line="SLOT1_RESET", active_low=True, initial="active"))
    assert not chip.is_high(3)
    line.set(False)
    assert chip.is_high(3)
    assert not line.is_active
    line.close()
    seen("SLOT1_RESET: active is low")


def test_a_line_that_is_kept_is_as_it_was_until_it_is_set(chip: GpioSim, seen: Seen) -> None:
    chip.pull(5, is_high=True)
    line = OutputLine(LineDescription(chip="quad", offset=5))
    assert line.is_active
    chip.pull(5, is_high=False)
    assert not line.is_active
    line.set(True)
    assert chip.is_high(5)
    line.close()
    seen("follows its pull, then drives")


def test_an_open_drain_line_drives_low_and_lets_go(chip: GpioSim, seen: Seen) -> None:
    chip.pull(5, is_high=True)
    line = OutputLine(LineDescription(chip="quad", offset=5, active_low=True, open_drain=True, initial="active"))
    assert not chip.is_high(5)
    line.set(False)
    assert chip.is_high(5)
    assert not line.is_active
    chip.pull(5, is_high=False)
    assert line.is_active  # somebody else holds it low
    line.close()
    seen("low when active; let go it follows its pull")


def test_a_line_that_somebody_has_is_refused_by_name(chip: GpioSim, seen: Seen) -> None:
    first = OutputLine(LineDescription(chip="quad", offset=5, initial="inactive"))
    with pytest.raises(InterfaceError) as refused:
        OutputLine(LineDescription(chip="quad", offset=5, initial="inactive"))
    first.close()
    assert "in use by captain" in refused.value.message
    OutputLine(LineDescription(chip="quad", offset=5, initial="inactive")).close()
    seen(refused.value.message)


def test_a_chip_that_is_unplugged_is_told_and_found_again(chip: GpioSim, seen: Seen) -> None:
    lines = Lines({"reset": LineDescription(line="SLOT1_RESET", initial="inactive")})
    lines.open()
    assert not lines.faults
    chip.unplug()
    with pytest.raises(InterfaceError) as gone:
        lines.set("reset", True)
    assert "reset" in lines.faults
    lines.close()
    chip.plug()
    lines.set("reset", True)
    assert chip.is_high(3)
    assert not lines.faults
    lines.close()
    seen(gone.value.message)


@pytest.mark.parametrize(
    "description",
    [
        LineDescription(chip="no such label", offset=1),
        LineDescription(line="NO_SUCH_LINE"),
        LineDescription(chip="gpiochip99", offset=1),
        LineDescription(chip="quad", offset=99),
    ],
    ids=["label", "name", "path", "offset"],
)
def test_a_line_that_is_not_there_is_refused(description: LineDescription, chip: GpioSim, seen: Seen) -> None:
    with pytest.raises(InterfaceError) as refused:
        OutputLine(description)
    assert refused.value.hint
    seen(refused.value.message)
