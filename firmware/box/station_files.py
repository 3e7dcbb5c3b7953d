"""Certificates, keys, profiles, PINs and libraries of a set, as the interfaces that name them will read them."""

import os
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from board.errors import ConfigurationError, StationError
from drivers import mqtt_profile, shared_library
from drivers.modem_options import ModemOptions
from drivers.modem_pin import read_pin
from drivers.mqtt_options import MqttOptions
from drivers.som301e import Som301eOptions
from firmware import config, x509
from firmware.box.card import FOLDER, LIBRARIES, is_kept
from firmware.box.note import Note, mistake, remark
from firmware.box.station_given import OWN, StationFiles

AUTHORITIES = "/etc/ssl/certs/ca-certificates.crt"  # of the image, which has no other file there

Trouble = tuple[str, str, str]  # option, what is wrong with it, remedy


def look_at_files(found: config.Config, given: StationFiles, notes: list[Note]) -> None:
    """Certificates and keys as the client of a broker will load them; what no interface names is told."""
    there = [name for name in given.files if is_kept(name)]
    sound = {one.name for one in found.interfaces}
    others = [table for name, table in found.tables.interfaces.items() if name not in sound]
    used = {os.path.normpath(text) for table in others for text in table.values() if isinstance(text, str)}
    for one in found.interfaces:
        place = f"interfaces.{one.name}"
        files = _files(one.options)
        used |= {os.path.normpath(path) for _, path in files}
        used |= {_library(one.options)} if isinstance(one.options, Som301eOptions) else set()
        troubles = list(_missing(files, there)) or list(_of_files(one.options))
        for option, what, remedy in troubles:
            notes.append(mistake(given.at(OWN, f"{place}.{option}"), f"{place}.{what}", remedy))
        if isinstance(one.options, MqttOptions) and not troubles:
            for option, what, remedy in _out_of_time(one.options, given):
                notes.append(remark(given.at(OWN, f"{place}.{option}"), f"{place}.{what}", remedy))
    notes += [
        remark(name, f"is named by no interface of {OWN}", f'for example: {_option(name)} = "{name}"')
        for name in there
        if name not in used
    ]


def _library(options: Som301eOptions) -> str:
    """The path of the module's library on a box, whose image has none."""
    return options.library if "/" in options.library else f"{LIBRARIES}/{options.library}"


def _option(name: str) -> str:
    return "library" if name.startswith(f"{LIBRARIES}/") else "ca"


def _files(options: object) -> list[tuple[str, str]]:
    """Those that options name: the option and the path."""
    match options:
        case MqttOptions():
            return [(option, path) for option, path, _ in options.files()]
        case ModemOptions() if options.pin_file:
            return [("pin_file", options.pin_file)]
        case Som301eOptions() if "/" in options.library:
            return [("library", options.library)]
    return []


def _missing(files: list[tuple[str, str]], there: list[str]) -> Iterator[Trouble]:
    for option, path in files:
        remedy = f"put it into {LIBRARIES if option == 'library' else FOLDER}/, beside {OWN}"
        whole = os.path.normpath(path)
        if whole == AUTHORITIES:
            continue
        if whole.startswith(("/", "..")):
            yield option, f"{option}: {path} is not on the card", remedy
        elif not os.path.exists(path):
            known = (path.lower(), f"{path.lower()}.txt")  # Windows shows no such end
            near = next((name for name in there if name.lower() in known), "")
            yield option, f"{option}: there is no {path}", f"on the card it is written {near}" if near else remedy


def _of_files(options: object) -> Iterator[Trouble]:
    """What is in them, by the code that will read them."""
    from drivers import mqtt_credentials
    from drivers.mqtt_broker import broker

    try:
        if isinstance(options, MqttOptions):
            if broker(options.url).has_tls:
                mqtt_credentials.context(_readable(options))
            if options.password_file:
                mqtt_credentials.password(options)
            if mqtt_profile.is_file(options.profile):
                mqtt_profile.load(options.profile)
        elif isinstance(options, ModemOptions) and options.pin_file:
            read_pin(options.pin_file)
        elif isinstance(options, Som301eOptions) and os.path.exists(path := _library(options)):
            shared_library.check(path, shared_library.AARCH64)
    except ConfigurationError as error:
        for line in error.message.split("\n"):
            yield "profile", f"profile: {line}", error.hint
    except StationError as error:
        if isinstance(options, Som301eOptions):
            yield "library", f"library: {error.message}", error.hint
        else:
            yield error.message.partition(" ")[0], error.message, error.hint


def _readable(options: MqttOptions) -> MqttOptions:
    """The same without authorities that only a box has."""
    is_elsewhere = os.path.normpath(options.ca) == AUTHORITIES and not os.path.exists(AUTHORITIES)
    return replace(options, ca="") if is_elsewhere else options


def _out_of_time(options: MqttOptions, given: StationFiles) -> Iterator[Trouble]:
    """What a broker, or this client, will not accept: no mistake, for it may be renewed, and clocks be wrong.

    A box has no clock before its first start, but never one that is ahead: there "not yet" means nothing.
    """
    now = datetime.fromtimestamp(given.now, UTC)
    for option in ("certificate", "ca"):
        path = getattr(options, option)
        try:
            found = x509.validities(Path(path).read_text(errors="replace")) if path else []
        except (StationError, OSError):
            continue  # OpenSSL has taken it
        if not found:
            continue
        begin, end = x509.period(found, is_any=option == "ca")
        if end <= now:
            yield (
                option,
                f"{option}: {path} has expired: {end:%Y-%m-%d %H:%M} UTC",
                "renew it: no connection comes about",
            )
        elif begin > now and given.defaults is None:
            yield (
                option,
                f"{option}: {path} is good from {begin:%Y-%m-%d %H:%M} UTC",
                "no connection comes about before",
            )
