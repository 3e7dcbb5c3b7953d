"""The guide image/guide/flash.md, followed to the letter; only the card's path and the box's address differ."""

import os
import re
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path

from tests.proof.image.console_notes import notes, taken_away, told
from tests.proof.image.login import Key, said, wait_for_ssh
from tests.proof.image.machine import Guest, Ports, powered, put, virt
from tests.proof.image.rows import Row
from tests.proof.image.user import user

PROJECT = Path(__file__).resolve().parents[3]
PAGE = (PROJECT / "image/guide/flash.md").read_text()
BLOCKS = {
    kind: re.findall(rf"^```{kind} box\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL) for kind in ("sh", "toml", "text")
}
# Where a desktop mounts the card, and the box's name, which this machine's network does not tell: QEMU forwards ports.
MOUNTED, NAME = "/media/$USER/BOOT", "captain-7.local"
# The page's addresses in QEMU's network. By DHCP it would be another: this one is there by box.toml alone.
ADDRESS, GATEWAY = "10.0.2.77", "10.0.2.2"
THERE = {"10.0.0.20": ADDRESS, "10.0.0.1": GATEWAY}
STATIC = partial(virt, address=ADDRESS)
# By the kernel's word: an address with an end to its time.
LEASES = "ip -4 -o address show dev eth0 dynamic | wc -l"
HEARTBEAT = "[b'hb.counter'"
# Nobody is near, but what leaves is recorded, too: a beacon every three seconds.
RECORDER = """
[recorder]
folder = "ring"
[interfaces.near]
driver = "udp"
listen = "127.0.0.1:9001"
peers = ["127.0.0.1:9002"]
"""
RING = "/data/captain/ring/ring-*.pcapng"


def rows(card: Path, folder: Path, key: Key) -> Iterator[Row]:
    """Its commands and files as they stand."""
    home, mounted, desk = folder / "home", folder / "BOOT", folder / "desk"
    for path in (home / ".ssh", mounted, desk):
        path.mkdir(parents=True)
    for name in ("id_ed25519", "id_ed25519.pub"):
        shutil.copy(folder / name, home / ".ssh" / name)  # with its mode: ssh takes no key that others may read
    # With all of it, that is left out too.
    box = re.sub(r"(?m)^# (?=\w+ = |\[)", "", BLOCKS["toml"][0])
    for page, there in THERE.items():
        box = box.replace(f'"{page}', f'"{there}')
    (desk / "box.toml").write_text(box)
    (desk / "captain.toml").write_text(f'[station]\nname = "captain-7"\n{RECORDER}')
    prepare, connect = BLOCKS["sh"]
    done = _run(prepare.replace(MOUNTED, str(mounted)), desk, home)
    verdict = (done.stdout.strip().splitlines() or [done.stderr])[-1]
    yield Row("guide: Your files", verdict[:40], "the box will take it", verdict.startswith("the box will take it"))
    taken_away(card, "board.toml", "user-data")
    put(card, {path.name: path.read_bytes() for path in mounted.iterdir()})
    with powered(card, folder, machine=STATIC) as guest:
        shown = notes(guest)
        for line in BLOCKS["text"][0].splitlines():
            yield told(shown, "guide: first lines", line.removeprefix("! "))
        wait_for_ssh(guest)
        with user(guest.ports) as one:
            one.heartbeat()
        status, heartbeat = connect.splitlines()
        found = _run(status, desk, home, guest.ports).stdout.splitlines()[:1]
        yield Row("guide: ssh, captain status", found[0][:40] if found else "nothing", "it answers", bool(found))
        found = _run(_local(heartbeat, guest.ports), desk, home).stdout.split(",")[:1]
        yield Row("guide: a heartbeat by pyzmq", found[0] if found else "nothing", HEARTBEAT, found == [HEARTBEAT])
        yield from _as_written(guest, key)
        yield _recorded(guest, key)


def _as_written(guest: Guest, key: Key) -> Iterator[Row]:
    """What box.toml of the page has asked for."""
    for what, command, goal in (
        ("host name", "hostname", "captain-7"),
        ("time zone", "readlink /etc/localtime", "/usr/share/zoneinfo/Europe/Berlin"),
        ("address of eth0", "ip -4 -o address show dev eth0 scope global | awk '{print $4}'", f"{ADDRESS}/24"),
        ("leases of eth0", LEASES, "0"),
        ("way out", "ip route show default | cut -d ' ' -f 3,6-7", f"{GATEWAY} proto static"),
        ("passwords on the partition", "cat /boot/firmware/box.toml 2>&1 | grep -c 'Permission denied'", "1"),
        ("units that have failed", "systemctl --failed --plain --no-legend | wc -l", "0"),
    ):
        found = said(guest, key, command)
        yield Row(f"box.toml: {what}", found[:40], goal, found == goal)


def _recorded(guest: Guest, key: Key) -> Row:
    """A section, and a block of an interface at least, as operator reads it. Source: pcapng, section header block."""
    wait = f"for _ in $(seq 60); do [ $(cat {RING} 2>/dev/null | wc -c) -gt 200 ] && break; sleep 1; done"
    found = said(guest, key, f"{wait}; cat {RING} | head -c 4 | od -An -tx1", 600).strip()
    return Row(
        "the flight recorder's ring, as operator reads it",
        found[:40] or "nothing",
        "0a 0d 0d 0a",
        found == "0a 0d 0d 0a",
    )


def _run(script: str, folder: Path, home: Path, ports: Ports | None = None) -> "subprocess.CompletedProcess[str]":
    """A block of the page, in a shell with this project's commands; ssh finds the box by its name."""
    programs = home / "bin"
    programs.mkdir(exist_ok=True)
    if ports is not None:
        options = "StrictHostKeyChecking=no UserKnownHostsFile=/dev/null LogLevel=ERROR BatchMode=yes ConnectTimeout=60"
        words = [f"HostName=127.0.0.1 Port={ports.ssh} IdentityFile={home}/.ssh/id_ed25519", options]
        given = " ".join(f"-o {word}" for each in words for word in each.split())
        (programs / "ssh").write_text(f'#!/bin/sh\nexec /usr/bin/ssh {given} "$@"\n')
        (programs / "ssh").chmod(0o755)
    script = script.replace("~/", f"{home}/")
    path = f"{programs}:{PROJECT}/.venv/bin:{os.environ['PATH']}"
    environment: Mapping[str, str] = {**os.environ, "HOME": str(home), "PATH": path}
    return subprocess.run(
        ["bash", "-eu", "-c", script],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def _local(script: str, ports: Ports) -> str:
    return script.replace(f"{NAME}:5556", f"127.0.0.1:{ports.to_users}")
