"""Verdict on the owner's files: accepted or rejected, with notes."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from board.runtime import describe
from board.runtime.errors import ConfigurationError
from board.runtime.toml import parse, show
from firmware.card.box_file import BoxOptions
from firmware.card.card import File, collect, is_kept
from firmware.card.imager import LACKING, Imager
from firmware.card.note import TOO_DEEP, Note, at, is_refused, mistake, remark
from firmware.card.ssh_keys import short, sound_keys
from firmware.card.station.given import StationFiles
from firmware.card.station.part import look_at_station
from firmware.card.toml_lines import line_of, syntax_hint

KEYS = "authorized_keys"
SECRETS = ("wifi.password", "wifi.psk")
DIGITS = 64  # length of a PSK, which Imager may write for a password; the two cannot be compared
MOST_TOLD = 50  # most notes about one file


class Verdict(NamedTuple):
    """Result of checking a set.

    notes    notes for the owner; a mistake among them rejects the set.
    options  options of the box.
    names    proper names of the files that were read.
    keys     lines of authorized_keys that sshd accepts, even if the set is rejected.
    files    octets by path of the files that the station reads; texts have this system's line ends.
    """

    notes: list[Note]
    options: BoxOptions
    names: list[str]
    keys: list[str]
    files: dict[str, bytes]

    @property
    def key_count(self) -> int:
        """Number of different keys, regardless of options and comments."""
        return len({short(key) for key in self.keys})

    @property
    def is_accepted(self) -> bool:
        return not is_refused(self.notes)


def verdict(folder: Path, scratch: Path, board: str, defaults: str | None, now: float) -> Verdict:
    """Check the set in a folder.

    scratch   empty folder, in which the files are checked as they will lie on the box.
    board     board file of the box, unless the set has a board.toml.
    defaults  captain.toml of the box, under the owner's; None if this machine is not the box.
    now       Unix time.

    Raises OSError if the folder cannot be read.
    """
    notes: list[Note] = []
    found = collect(folder, notes)
    texts = {
        name: text for name, file in found.items() if not is_kept(name) and (text := _text(file, notes)) is not None
    }
    options, imager = _options(found, texts, notes)
    written = sound_keys(found[KEYS].place, [(1, texts[KEYS])], notes) if KEYS in texts else []
    keys = [*written, *(key for key in imager.keys if key not in written)]
    files = {name: file.octets for name, file in found.items() if is_kept(name)}
    files |= {name: texts[name].encode() for name in ("captain.toml", "board.toml") if name in texts}
    places = {file.name: file.place for file in found.values()}
    own = options.eth0.address if options.eth0 else ""
    is_wireless = options.wifi is not None
    look_at_station(StationFiles(files, places, scratch, board, defaults, own, is_wireless, now), notes)
    if not keys:
        what = "no valid ssh key: ssh login is not possible"
        notes.append(remark(KEYS, what, f"put the line of your .pub file into {KEYS}"))
    return Verdict(_bounded(notes), options, sorted(found), keys, files)


def _text(file: File, notes: list[Note]) -> str | None:
    """Return a file's text with \\n at line ends; add a note about an octet that is not UTF-8.

    In authorized_keys such an octet is replaced, because it affects only its own line.
    """
    is_lenient = file.name == KEYS and b"\0" not in file.octets  # zero octets indicate UTF-16
    try:
        text = file.octets.decode("utf-8-sig", "replace" if is_lenient else "strict")
    except UnicodeDecodeError as error:
        line = file.octets.count(b"\n", 0, error.start) + 1
        what = f"octet 0x{file.octets[error.start]:02x} is not UTF-8"
        notes.append(mistake(at(file.place, line), what, "save it as UTF-8"))
        return None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _bounded(notes: list[Note]) -> list[Note]:
    """Return at most MOST_TOLD notes per file, and the count of the rest: a wrong file may cause thousands."""
    told: list[Note] = []
    left: dict[str, list[Note]] = {}
    counts: Counter[str] = Counter()
    for note in notes:
        name = note.place.partition(":")[0]
        counts[name] += 1
        (told if counts[name] <= MOST_TOLD else left.setdefault(name, [])).append(note)
    for name, rest in left.items():
        say, what = (mistake, "mistakes") if is_refused(rest) else (remark, "notes")
        told.append(say(name, f"further {what}, not listed: {len(rest)}", "check that it is the right file"))
    return told


# -- options of the box


def _options(found: Mapping[str, File], texts: Mapping[str, str], notes: list[Note]) -> tuple[BoxOptions, Imager]:
    """Return the options of box.toml merged with those of Imager's files."""
    imager = Imager()
    if "user-data" in texts:
        imager.read_user_data(found["user-data"].place, texts["user-data"], notes)
    if "network-config" in texts:
        imager.read_network_config(found["network-config"].place, texts["network-config"], notes)
    if "cmdline.txt" in texts:
        imager.read_command_line(found["cmdline.txt"].place, texts["cmdline.txt"])
    name = found["box.toml"].place if "box.toml" in found else "box.toml"
    text = texts.get("box.toml", "")
    table = _table(name, text, notes)
    _drop_country(imager, table)
    _compare(name, text, table, imager, notes)
    merged = _merged(imager.table, table)
    try:
        return describe.read(BoxOptions, merged, ""), imager
    except ConfigurationError as error:
        for line in error.message.split("\n"):
            path, _, what = line.removeprefix(": ").partition(": ")
            inner = what.partition(": ")[0]  # example: `eth0: gateway: "10.0.0.5" is ...`
            key = f"{path}.{inner}" if inner.isidentifier() else path
            place = _imagers_place(key, table, imager)
            if place and key in LACKING and what.startswith("is missing"):
                notes.append(mistake(place, *LACKING[key]))
            else:
                notes.append(mistake(place or at(name, line_of(text, key)), f"{path}: {what}"))
    return BoxOptions(), imager


