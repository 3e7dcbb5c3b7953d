"""captain box setup in a Debian root: made, reverted, and reverted once more by the removal of captain-box."""

import subprocess
from collections.abc import Iterator

from tests.programs.debian import Debian
from tests.proof.image.rows import Row

BOOT = {
    "config.txt": "dtparam=audio=on\n\n[cm4]\notg_mode=1\n",
    "cmdline.txt": "console=serial0,115200 console=tty1 rootwait\n",
}
# The header's serial port has a module, so that its console is freed.
BOARD = 'name = "mine"\n[pulse]\ndevice = "/dev/pps0"\ngpio = 18\n[interfaces.gnss]\ndriver = "zed_f9p"\nport = "/dev/serial0"\n'
PLACE = "/etc/captain/mine.toml"
# Octets of all that a setup may change, and the members of groups.
FILES = "cat /boot/firmware/*; find /etc -type f ! -path '/etc/*-' -exec md5sum {} + | sort; ls /var/lib"
SETUP = ("captain", "box", "setup", "--board", PLACE, "--pi", "4")


def lay_out(debian: Debian) -> None:
    """Write the boot partition of a Raspberry Pi, which is a folder here."""
    folder = debian.root / "boot/firmware"
    folder.mkdir()
    for name, text in BOOT.items():
        (folder / name).write_text(text)


def rows(debian: Debian) -> Iterator[Row]:
    """Make and revert a setup, and leave another one made, for the removal of captain-box."""
    (debian.root / PLACE[1:]).write_text(BOARD)
    before = debian.run("sh", "-c", FILES).stdout
    ended = debian.run(*SETUP)
    last = _last(ended)
    yield Row("setup names what is missing", last, "exit status 1", ended.returncode == 1 and "missing: " in last)
    ended = debian.run(*SETUP, "--write")
    yield Row("setup --write", _last(ended), "exit status 0", ended.returncode == 0)
    changed = debian.run("sh", "-c", FILES).stdout != before
    ended = debian.run(*SETUP)
    yield Row("setup again", _last(ended), "no setting is missing", ended.returncode == 0 and changed)
    ended = debian.run("captain", "box", "setup", "--undo")
    is_before = debian.run("sh", "-c", FILES).stdout == before
    yield Row("setup --undo leaves all files", "as before" if is_before else _last(ended), "as before", is_before)
    ended = debian.run(*SETUP, "--write")
    yield Row("setup for the purge", _last(ended), "exit status 0", ended.returncode == 0)
    (debian.root / PLACE[1:]).unlink()


def reverted(debian: Debian) -> Row:
    """Compare the boot partition with that of lay_out()."""
    files = {path.name: path.read_text() for path in (debian.root / "boot/firmware").iterdir()}
    return Row("purge reverts the setup", ", ".join(sorted(files)), "the former octets", files == BOOT)


def _last(ended: "subprocess.CompletedProcess[str]") -> str:
    return (ended.stdout.strip().splitlines() or ["nothing said"])[-1]
