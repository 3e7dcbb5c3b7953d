"""Backend: the contract of an output format, and its job."""

from collections.abc import Callable
from pathlib import Path
from typing import Literal, NamedTuple, Protocol

from asn1.backends.ros2.options import Ros2Options
from asn1.model.types import Message, Schema

# version of the generated library; before 1.0 a minor version may change the structs, so the SONAME contains it
VERSION = "0.1.0"

Progress = Callable[[str], None]
"""Is called with the name of each step when it begins."""

OwnOption = Literal["profile", "distro", "ros2"]
"""An option of `generate` that only some forms have."""


class BackendError(Exception):
    """The format cannot be written; str() gives the reason."""


class Job(NamedTuple):
    """Messages to write.

    messages  their names in the schema.
    ros2      options for ROS 2: names of messages, and code that converts to them.
    """

    schema: Schema
    messages: tuple[str, ...]
    ros2: Ros2Options = Ros2Options()

    @property
    def editions(self) -> list[Message]:
        return [self.schema.messages[name] for name in self.messages]


class Backend(Protocol):
    """One output format. Most formats inherit `FileBackend` (output.py) and implement `fill`.

    name       value of --format; the manifest of a written folder contains it
    summary    its line in the menu
    next_step  text that tells the user how to use the files; {folder} is replaced
    options    options of `OwnOption` that it accepts
    """

    name: str
    summary: str
    next_step: str
    options: tuple[OwnOption, ...]

    def default_folder(self) -> str:
        """Return the folder that the menu proposes."""

    def steps(self, job: Job) -> int:
        """Return the largest number of calls of `progress` by `write`."""

    def parts(self, folder: Path) -> set[str]:
        """Return names of parts that the next `write` may remove from this folder; empty for most formats."""

    def write(self, job: Job, folder: Path, progress: Progress) -> int:
        """Write the format. Returns the number of changed files. Raises BackendError, OSError."""
