"""Checks certificates, keys, profiles, PINs and libraries named by interfaces."""

import os
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from board.runtime.errors import ConfigurationError, StationError
from drivers.mqtt import profile
from drivers.mqtt.options import MqttOptions
from drivers.sim8202g.options import ModemOptions
from drivers.sim8202g.pin import read_pin
from drivers.som301e import shared_library
from drivers.som301e.options import Som301eOptions
from firmware import x509
from firmware.card.card import FOLDER, LIBRARIES, is_kept
from firmware.card.note import Note, mistake, remark
from firmware.card.station.given import OWN, StationFiles
from firmware.config import captain_toml

AUTHORITIES = "/etc/ssl/certs/ca-certificates.crt"  # file of the image; it has no other certificates

Trouble = tuple[str, str, str]  # option, its fault, remedy


def look_at_files(found: captain_toml.Config, given: StationFiles, notes: list[Note]) -> None:
    """Check files that interfaces name, by the code that will load them; report files that no interface uses."""
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
        remark(name, f"is not used by an interface of {OWN}", f'for example: {_option(name)} = "{name}"')
        for name in there
        if name not in used
    ]


def _library(options: Som301eOptions) -> str:
    """Return the path of the module's library on a box; the image does not contain it."""
    return options.library if "/" in options.library else f"{LIBRARIES}/{options.library}"


def _option(name: str) -> str:
    return "library" if name.startswith(f"{LIBRARIES}/") else "ca"


def _files(options: object) -> list[tuple[str, str]]:
    """Return option and path of each file that options name."""
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
            known = (path.lower(), f"{path.lower()}.txt")  # Windows hides the ending .txt
            near = next((name for name in there if name.lower() in known), "")
            yield option, f"{option}: not found: {path}", f"the card has {near}" if near else remedy


def _of_files(options: object) -> Iterator[Trouble]:
    """Yield the faults in the content of files, found by the code that will read them."""
    from drivers.mqtt.broker import broker
    from drivers.mqtt.client import credentials

    try:
        if isinstance(options, MqttOptions):
            if broker(options.url).has_tls:
                credentials.context(_readable(options))
            if options.password_file:
                credentials.password(options)
            if profile.is_file(options.profile):
                profile.load(options.profile)
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
    """Return the options without the authorities of the image if this machine does not have them."""
    is_elsewhere = os.path.normpath(options.ca) == AUTHORITIES and not os.path.exists(AUTHORITIES)
    return replace(options, ca="") if is_elsewhere else options


def _out_of_time(options: MqttOptions, given: StationFiles) -> Iterator[Trouble]:
    """Yield expired and not yet valid certificates. They are remarks: a certificate may be renewed, or a clock wrong.

    The clock of a box may be slow before its first start, but never fast, so "not yet valid" is ignored there.
    """
    now = datetime.fromtimestamp(given.now, UTC)
    for option in ("certificate", "ca"):
        path = getattr(options, option)
        try:
            found = x509.validities(Path(path).read_text(errors="replace")) if path else []
        except (StationError, OSError):
            continue  # OpenSSL has accepted it
        if not found:
            continue
        begin, end = x509.period(found, is_any=option == "ca")
        if end <= now:
            yield (
                option,
                f"{option}: {path} has expired: {end:%Y-%m-%d %H:%M} UTC",
                "renew it: connections will fail",
            )
        elif begin > now and given.defaults is None:
            yield (
                option,
                f"{option}: {path} is valid from {begin:%Y-%m-%d %H:%M} UTC",
                "connections will fail before",
            )
