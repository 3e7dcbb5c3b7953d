"""Raw sockets for a user who is not root: what gives that right to each form of the program, as README says."""

import re
import shlex
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from tests.system.station import PATIENCE, PROGRAM, ROOT

README = (ROOT / "README.md").read_text()
SECTION = README[README.index("## The binary and the service") : README.index("## Limits")]
(LINES,) = re.findall(r"^```sh rights\n(.*?)^```", SECTION, re.MULTILINE | re.DOTALL)
CAM = "02029b260aa393e6005a6f0da4ae7bfb35a238230a6a3d4290581a90a3f67e02e6928b37fee9fea6103fdf93d980"
NET_RAW = 13  # linux/capability.h
# struct vfs_cap_data of linux/capability.h, revision 2: effective, permitted and inheritable in two words each.
FILE_RIGHT = struct.pack("<5I", 0x02000001, 1 << NET_RAW, 0, 0, 0)
REFUSED = "raw sockets are not permitted"


def form(program: Path) -> str:
    """As README calls it."""
    if program.read_bytes()[:2] == b"#!":
        return "script"
    return "directory" if (program.parent / "_internal").is_dir() else "one file"


FORM = form(Path(PROGRAM[0]))


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "cam.hex").write_text(CAM + "\n")
    return tmp_path


def as_nobody(folder, command, *options, first=":"):
    """Run a command as a user who is not root, in a network of its own, on files of his own.

    Two user namespaces: in the outer one the caller is root, who may give a file a capability; in the inner one he has
    another number (user_namespaces(7)). So the clone may lie where no other user looks, and no right is needed.

    options  of setpriv that give him a right. first: a command that is run before, with all rights. `env` stands for
             his shell: what setpriv itself executes still comes from a process with all rights, and is no setcap case.
    """
    rights = options or ["--inh-caps=-all", "--ambient-caps=-all"]
    inner = f"ip link set lo up && exec {shlex.join(['setpriv', *rights, 'env', *command])}"
    become = ["unshare", "--user", "--map-user=1000", "--map-group=1000", "--net", "--keep-caps", "sh", "-c", inner]
    return subprocess.run(
        ["unshare", "--user", "--map-root-user", "sh", "-c", f"{first} && exec {shlex.join(become)}"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE,
    )


def sending(program):
    """A frame by a raw socket, on a device that every network has."""
    return [program, "replay", "cam.hex", "--ethernet", "lo"]


def readme_setpriv():
    """Options of README's line that set rights: in a namespace with one user there is no other to become."""
    words = shlex.split(LINES)
    assert words[:2] == ["sudo", "setpriv"]
    assert words[words.index(".venv/bin/captain") + 1] == "run"
    return [word for word in words if word.endswith("-caps=+net_raw")]


def readme_unit():
    """What systemd does for AmbientCapabilities= of README's unit (systemd.exec(5)), as options of setpriv."""
    (rights,) = re.findall(r"^AmbientCapabilities=CAP_(\w+)$", SECTION, re.MULTILINE)
    return [f"--inh-caps=+{rights.lower()}", f"--ambient-caps=+{rights.lower()}"]


def readme_setcap():
    """By form: what README says of setcap."""
    return dict(
        re.findall(r"^\| (script|directory|one file) \|.*\| (works|no effect|does not start)", SECTION, re.MULTILINE)
    )


def after_setcap(folder):
    """What becomes of a copy of the program after `setcap cap_net_raw+ep` of it."""
    program, copies = Path(PROGRAM[0]), folder / "copies"
    if FORM == "directory":
        shutil.copytree(program.parent, copies, symlinks=True)
    else:
        copies.mkdir()
        shutil.copy(program, copies)
    copy = str(copies / program.name)
    setting = f"import os; os.setxattr({copy!r}, 'security.capability', {FILE_RIGHT!r})"
    done = as_nobody(folder, sending(copy), first=shlex.join([sys.executable, "-c", setting]))
    if done.returncode == 0:
        return "works"
    return "no effect" if REFUSED in done.stderr else "does not start"


def test_without_a_right_a_raw_socket_is_refused_and_the_remedy_names_what_works(folder):
    done = as_nobody(folder, sending(PROGRAM[0]))
    assert (done.returncode, REFUSED in done.stderr) == (1, True), done.stderr
    assert "AmbientCapabilities=CAP_NET_RAW" in done.stderr
    assert " ".join(["setpriv", *readme_setpriv()]) in " ".join(done.stderr.split())
    assert "setcap" not in done.stderr


@pytest.mark.parametrize("options", [readme_setpriv, readme_unit])
def test_an_ambient_capability_is_a_right_for_each_form(folder, options):
    done = as_nobody(folder, sending(PROGRAM[0]), *options())
    assert done.returncode == 0, done.stderr
    assert "1 sent of 1 read" in done.stderr


def test_setcap_does_for_this_form_what_the_readme_says(folder):
    assert set(readme_setcap()) == {"script", "directory", "one file"}
    assert after_setcap(folder) == readme_setcap()[FORM]
