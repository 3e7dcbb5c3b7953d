"""The card starts: kernel, systemd, the screen, the endpoint, ssh; and once more after a power cut in an earlier year."""

import itertools
import json
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

from tests.proof.image.login import Key, host_key, new_key, said, ssh, wait_for_ssh
from tests.proof.image.machine import LIMIT_S, Guest, owned, powered
from tests.proof.image.rows import Options, Row
from tests.proof.image.screen import ALLOWED, COLUMNS, HEAD, PROMPT, Screen
from tests.proof.image.user import CAM, User, user
from tests.proof.image.wire import ONE_DRIVER, Wire

HEARTBEATS = 3
MEMORY_MB = 256
JOURNAL_MB = 48
# Of the emulated clock with a battery, which a Pi lacks: the second start is long before the first.
FIRST, SECOND = "2031-05-05T05:05:05", "1970-01-01T00:00:00"
FRAMES = Path(__file__).parents[2] / "captures/frames.json"
CLOCK_IS_KEPT = '[ "$(systemctl show -P ExecMainExitTimestampMonotonic captain-keep-clock.service)" != 0 ]'
# Of programs: a busy machine may well make the kernel wait. But for connections of wait_for_ssh, which say nothing, and what
# ONE_DRIVER leads to.
ERRORS = "journalctl -b -p err -q --no-pager | grep -Ev ' kernel: |error: kex_exchange_identification|cdc_subset is bl'"
GEONETWORKING = b"\x89\x47"
# The radio module's network is one that a frame of a neighbour can come by; the rest is as it comes from the build.
CONFIGURATION = """\
[station]
name = "proof"
position = { latitude = 48.7668616, longitude = 11.432068 }

[endpoint]
address = "0.0.0.0"

[interfaces.air]
driver = "ethernet"
device = "usb0"
"""


class Kept(NamedTuple):
    """What a start leaves to the next."""

    machine_id: str
    host_key: str
    clock_s: int


def rows(card: Path, folder: Path, options: Options) -> Iterator[Row]:
    key = new_key(folder)
    own = owned(card, folder, {"authorized_keys": key.line, "captain.toml": CONFIGURATION})
    with ExitStack() as opened:
        wire = Wire(folder, "air", 9, "usb-net")
        opened.callback(wire.close)
        words = ["-rtc", f"base={FIRST}", "-device", "qemu-xhci", *wire.words]
        guest = opened.enter_context(powered(own, folder, words))
        wire.start()
        guest.stop_loader(ONE_DRIVER)
        yield from _console(guest)
        with user(guest.ports) as one:
            yield from _heartbeats(one, guest)
            yield from _exchange(one, wire)
        yield from _inside(guest, key)
        yield _without_key(guest, folder)
        if options.is_short:
            return
        kept = _kept(guest, key)
    with powered(own, folder, ["-rtc", f"base={SECOND}"]) as guest:  # its power was cut
        yield from _again(guest, key, kept)


def _console(guest: Guest) -> Iterator[Row]:
    left = guest.wait(r"slots: trying A, (\d) tries left").group(1)
    guest.wait("Starting kernel")
    started = time.monotonic()
    yield Row(
        "U-Boot's script starts slot A", f"{started - guest.began:.1f} s after power", "a try is taken", left == "2"
    )
    screen = Screen(guest)
    screen.wait("captain ")
    yield Row("the serial console shows a screen", f"{time.monotonic() - started:.1f} s after the kernel", "", True)
    screen.wait(HEAD)
    yield Row("the station is on it", f"{time.monotonic() - started:.1f} s after the kernel", "", True)
    screen.wait(r"(?s)without\s+authentication.*keys: s shell")
    screen.settle()  # a code may have come in part
    is_plain, width = ALLOWED.fullmatch(screen.sent) is not None, max(map(len, screen.text.splitlines()))
    yield Row("what it sends", f"{'ASCII, VT100' if is_plain else 'more'}, {width} columns",
              f"ASCII, VT100, under {COLUMNS} columns", is_plain and width < COLUMNS)  # fmt: skip
    screen.type("s")
    screen.wait(PROMPT)
    yield Row("the key s opens a shell", screen.run("id -un", "(?m)^operator$").group(), "operator", True)
    yield _jobs(screen)
    found = screen.run("captain status | head -n 20", r"(?m)^.*\bup \d+.*$")
    yield Row("captain status, typed there", found.group().strip()[:40], "answers", True)
    screen.forget()
    screen.type("exit\r")
    screen.wait(HEAD)
    yield Row("its end", "the screen is back", "the screen is back", True)


def _jobs(screen: Screen) -> Row:
    """A shell whose terminal it does not control would say so, and stop nothing."""
    screen.forget()
    screen.type("sh -c 'echo be''gun; exec sleep 1000'\r")
    screen.wait("(?m)^begun")  # it is in front
    screen.type("\x1a")
    screen.wait(r"Stopped +sh")
    screen.run("bg", r"exec sleep 1000' &")
    screen.run("jobs", r"Running +sh")
    screen.run("kill %1; wait; echo ov''er", "(?m)^over")
    screen.run("jobs; echo none", "(?m)^none")
    is_ended = "sleep" not in screen.text
    return Row("job control", "stopped, resumed, ended" if is_ended else "left", "stopped, resumed, ended", is_ended)


