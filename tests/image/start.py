"""The card starts, twice, with a power cut between, and is looked at from outside."""

import itertools
import json
import time
from collections.abc import Generator, Iterator
from pathlib import Path

import zmq

from tests.image.login import Key, new_key, said, ssh, wait_for_ssh
from tests.image.machine import Guest, NotSeenError, owned, powered
from tests.image.rows import Options, Row

HEARTBEATS = 3
TOPIC = b"hb."


def rows(card: Path, folder: Path, _options: Options) -> Iterator[Row]:
    key = new_key(folder)
    own = owned(card, folder, {"authorized_keys": key.line})
    with powered(own, folder) as guest:
        yield from _start(guest)
        yield from _console(guest)
        yield from _endpoint(guest)
        first = yield from _inside(guest, key)
        yield _without_key(guest)
    with powered(own, folder) as guest:  # its power was cut
        guest.wait("slots: trying A, 2 tries left")
        yield Row("tries of slot A after a healthy start", "3, and one is taken again", "put back to 3", True)
        wait_for_ssh(guest)
        name = said(guest, key, "cat /etc/machine-id")
        is_same = name == first
        yield Row("machine-id after a power cut", "the same" if is_same else name[:30], "the same", is_same)
        boots = said(guest, key, "journalctl --list-boots -q | wc -l")
        yield Row("starts in the journal after a power cut", boots, "2", boots == "2")


def _start(guest: Guest) -> Iterator[Row]:
    guest.wait("slots: trying A, 2 tries left")
    guest.wait("Starting kernel")
    yield Row("U-Boot's script starts slot A", f"{time.monotonic() - guest.began:.1f} s after power", "", True)


def _console(guest: Guest) -> Iterator[Row]:
    began = time.monotonic()
    guest.wait("captain")
    yield Row(
        "the serial console shows the station", f"{time.monotonic() - began:.1f} s after the kernel's start", "", True
    )


def _endpoint(guest: Guest) -> Iterator[Row]:
    """Heartbeats, by a user of this machine."""
    began = time.monotonic()
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    user = context.socket(zmq.SUB)
    user.setsockopt(zmq.SUBSCRIBE, TOPIC)
    user.setsockopt(zmq.RECONNECT_IVL, 500)
    user.connect(f"tcp://127.0.0.1:{guest.ports.to_users}")
    try:
        heard: list[int] = []
        while len(heard) < HEARTBEATS:
            if not user.poll(600_000):
                raise NotSeenError("no heartbeat came from port 5556")
            heard.append(json.loads(user.recv_multipart()[-1])["heartbeat_counter"])
    finally:
        user.close(0)
        context.term()
    numbers = ", ".join(map(str, heard))
    goes_up = all(after - number == 1 for number, after in itertools.pairwise(heard))
    yield Row("heartbeats at port 5556", f"{numbers}, {time.monotonic() - began:.1f} s later", "one by one", goes_up)


def _inside(guest: Guest, key: Key) -> Generator[Row, None, str]:
    """By ssh; returns its machine-id."""
    wait_for_ssh(guest)
    yield Row("ssh by a key of the boot partition", "in", "in", said(guest, key, "id -un") == "operator")
    failed = " ".join(said(guest, key, "systemctl --failed --plain --no-legend | cut -d ' ' -f 1").split())
    yield Row("units that have failed", failed or "none", "none", not failed)
    memory = said(guest, key, "awk '/^MemTotal|^MemAvailable/ {print $2}' /proc/meminfo").split()
    used_mb = (int(memory[0]) - int(memory[1])) / 1024
    yield Row("memory in use", f"{used_mb:.0f} MiB", "256", used_mb < 256)
    status = said(guest, key, "captain status --json")
    yield Row(
        "captain status by ssh", "answers" if status.startswith("{") else status[:60], "answers", status.startswith("{")
    )
    return said(guest, key, "cat /etc/machine-id")


def _without_key(guest: Guest) -> Row:
    ended = ssh(guest, Path("/dev/null"), "true")
    words = ended.stderr.strip().splitlines()[-1:] or ["in"]
    return Row("ssh without the key", words[0].partition(": ")[2][:30], "refused", "Permission denied" in words[0])
