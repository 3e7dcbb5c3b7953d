"""Boot time, its parts, and captain's share: alternating starts, medians."""

import re
import statistics
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from tests.proof.image.login import Key, new_key, said, wait_for_ssh
from tests.proof.image.machine import Guest, Ports, owned, powered, virt
from tests.proof.image.rows import Options, Row
from tests.proof.image.user import user

PAIRS = 5
MOST = 1.3
# All that runs the program: the station, what asks it whether it is well, the screen.
OURS = ("captain.service", "captain-good.service", "serial-getty@ttyAMA0.service")
WITHOUT = " ".join(f"systemd.mask={name}" for name in OURS)
WIDTH = 50


class Start(NamedTuple):
    """Of one start, in seconds from the kernel's: when each was reached.

    multi_user  systemd's target.
    marks       what happened until the first heartbeat; empty in a start without captain.
    """

    multi_user: float
    marks: dict[str, float]

    @property
    def heartbeat(self) -> float:
        return self.marks["first heartbeat"]


class Station(NamedTuple):
    """As seen from here: when its configuration was loaded, and when the first heartbeat left."""

    loaded: float
    heartbeat: float


def rows(card: Path, folder: Path, options: Options) -> Iterator[Row]:
    key = new_key(folder)
    own = owned(card, folder, {"authorized_keys": key.line})
    with powered(own, folder) as guest:  # the first start of all makes keys: none of those that count
        wait_for_ssh(guest)
        said(guest, key, "systemctl is-system-running --wait", 600.0)
        said(guest, key, "sync")
    pairs = options.count or (1 if options.is_short else PAIRS)
    with_it, without = [], []
    for _ in range(pairs):
        without.append(_start(own, folder, key, WITHOUT))
        with_it.append(_start(own, folder, key, ""))
    middle = sorted(with_it, key=lambda start: start.heartbeat)[len(with_it) // 2]
    print(*_drawn(middle), sep="\n", flush=True)
    yield Row("kernel's start to the first heartbeat", _spread([start.heartbeat for start in with_it]), "", True)
    for name, length in _lengths(middle):
        yield Row(f"of which {name}", f"{length:.1f} s", "", True)
    here, bare = ([start.multi_user for start in starts] for starts in (with_it, without))
    yield Row("to multi-user.target with captain", _spread(here), "", True)
    yield Row("to multi-user.target without", _spread(bare), "", True)
    ratio = statistics.median(here) / statistics.median(bare)
    yield Row(f"ratio of the medians of {pairs} alternating starts", f"{ratio:.2f}", f"{MOST}", ratio <= MOST)


def _start(card: Path, folder: Path, key: Key, extra: str) -> Start:
    """One start of a card that stays as it is. extra: of the kernel's command line."""
    with powered(card, folder, machine=_unchanged) as guest:
        guest.stop_loader(extra)
        guest.wait("Starting kernel")
        began = time.monotonic()
        station = None if extra else _station(guest, began)
        wait_for_ssh(guest)
        said(guest, key, "systemctl is-system-running --wait", 600.0)
        multi_user = _moment(guest, key, "multi-user.target", "ActiveEnter")
        return Start(multi_user, _marks(guest, key, station) if station else {})


def _unchanged(card: Path, ports: Ports) -> list[str]:
    return [word.replace("if=virtio", "if=virtio,snapshot=on") for word in virt(card, ports)]


def _station(guest: Guest, began: float) -> Station:
    """Heartbeats are a second apart, from 0: the first left before the network was there."""
    with user(guest.ports) as one:
        number = one.heartbeat()
        heartbeat = time.monotonic() - began - number
        up_s = float(one.status()["uptime_s"])
        return Station(time.monotonic() - began - up_s, heartbeat)


def _moment(guest: Guest, key: Key, unit: str, what: str) -> float:
    return float(said(guest, key, f"systemctl show -P {what}TimestampMonotonic {unit}") or 0) / 1e6


def _marks(guest: Guest, key: Key, station: Station) -> dict[str, float]:
    # When the kernel said it: the journal's own stamp is that of its reading.
    first = re.search(
        r'_SOURCE_MONOTONIC_TIMESTAMP" *: *"(\d+)"',
        said(guest, key, "journalctl -k -o json --no-pager | grep 'Run /init'"),
    )
    userspace = float(said(guest, key, "systemctl show -P UserspaceTimestampMonotonic")) / 1e6
    return {
        "kernel": int(first.group(1)) / 1e6 if first else userspace,
        "early boot: root, check and mount of the data": userspace,
        "systemd, until it starts captain": _moment(guest, key, "captain.service", "InactiveExit"),
        "captain: interpreter, imports, configuration": station.loaded,
        "captain: interfaces, endpoint, ready": _moment(guest, key, "captain.service", "ActiveEnter"),
        "first heartbeat": station.heartbeat,
    }


def _lengths(start: Start) -> Iterator[tuple[str, float]]:
    before = 0.0
    for name, at in start.marks.items():
        yield name, max(0.0, at - before)
        before = max(before, at)


def _drawn(start: Start) -> Iterator[str]:
    """Bars on one axis, from the kernel's start to the first heartbeat."""
    scale = WIDTH / max(start.marks.values())
    before = 0.0
    for name, at in start.marks.items():
        left, right = round(before * scale), round(max(before, at) * scale)
        yield f"        {name:46} {' ' * left}{'#' * max(1, right - left):{WIDTH - left}} {at:6.1f} s"
        before = max(before, at)


def _spread(values: Sequence[float]) -> str:
    return f"{statistics.median(values):.1f} s ({min(values):.1f} to {max(values):.1f})"
