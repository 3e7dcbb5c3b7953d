"""Commands of user-data, layer and stage: each is one that `captain box setup` accepts."""

import argparse
import re
import shlex
from pathlib import Path

import pytest

from firmware.commands import box
from tests.image.conventions.mirrors import FOLDER, LAYER, STAGE

# Values of the variables that the builders put in.
VALUES = {
    "$IGconf_captain_board": "quad", "$IGconf_captain_pi": "4", "${CAPTAIN_BOARD:-quad}": "quad", "${CAPTAIN_PI:-4}": "4",
}  # fmt: skip


@pytest.mark.parametrize(
    ("path", "pi"), [(FOLDER / "user-data", None), (LAYER, 4), (STAGE / "00-captain/01-run.sh", 4)]
)
def test_setup_command_of_a_builders_file_is_accepted_and_writes(path: Path, pi: int | None):
    (command,) = re.findall(r"captain (box setup .*)", path.read_text())
    for variable, value in VALUES.items():
        command = command.replace(variable, value)
    parser = argparse.ArgumentParser()
    box.arguments(parser)
    found = parser.parse_args(shlex.split(command)[1:])
    assert (found.do, found.write, found.board, found.pi) == ("setup", True, "quad", pi)
