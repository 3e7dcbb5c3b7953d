"""A GPIO chip of the kernel's simulator: whatever takes its lines, they are pulled and looked at here.

Source: the kernel's Documentation/admin-guide/gpio/gpio-sim.rst.
"""

from collections.abc import Mapping
from pathlib import Path

from tests.proof.kernel.checks.kernel import CONFIGFS, load

LINES = 16


class GpioSim:
    """A chip with a label and lines with names; unplugged at the end."""

    def __init__(self, label: str, names: Mapping[int, str]) -> None:
        load("gpio-sim")
        self._folder = CONFIGFS / "gpio-sim" / label
        bank = self._folder / "bank"
        bank.mkdir(parents=True)
        (bank / "num_lines").write_text(str(LINES))
        (bank / "label").write_text(label)
        for offset, name in names.items():
            (bank / f"line{offset}").mkdir()
            if name:
                (bank / f"line{offset}/name").write_text(name)
        self._names = names
        self.plug()

    def __enter__(self) -> "GpioSim":
        return self

    def __exit__(self, *_: object) -> None:
        self.unplug()
        for offset in self._names:
            (self._folder / f"bank/line{offset}").rmdir()
        (self._folder / "bank").rmdir()
        self._folder.rmdir()

    def plug(self) -> None:
        (self._folder / "live").write_text("1")
        self.device = (self._folder / "bank/chip_name").read_text().strip()
        name = (self._folder / "dev_name").read_text().strip()
        self._lines = Path("/sys/devices/platform", name, self.device)

    def unplug(self) -> None:
        """Take it away; idempotent."""
        (self._folder / "live").write_text("0")

    def is_high(self, offset: int) -> bool:
        """The level of a line, whoever drives it."""
        return (self._lines / f"sim_gpio{offset}/value").read_text().strip() == "1"

    def pull(self, offset: int, is_high: bool) -> None:
        """Pull a line from outside: what it is when nobody drives it."""
        (self._lines / f"sim_gpio{offset}/pull").write_text("pull-up" if is_high else "pull-down")