def _heartbeats(one: User, guest: Guest) -> Iterator[Row]:
    heard = [one.heartbeat() for _ in range(HEARTBEATS)]
    goes_up = all(after - number == 1 for number, after in itertools.pairwise(heard))
    after_s = time.monotonic() - guest.began
    yield Row(f"heartbeats at 5556, {after_s:.0f} s after power", ", ".join(map(str, heard)), "one by one", goes_up)


def _exchange(one: User, wire: Wire) -> Iterator[Row]:
    """A neighbour's frame, as Vanetza's socktap put it on the air, and a CAM of this user."""
    frames = {frame["name"]: bytes.fromhex(frame["hex"]) for frame in json.loads(FRAMES.read_text())["frames"]}
    frame = frames["cam-shb"]
    one.wait_up("air")
    wire.send(frame)
    body = one.hear(b"v2x.cam.", LIMIT_S)
    is_same = frame.endswith(body)
    yield Row(
        "a neighbour's CAM at 5556", f"{len(body)} octets, {'its own' if is_same else 'others'}", "its own", is_same
    )
    one.sent.send_multipart([b"v2x.", CAM])
    seen = wire.wait(lambda octets: octets[12:14] == GEONETWORKING and octets.endswith(CAM), LIMIT_S, "the user's CAM")
    yield Row(
        "a user's CAM of 5555 on the air", f"a frame of {len(seen)} octets", "GeoNetworking, BTP-B, the CAM", True
    )


def _inside(guest: Guest, key: Key) -> Iterator[Row]:
    wait_for_ssh(guest)
    yield Row("ssh by a key of the boot partition", "in", "in", said(guest, key, "id -un") == "operator")
    state = said(guest, key, "systemctl is-system-running --wait", 600.0)
    failed = " ".join(said(guest, key, "systemctl --failed --plain --no-legend | cut -d ' ' -f 1").split())
    yield Row("systemd, and units that have failed", f"{state}, {failed or 'none'}", "running, none",
              state == "running" and not failed)  # fmt: skip
    errors = said(guest, key, ERRORS).splitlines()
    yield Row("errors in the journal", errors[-1][-60:] if errors else "none", "none", not errors)
    found = said(guest, key, "awk '/^MemTotal|^MemAvailable/ {print $2}' /proc/meminfo").split()
    used_mb = (int(found[0]) - int(found[1])) / 1024
    yield Row("memory in use after the start", f"{used_mb:.0f} MiB", f"{MEMORY_MB}", used_mb < MEMORY_MB)
    used = said(guest, key, "journalctl --disk-usage").split(" take up ")[-1].split()[0]
    limit = said(guest, key, "journalctl -u systemd-journald -o cat | grep -o 'max [0-9.]*[MG]' | tail -n 1")
    yield Row("the journal, and its bound", f"{used}, {limit}", f"max {JOURNAL_MB}M", limit == f"max {JOURNAL_MB}M")
    yield _written(guest, key)
    status = said(guest, key, "captain status --json")
    answers = status.startswith("{")
    yield Row("captain status by ssh", "answers" if answers else status[:40], "answers", answers)


def _written(guest: Guest, key: Key) -> Row:
    """Only the data partition may be written to; /etc and /var are memory."""
    disks = "findmnt -rno TARGET,OPTIONS -t ext4,vfat | awk '$2 ~ /^rw/ {print $1}' | sort -u"
    found = set(said(guest, key, disks).split())
    bound = {"/data", "/var/lib/captain", "/var/lib/chrony", "/var/lib/rauc", "/var/log/journal"}
    return Row(
        "of the card is writable", " ".join(sorted(found)), "the data partition", "/data" in found and found <= bound
    )


def _without_key(guest: Guest, folder: Path) -> Row:
    tries = [("no key", Path("/dev/null")), ("another key", new_key(folder, "another").path)]
    refused = [name for name, path in tries if "Permission denied (publickey)" in ssh(guest, path, "true").stderr]
    return Row(
        "ssh without that key", f"refused: {', '.join(refused)}", "refused: no key, another key", len(refused) == 2
    )


def _kept(guest: Guest, key: Key) -> Kept:
    """What has to be there after a cut; once the time was kept, which the box does a minute after its start."""
    said(guest, key, f"until {CLOCK_IS_KEPT}; do sleep 1; done", 300.0)
    return _now(guest, key)


def _now(guest: Guest, key: Key) -> Kept:
    name, now_s = said(guest, key, "cat /etc/machine-id; date +%s").split()
    return Kept(name, host_key(guest), int(now_s))


def _again(guest: Guest, key: Key, before: Kept) -> Iterator[Row]:
    left = guest.wait(r"slots: trying A, (\d) tries left").group(1)
    yield Row("tries of slot A after a healthy start", f"3, {left} after this one's", "put back to 3", left == "2")
    wait_for_ssh(guest)
    now = _now(guest, key)
    for what, is_same in (
        ("machine-id after a power cut", now.machine_id == before.machine_id),
        ("ssh's host key after it", now.host_key == before.host_key),
    ):
        yield Row(what, "the same" if is_same else "another", "the same", is_same)
    ahead_s = now.clock_s - before.clock_s
    yield Row("the clock, at power-on in 1970", f"{ahead_s} s after the cut", "not before", ahead_s >= 0)
    boots = said(guest, key, "journalctl --list-boots -q | wc -l")
    yield Row("starts in the journal", boots, "2", boots == "2")
    with user(guest.ports) as one:
        yield from _heartbeats(one, guest)
