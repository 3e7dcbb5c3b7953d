"""Raw sockets without root: the guide's ways to grant the right, for each program form."""

import re
import shlex
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from tests.documents import blocks
from tests.system.station import PATIENCE, PROGRAM, ROOT

GUIDE = (ROOT / "firmware/guide/service.md").read_text()
(LINES,) = blocks(GUIDE, "sh rights")
CAM = "02029b260aa393e6005a6f0da4ae7bfb35a238230a6a3d4290581a90a3f67e02e6928b37fee9fea6103fdf93d980"
NET_RAW = 13  # number of CAP_NET_RAW in linux/capability.h
# struct vfs_cap_data of linux/capability.h, revision 2: effective, permitted and inheritable in two words each.
FILE_RIGHT = struct.pack("<5I", 0x02000001, 1 << NET_RAW, 0, 0, 0)
REFUSED = "raw sockets are not permitted"


def form(program: Path) -> str:
    """Return the form of the program, by the guide's name for it."""
    if program.read_bytes()[:2] == b"#!":
        return "script"
    return "directory" if (program.parent / "_internal").is_dir() else "one file"


FORM = form(Path(PROGRAM[0]))


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "cam.hex").write_text(CAM + "\n")
    return tmp_path


def as_nobody(folder, command, *options, first=":"):
    """Run a command as a user without root rights, in a network namespace of its own and on files of its own.

    There are two user namespaces (user_namespaces(7)). In the outer one the caller is root and may give a file a
    capability. In the inner one the caller has another user id. So the test needs no rights, and the clone may be in a
    folder that other users cannot read.

    options  options of setpriv that grant a right.
    first    command that runs before, with all rights.

    `env` takes the place of the user's shell: a program that setpriv executes itself would start from a process with
    all rights, which is not the case that setcap is for.
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
    """Return a command that sends a frame by a raw socket on the loopback, which every network namespace has."""
    return [program, "replay", "cam.hex", "--ethernet", "lo"]


def guide_setpriv():
    """Return the options of the guide's setpriv line that set rights, without those that choose the user."""
    words = shlex.split(LINES)
    assert words[:2] == ["sudo", "setpriv"]
    assert words[words.index(".venv/bin/captain") + 1] == "run"
    return [word for word in words if word.endswith("-caps=+net_raw")]


def guide_unit():
    """Return setpriv options with the effect of AmbientCapabilities= in the guide's unit (systemd.exec(5))."""
    (rights,) = re.findall(r"^AmbientCapabilities=CAP_(\w+)$", GUIDE, re.MULTILINE)
    return [f"--inh-caps=+{rights.lower()}", f"--ambient-caps=+{rights.lower()}"]


def guide_setcap():
    """Return the guide's statement about setcap for each form of the program."""
    return dict(
        re.findall(r"^\| (script|directory|one file) \|.*\| (works|no effect|does not start)", GUIDE, re.MULTILINE)
    )


def after_setcap(folder):
    """Run a copy of the program after `setcap cap_net_raw+ep` and return the result."""
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
    assert " ".join(["setpriv", *guide_setpriv()]) in " ".join(done.stderr.split())
    assert "setcap" not in done.stderr


@pytest.mark.parametrize("options", [guide_setpriv, guide_unit])
def test_an_ambient_capability_is_a_right_for_each_form(folder, options):
    done = as_nobody(folder, sending(PROGRAM[0]), *options())
    assert done.returncode == 0, done.stderr
    assert "1 sent of 1 read" in done.stderr


def test_setcap_does_for_this_form_what_the_guide_says(folder):
    assert set(guide_setcap()) == {"script", "directory", "one file"}
    assert after_setcap(folder) == guide_setcap()[FORM]
