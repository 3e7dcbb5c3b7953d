"""What an interface at a broker needs of this machine: its files, and the way to the broker."""

import select
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from board.errors import StationError
from drivers import mqtt_credentials, mqtt_profile
from drivers.contract import Shared
from drivers.mqtt import settings
from drivers.mqtt_connector import Connector
from drivers.mqtt_options import MqttOptions, check_file
from drivers.mqtt_settings import MqttSettings, broker
from firmware.config import InterfaceConfig
from firmware.lab import x509
from firmware.lab.checks import Finding, Level

SOON_DAYS = 14  # time enough to have a certificate renewed
REACH_S = 5.0


def is_one(one: InterfaceConfig) -> bool:
    return isinstance(one.options, MqttOptions)


def files(one: InterfaceConfig, mac: bytes, now: float) -> Iterator[Finding]:
    """Certificates, key, password, profile: there, readable, by nobody else where that matters, and in force.

    now  Unix time.
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
        _read(settings(options, Shared(mac)))
    except StationError as error:
        yield Finding(Level.PROBLEM, subject, error.message, error.hint)
        return
    for name in ("certificate", "ca"):
        if path := getattr(options, name):
            yield from _in_force(subject, name, Path(path), datetime.fromtimestamp(now, UTC))


def _read(wanted: MqttSettings) -> None:
    """As the process with the client will read them. Raises StationError."""
    mqtt_profile.load(wanted.profile)
    if broker(wanted.url).has_tls:
        mqtt_credentials.context(wanted)
    if wanted.password_file:
        mqtt_credentials.password(wanted)


def _in_force(subject: str, name: str, path: Path, now: datetime) -> Iterator[Finding]:
    """Of a certificate and what has signed it the first end counts, of several authorities the last."""
    try:
        ends = x509.ends(path.read_text(errors="replace"))
    except (StationError, OSError) as error:
        yield Finding(Level.WARNING, subject, f"{name} {path}: {error}", "`openssl x509 -text` may read it")
        return
    if not ends:
        return
    end = max(ends) if name == "ca" else min(ends)
    day, left = f"{end:%Y-%m-%d %H:%M} UTC", (end - now).days
    if end <= now:
        remedy = "renew it; or is this machine's clock wrong?"
        yield Finding(Level.PROBLEM, subject, f"{name} {path} has expired: {day}", remedy)
    elif left < SOON_DAYS:
        yield Finding(Level.WARNING, subject, f"{name} {path} expires in {left} days: {day}", "renew it")
    else:
        yield Finding(Level.OK, subject, f"{name} {path} is good until {day}")


def reach(one: InterfaceConfig, mac: bytes) -> Iterator[Finding]:
    """Whether its name is known, and TCP and TLS come about: one try, and nothing is said to the broker."""
    wanted = replace(settings(one.options, Shared(mac)), connect_s=REACH_S)
    where, subject = broker(wanted.url), f"interface {one.name}"
    connector = Connector(wanted)
    try:
        # A look-up has no limit of its own.
        select.select([connector], [], [], REACH_S + 1.0)
        why_not = connector.why_not or ("" if connector.socket else f"{connector.waits_for} within {REACH_S:g} s")
        if connector.socket is not None:
            connector.socket.close()
    finally:
        connector.close()
    if why_not:
        yield Finding(
            Level.WARNING, subject, f"mqtt: {where}: {why_not}", "the station starts, and tries again and again"
        )
    else:
        how = "TLS stands" if where.has_tls else "it answers, without TLS"
        yield Finding(Level.OK, subject, f"mqtt: {where}: {how}")
