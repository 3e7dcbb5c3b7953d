"""python -m tests.image: starts the very card in QEMU, twice, with a power cut between, and looks at it from outside."""

import argparse
import itertools
import json
import socket
import sys
import tempfile
import time
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import NamedTuple

import zmq

from tests.image.machine import Guest, NotSeenError, key_pair, owned, powered, ssh

PROJECT = Path(__file__).resolve().parents[2]
RESULTS = PROJECT / "build/image/results.json"
HEARTBEATS = 3
TOPIC = b"hb."


class Row(NamedTuple):
    """What was seen beside what is wanted. goal: in words, or the most that seen may be."""

    what: str
    seen: str
    goal: str
    is_ok: bool

    def __str__(self) -> str:
        return f"{'ok' if self.is_ok else 'FAILED':6}  {self.what:46} {self.seen:30} {self.goal}"


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.image", description=__doc__)
    newest = sorted((PROJECT / "build").glob("captain-*-arm64.img"), key=lambda path: path.stat().st_mtime)
    parser.add_argument("--card", type=Path, default=newest[-1] if newest else None, help="default: the last one built")
    arguments = parser.parse_args()
    if arguments.card is None:
        print("there is no card: make image builds one", file=sys.stderr)
        return 2
    rows: list[Row] = []
    with tempfile.TemporaryDirectory(prefix="captain-card-") as name:
        folder = Path(name)
        try:
            for row in _checks(arguments.card, folder):
                print(row, flush=True)
                rows.append(row)
        except NotSeenError as error:
            print(f"FAILED  {error}", file=sys.stderr)
            return 1
    RESULTS.write_text(json.dumps([row._asdict() for row in rows], indent=1))
    failed = [row for row in rows if not row.is_ok]
    print(f"{len(rows) - len(failed)} of {len(rows)} are ok; rows: {RESULTS}")
    return 1 if failed else 0


def _checks(image: Path, folder: Path) -> Iterator[Row]:
    key, line = key_pair(folder)
    card = owned(image, folder, {"authorized_keys": line})
    with powered(card, folder) as guest:
        yield from _start(guest)
        yield from _console(guest)
        yield from _endpoint(guest)
        first = yield from _inside(guest, key)
        yield _without_key(guest)
    with powered(card, folder) as guest:  # its power was cut
        guest.wait("slots: trying A, 2 tries left")
        yield Row("tries of slot A after a healthy start", "3, and one is taken again", "put back to 3", True)
        _wait_for_ssh(guest)
        said = _said(guest, key, "cat /etc/machine-id")
        is_same = said.strip() == first
        yield Row("machine-id after a power cut", "the same" if is_same else said[:30], "the same", is_same)
        boots = _said(guest, key, "journalctl --list-boots -q | wc -l").strip()
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


def _inside(guest: Guest, key: Path) -> Generator[Row, None, str]:
    """By ssh; returns its machine-id."""
    _wait_for_ssh(guest)
    yield Row("ssh by a key of the boot partition", "in", "in", _said(guest, key, "id -un").strip() == "operator")
    failed = " ".join(_said(guest, key, "systemctl --failed --plain --no-legend | cut -d ' ' -f 1").split())
    yield Row("units that have failed", failed or "none", "none", not failed)
    time_ = _said(guest, key, "systemd-analyze time").splitlines()
    yield Row("systemd-analyze", time_[0].removeprefix("Startup finished in ") if time_ else "", "", True)
    security = _said(guest, key, "systemd-analyze security captain.service --no-pager | tail -n 1").strip()
    score = float(security.split(":")[-1].split()[0]) if ":" in security else 10.0
    yield Row("systemd-analyze security captain", f"{score}", "2.5", score <= 2.5)
    memory = _said(guest, key, "awk '/^MemTotal|^MemAvailable/ {print $2}' /proc/meminfo").split()
    used_mb = (int(memory[0]) - int(memory[1])) / 1024
    yield Row("memory in use", f"{used_mb:.0f} MiB", "256", used_mb < 256)
    status = _said(guest, key, "captain status --json")
    yield Row(
        "captain status by ssh", "answers" if status.startswith("{") else status[:60], "answers", status.startswith("{")
    )
    return _said(guest, key, "cat /etc/machine-id").strip()


def _without_key(guest: Guest) -> Row:
    ended = ssh(guest, Path("/dev/null"), "true")
    said = ended.stderr.strip().splitlines()[-1:] or ["in"]
    return Row("ssh without the key", said[0].partition(": ")[2][:30], "refused", "Permission denied" in said[0])


def _wait_for_ssh(guest: Guest) -> None:
    """Its first words. QEMU takes connections before the guest does, and closes them."""
    ends = time.monotonic() + 600
    while time.monotonic() < ends:
        with socket.create_connection(("127.0.0.1", guest.ports.ssh), 30) as made:
            made.settimeout(30)
            try:
                if made.recv(4) == b"SSH-":
                    return
            except OSError:
                continue  # it was closed again
        time.sleep(0.5)
    raise NotSeenError("nobody answers at port 22")


def _said(guest: Guest, key: Path, command: str) -> str:
    return ssh(guest, key, command).stdout


if __name__ == "__main__":
    sys.exit(main())
