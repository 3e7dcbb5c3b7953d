"""Freezing of captain for one Debian release and processor, in cached steps."""

import platform
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from image.packages import Package, paths
from image.program import frozen
from image.project import PROJECT
from image.step import Steps, key

HERE = Path(__file__).parent
# Code of all steps; a change of it repeats each step.
CODE = (HERE / "freezing.py", HERE / "frozen.py")


class Chosen(NamedTuple):
    """Packages for one processor. files: folder of their files."""

    packages: list[Package]
    files: Path


class Freezing:
    """Steps of freezing in a build's folder. Each method raises ImageError if a tool fails.

    within  subfolder of these steps; empty: the folder itself.
    """

    def __init__(self, steps: Steps, processor: frozen.Processor, within: str = "") -> None:
        self._steps = steps
        self._processor = processor
        self._within = f"{within}/" if within else ""

    def program(self, there: Chosen, here: Chosen) -> Path:
        """Make the program; return the folder of the step, in which `captain` is the program as a directory.

        there  packages for the program's processor.
        here   the same packages for this machine's processor.
        """
        freezer = self.freezer(there, here)
        return self.joined(freezer, self.foreign(freezer), self.messages(freezer))

    def freezer(self, there: Chosen, here: Chosen) -> Path:
        """Make the two roots, `root` and `here`; if both have the same processor, `here` is a link to `root`."""
        python, ours = frozen.own_python(), platform.machine()

        def make(folder: Path) -> None:
            frozen.unpack(paths(there.files, there.packages), folder / "root", self._processor.name, python)
            if ours == self._processor.name:
                (folder / "here").symlink_to("root")
            else:
                frozen.unpack(paths(here.files, here.packages), folder / "here", ours, python)

        return self._made("freezer", [str(there.packages), str(here.packages), PROJECT / frozen.LOCK], make)

    def foreign(self, freezer: Path) -> Path:
        """Freeze the third-party modules; the result is kept while our modules import the same ones."""
        names = frozen.imports(freezer / "root")
        return self._made(
            "foreign",
            [key(freezer), *names, frozen.SPEC, HERE / "translated.py"],
            lambda folder: frozen.freeze(
                freezer / "here", freezer / "root", self._processor, names, folder / "captain"
            ),
        )

    def messages(self, freezer: Path) -> Path:
        """Compile the module of all messages."""
        return self._made(
            "messages",
            [key(freezer), *frozen.messages_inputs()],
            lambda folder: frozen.compile_messages(freezer / "root", self._processor, frozen.own_python(), folder),
        )

    def joined(self, freezer: Path, foreign: Path, messages: Path) -> Path:
        """Join the program from its layers."""
        module = next(messages.glob("*.so"))
        return self._made(
            "program",
            [key(freezer), key(foreign), key(messages), *frozen.inputs()],
            lambda folder: frozen.join(
                freezer / "here", self._processor, foreign / "captain", module, folder / "captain"
            ),
        )

    def _made(self, name: str, inputs: list[str | Path], make: Callable[[Path], object]) -> Path:
        return self._steps.made(f"{self._within}{name}", [*inputs, *CODE], make)
