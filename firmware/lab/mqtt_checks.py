"""What an interface at a broker needs of this machine: its files, and the way to the broker."""

import os
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path

from board.errors import StationError
from drivers import DRIVERS
from drivers.contract import Can, Shared
from drivers.message import Ego, Position
from drivers.mqtt_broker import broker
from drivers.mqtt_options import MqttOptions, check_file
from drivers.mqtt_settings import MqttSettings, settings_of
from firmware import x509
from firmware.config import InterfaceConfig
from firmware.lab import mqtt_reach
from firmware.lab.checks import Finding, Level

NOWHERE = Ego(0, Position(), is_known=False)
TRIES = "the station starts, and tries again and again"
SOON_DAYS = 14  # time enough to have a certificate renewed


def is_one(one: InterfaceConfig) -> bool:
    return isinstance(one.options, MqttOptions)


def files(one: InterfaceConfig, shared: Shared, now: float) -> Iterator[Finding]:
    """Certificates, key, password, profile: there, readable, by nobody else where that matters, and in force.

    shared  as the station will give it to the driver.
    now     Unix time.
    """
    options: MqttOptions = one.options
    subject = f"interface {one.name}"
    is_whole = True
    for name, path, is_secret in options.files():
        try:
            check_file(name, path, is_secret)
        except StationError as error:
            is_whole = False
            yield Finding(Level.PROBLEM, subject, error.message, error.hint)
    if not is_whole:
        return
    try:
        _read(settings_of(options, shared))
    except StationError as error:
        yield Finding(Level.PROBLEM, subject, error.message, error.hint)
        return
    for name in ("certificate", "ca"):
        if path := getattr(options, name):
            yield from _in_force(subject, name, Path(path), datetime.fromtimestamp(now, UTC))


def _read(wanted: MqttSettings) -> None:
    """As the process with the client will read them. Raises StationError."""
    from drivers import mqtt_client

    mqtt_client.profile_of(wanted)
    mqtt_client.check(wanted)


def closed(one: InterfaceConfig) -> Iterator[Finding]:
    """Files that are there, and that this user may not read: they are the service's, and are not looked at."""
    for _, path, _ in one.options.files():
        if os.path.exists(path) and not os.access(path, os.R_OK, effective_ids=True):
            what = f"{path} is the service's alone; `captain box check` looks at it where it comes from"
            yield Finding(Level.OK, f"interface {one.name}", what)


def position(
    one: InterfaceConfig, shared: Shared, interfaces: Sequence[InterfaceConfig], is_placed: bool
) -> Iterator[Finding]:
    """Whether the station will know where it is, for a profile that wants that.

    interfaces  all of the station: a receiver may be among them.
    is_placed   a position is configured.
    """
    from drivers import mqtt_client

    if is_placed or any(_tells_position(other, shared) for other in interfaces):
        return
    try:
        _, lacks = mqtt_client.profile_of(settings_of(one.options, shared)).lacks(NOWHERE)
    except StationError:
        return  # which files() tells
    if lacks:
        remedy = "add a receiver, or a surveyed place as station.position; or tiles.fallback to the profile"
        yield Finding(Level.WARNING, f"interface {one.name}", f"profile {one.options.profile}: {lacks}", remedy)


def _tells_position(one: InterfaceConfig, shared: Shared) -> bool:
    return Can.POSITION in DRIVERS[one.queue.driver](one.options, shared).capabilities.can


def _in_force(subject: str, name: str, path: Path, now: datetime) -> Iterator[Finding]:
    try:
        found = x509.validities(path.read_text(errors="replace"))
    except (StationError, OSError) as error:
        yield Finding(Level.WARNING, subject, f"{name} {path}: {error}", "`openssl x509 -text` may read it")
        return
    if not found:
        return
    begin, end = x509.period(found, is_any=name == "ca")
    day, left = f"{end:%Y-%m-%d %H:%M} UTC", (end - now).days
    if end <= now:
        remedy = "renew it; or is this machine's clock wrong?"
        yield Finding(Level.PROBLEM, subject, f"{name} {path} has expired: {day}", remedy)
    elif begin > now:
        remedy = "wait for it; or is this machine's clock wrong?"
        yield Finding(Level.PROBLEM, subject, f"{name} {path} is good from {begin:%Y-%m-%d %H:%M} UTC", remedy)
    elif left < SOON_DAYS:
        yield Finding(Level.WARNING, subject, f"{name} {path} expires in {left} days: {day}", "renew it")
    else:
        yield Finding(Level.OK, subject, f"{name} {path} is good until {day}")


def reach(one: InterfaceConfig, shared: Shared) -> Iterator[Finding]:
    """Whether its name is known, TCP and TLS come about, and the broker accepts this client: one try."""
    wanted = settings_of(one.options, shared)
    where, subject = broker(wanted.url), f"interface {one.name}"
    if failed := mqtt_reach.failure(wanted):
        what, _, remedy = failed.why.partition("; ")
        if failed.may_pass:
            yield Finding(Level.WARNING, subject, f"mqtt: {where}: {failed.why}", TRIES)
        else:
            yield Finding(Level.PROBLEM, subject, f"mqtt: {where}: {what}", remedy or "the broker's log may say why")
    else:
        how = "by TLS" if where.has_tls else "without TLS"
        yield Finding(Level.OK, subject, f"mqtt: {where}: accepts this client, {how}")