def _table(name: str, text: str, notes: list[Note]) -> dict[str, Any]:
    try:
        return parse(text)
    except ValueError as error:
        why, _, place = str(error).removesuffix(")").partition(" (at ")
        line = place.removeprefix("line ").partition(",")[0]
        notes.append(
            mistake(at(name, int(line) if line.isdecimal() else None), f"is not TOML: {why}", syntax_hint(why))
        )
    except RecursionError:
        notes.append(mistake(name, *TOO_DEEP))
    return {}


def _drop_country(imager: Imager, table: Mapping[str, Any]) -> None:
    """Drop a country without a network: Imager writes it on its own, and it configures nothing."""
    wifi = imager.table.get("wifi", {})
    if "ssid" not in wifi and "wifi" not in table:
        imager.table.pop("wifi", None)


def _compare(name: str, text: str, table: Mapping[str, Any], imager: Imager, notes: list[Note]) -> None:
    """Report settings that differ between box.toml and Imager's files."""
    ours, theirs = dict(_leaves(table)), dict(_leaves(imager.table))
    for path in sorted(ours.keys() & theirs.keys() - set(SECRETS)):
        if ours[path] != theirs[path]:
            what = f"{path} is {show(ours[path])}, but {show(theirs[path])} in {imager.places[path]}"
            notes.append(mistake(at(name, line_of(text, path)), what, "remove the wrong one"))
    path = SECRETS[0]
    if path in ours and path in theirs and ours[path] != theirs[path] and len(str(theirs[path])) != DIGITS:
        what = f"{path} conflicts with {imager.places[path]}"
        notes.append(mistake(at(name, line_of(text, path)), what, "remove the wrong one"))
    if any(path in ours for path in SECRETS) and (wifi := imager.table.get("wifi")):
        wifi.pop("password", None)


def _leaves(table: Mapping[str, Any], path: str = "") -> list[tuple[str, Any]]:
    found = []
    for key, value in table.items():
        place = f"{path}.{key}" if path else key
        found += _leaves(value, place) if isinstance(value, dict) else [(place, value)]
    return found


def _merged(under: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    merged = {**under, **over}
    for key in under.keys() & over.keys():
        if isinstance(under[key], dict) and isinstance(over[key], dict):
            merged[key] = {**under[key], **over[key]}
    return merged


def _imagers_place(path: str, table: Mapping[str, Any], imager: Imager) -> str:
    """Return file and line in Imager's files of a key, or of its table; empty if box.toml has it."""
    key = path.partition("[")[0]
    if key in imager.places:
        return "" if key in dict(_leaves(table)) else imager.places[key]
    above = key.partition(".")[0]
    places = (place for other, place in imager.places.items() if other.startswith(f"{above}."))
    return "" if above in table else next(places, "")
