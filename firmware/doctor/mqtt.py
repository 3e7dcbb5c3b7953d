"""Checks of an mqtt interface: its files and access to the broker."""

import os
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path

from board.runtime.errors import StationError
from drivers import DRIVERS
from drivers.contract import Can, Shared
from drivers.message import Ego, Position
from drivers.mqtt.broker import broker
from drivers.mqtt.client.settings import MqttSettings, settings_of
from drivers.mqtt.options import MqttOptions, check_file
from firmware import x509
from firmware.config.captain_toml import InterfaceConfig
from firmware.doctor import mqtt_reach
from firmware.doctor.finding import Finding, Level

NOWHERE = Ego(0, Position(), is_known=False)
TRIES = "the station starts, and tries again and again"
SOON_DAYS = 14  # leaves time to renew a certificate


def is_one(one: InterfaceConfig) -> bool:
    return isinstance(one.options, MqttOptions)


def files(one: InterfaceConfig, shared: Shared, now: float) -> Iterator[Finding]:
    """Check that certificates, key, password and profile exist, are readable and valid, and that secrets are private.

    shared  values that the station gives to its drivers.
    now     Unix time in seconds.
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
    """Read the files as the client process does. Raises StationError for an invalid one."""
    from drivers.mqtt.client import process

    process.profile_of(wanted)
    process.check(wanted)


def closed(one: InterfaceConfig) -> Iterator[Finding]:
    """Report files that exist but that only the service's user may read; their content is not checked."""
    for _, path, _ in one.options.files():
        if os.path.exists(path) and not os.access(path, os.R_OK, effective_ids=True):
            what = f"only the service may read {path}; `captain box check` checks its original on the card"
            yield Finding(Level.OK, f"interface {one.name}", what)


def position(
    one: InterfaceConfig, shared: Shared, interfaces: Sequence[InterfaceConfig], is_placed: bool
) -> Iterator[Finding]:
    """Warn if the interface's profile needs a position and the station will have none.

    interfaces  all interfaces of the station, since a receiver may provide the position.
    is_placed   a position is configured.
    """
    from drivers.mqtt.client import process

    if is_placed or any(_tells_position(other, shared) for other in interfaces):
        return
    try:
        _, lacks = process.profile_of(settings_of(one.options, shared)).lacks(NOWHERE)
    except StationError:
        return  # files() reports this error
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
        remedy = "renew it, or correct this machine's clock"
        yield Finding(Level.PROBLEM, subject, f"{name} {path} has expired: {day}", remedy)
    elif begin > now:
        remedy = "wait for it, or correct this machine's clock"
        yield Finding(Level.PROBLEM, subject, f"{name} {path} is good from {begin:%Y-%m-%d %H:%M} UTC", remedy)
    elif left < SOON_DAYS:
        yield Finding(Level.WARNING, subject, f"{name} {path} expires in {left} days: {day}", "renew it")
    else:
        yield Finding(Level.OK, subject, f"{name} {path} is good until {day}")


def reach(one: InterfaceConfig, shared: Shared) -> Iterator[Finding]:
    """Check access to the broker with one attempt: name, TCP, TLS and the broker's acceptance of this client."""
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
