"""The example user-data for cloud-init: what its commands do, and when the machine restarts."""

import os
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

from firmware.card.imager import COMMANDS
from image.project import PROJECT

FILE = PROJECT / "image/conventions/user-data"
BOOT, MARK = "/boot/firmware", "/run/captain-box-made"


@pytest.fixture
def settings() -> dict[str, Any]:
    text = FILE.read_text()
    assert text.startswith("#cloud-config\n")  # cloud-init ignores a file without this line
    loaded: dict[str, Any] = yaml.safe_load(text)
    return loaded


class Machine:
    """Folder with the boot partition's files, and programs that write down their arguments."""

    def __init__(self, folder: Path, failing: str) -> None:
        self.folder = folder
        for name in ("apt-get", "captain"):
            program = folder / "bin" / name
            program.parent.mkdir(exist_ok=True)
            program.write_text(f'#!/bin/sh\necho "{name} $*" >>{folder}/called\n[ {name} != "{failing}" ]\n')
            program.chmod(0o755)
        for name in ("captain_1_arm64.deb", "captain-box_1_all.deb"):
            (folder / name).touch()

    def run(self, settings: dict[str, Any]) -> list[str]:
        """Run the commands as cloud-init does: one script of all items. Returns the calls of the programs."""
        script = "".join(settings["runcmd"]).replace(BOOT, str(self.folder)).replace(MARK, str(self.folder / "mark"))
        path = f"{self.folder}/bin:{os.environ['PATH']}"
        subprocess.run(["sh", "-c", script], env={**os.environ, "PATH": path}, check=False)
        return (self.folder / "called").read_text().replace(f"{self.folder}/", "").splitlines()

    def is_restarted(self, settings: dict[str, Any]) -> bool:
        condition = settings["power_state"]["condition"].replace(MARK, str(self.folder / "mark"))
        return subprocess.run(["sh", "-c", condition], check=False).returncode == 0


INSTALLS = "apt-get install --yes --no-install-recommends captain-box_1_all.deb captain_1_arm64.deb"
SETS_UP = "captain box setup --write --board quad"


@pytest.mark.parametrize(
    ("failing", "called", "is_restarted"),
    [("", [INSTALLS, SETS_UP], True), ("apt-get", [INSTALLS], False), ("captain", [INSTALLS, SETS_UP], False)],
)
def test_first_start_restarts_only_after_install_and_setup_succeeded(
    settings: dict[str, Any], tmp_path: Path, failing: str, called: list[str], is_restarted: bool
):
    machine = Machine(tmp_path, failing)
    assert machine.run(settings) == called
    assert machine.is_restarted(settings) is is_restarted
    assert settings["power_state"]["mode"] == "reboot"


def test_names_and_logins_in_the_example_are_valid_once_uncommented():
    lines = FILE.read_text().splitlines()[1:]
    own = yaml.safe_load("\n".join(line.removeprefix("#") for line in lines if not re.match(r"# \w", line)))
    assert own["hostname"] == "captain-7"
    assert own["users"][0]["ssh_authorized_keys"] == ["ssh-ed25519 AAAA... you@computer"]
    # useradd refuses the name of a group, of which base-passwd has some; preinst refuses captain
    groups = [row.partition(":")[0] for row in Path("/usr/share/base-passwd/group.master").read_text().splitlines()]
    assert own["users"][0]["name"] not in {*groups, "captain"}
    assert own["users"][0]["sudo"] == "ALL=(ALL) NOPASSWD:ALL"  # it has no password that sudo could ask for
    assert COMMANDS & own.keys() == {"runcmd"}
