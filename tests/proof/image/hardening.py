"""Hardening of our units, by systemd's measure, with reasons for exceptions."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from tests.proof.image.login import new_key, said, wait_for_ssh
from tests.proof.image.machine import owned, powered
from tests.proof.image.rows import Options, Row

UNITS = "systemctl list-unit-files --plain --no-legend 'captain*.service' | cut -d ' ' -f 1"
CONSOLE = "serial-getty@ttyAMA0.service"


class Most(NamedTuple):
    """The most that may be open of a unit, and why no less is asked for."""

    exposure: float
    reason: str


MOST = {
    # It meets the world.
    "captain.service": Most(2.7, "each test below has its reason"),
    # Nobody sends them anything: they are root's for moments, and as closed as their work lets them be.
    "captain-host-key.service": Most(0.7, "root's, for one folder"),
    "captain-keep-clock.service": Most(0.7, "root's, for one folder"),
    "captain-owner.service": Most(5.9, "root's: it writes over /etc, /run and the box's name"),
    "captain-good.service": Most(6.0, "the station's check, then root's judgement: counters, a restart"),
    "captain-unproven.service": Most(6.3, "root's: counters, a restart"),
    "captain-grow.service": Most(6.4, "root's: it makes a mounted file system larger"),
    "captain-restart.service": Most(6.4, "root's: a restart"),
    CONSOLE: Most(9.2, "a person's shell, of a user with no right of root's"),
}

# Why a test of systemd-analyze is left open, by unit; "" holds for all. The names are its own.
ANYWHERE = {
    "RootDirectoryOrRootImage": "the root is read-only, and most of it hidden: a second one would be a copy",
}
REASONS: Mapping[str, Mapping[str, str]] = {
    "captain.service": {
        "PrivateNetwork": "it is a router of messages between networks",
        "RestrictAddressFamilies_AF_INET_INET6": "the endpoint, brokers, udp interfaces",
        "RestrictAddressFamilies_AF_UNIX": "its control socket, systemd, chrony, its own workers",
        "RestrictAddressFamilies_AF_NETLINK": "links that come and go, and devices at USB",
        "RestrictAddressFamilies_AF_PACKET": "ITS-G5 is frames, EtherType 0x8947",
        "IPAddressDeny": "users, brokers and neighbours have any address",
        "CapabilityBoundingSet_CAP_NET_BIND_SERVICE_BROADCAST_RAW)": "CAP_NET_RAW: the same frames",
        "CapabilityBoundingSet_CAP_NET_ADMIN": "address and route of the 5G module; the queue of a radio",
        "AmbientCapabilities": "those two, for a user who is not root",
        "PrivateUsers": "they would be of another world's network",
        "PrivateDevices": "the modules are devices",
        "DeviceAllow": "GPIO, pulses, I2C, serial ports, USB; nothing else",
        "SupplementaryGroups": "the groups of those devices",
        "ProtectClock": "it reads the state of the kernel's clock, which this refuses as well",
        "SystemCallFilter_clock": "the same: adjtimex, which changes nothing without CAP_SYS_TIME",
        "SystemCallFilter_privileged": "the same: adjtimex is of both sets; the others of this one are refused",
        "SystemCallFilter_resources": "libzmq asks for its threads' scheduling; the broker's process is nicer",
        "ProcSubset": "routes and interface counters are in /proc/net",
        "UMask": "operator reads recordings, by the group",
    },
}


class Open(NamedTuple):
    """A test that a unit does not pass."""

    name: str
    description: str
    exposure: float


def rows(card: Path, folder: Path, _options: Options) -> Iterator[Row]:
    key = new_key(folder)
    own = owned(card, folder, {"authorized_keys": key.line})
    with powered(own, folder) as guest:
        wait_for_ssh(guest)
        said(guest, key, "systemctl is-system-running --wait", 600.0)
        failed = said(guest, key, "systemctl --failed --plain --no-legend | cut -d ' ' -f 1")
        yield Row("units that have failed", failed or "none", "none", not failed)
        names = [*said(guest, key, UNITS).split(), CONSOLE]
        for name in names:
            found = json.loads(said(guest, key, f"systemd-analyze security --json=short {name}"))
            score = float(
                said(guest, key, f"systemd-analyze security --no-pager {name} | tail -n 1").split(":")[1].split()[0]
            )
            yield from _of_unit(name, score, [_read(one) for one in found if one["set"] is False])


def _read(one: Mapping[str, object]) -> Open:
    return Open(str(one["json_field"]), str(one["description"]), float(str(one["exposure"])))


def _of_unit(name: str, score: float, left: list[Open]) -> Iterator[Row]:
    reasons = {**ANYWHERE, **REASONS.get(name, {})}
    most = MOST.get(name)
    goal = f"{most.exposure}: {most.reason}" if most else "a bound, and its reason"
    yield Row(f"exposure of {name}", f"{score}", goal, most is not None and score <= most.exposure)
    for one in sorted(left, key=lambda one: -one.exposure):
        if one.exposure and name in REASONS:
            reason = reasons.get(one.name, "")
            yield Row(f"{one.name}", f"{one.exposure}", reason or "a reason", bool(reason))
