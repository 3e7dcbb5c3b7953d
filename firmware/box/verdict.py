"""A set of the owner's files: read, checked by the code that will use it, and what follows from it for the box."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from board import describe
from board.errors import ConfigurationError
from board.toml import parse, show
from firmware.box.box_file import BoxOptions
from firmware.box.card import File, collect, is_kept
from firmware.box.imager import LACKING, Imager
from firmware.box.note import Note, at, is_refused, mistake, remark
from firmware.box.plain_text import plain
from firmware.box.ssh_keys import named, shut, sound_keys
from firmware.box.station import look_at_station
from firmware.box.station_given import StationFiles
from firmware.box.toml_lines import line_of, syntax_hint

KEYS = "authorized_keys"
SECRETS = ("wifi.password", "wifi.psk")
DIGITS = 64  # of what Imager may write in a password's place: nobody can tell whether it is the same one
MOST_TOLD = 50  # of what is to be said of one file


class Verdict(NamedTuple):
    """What became of a set.

    notes    for the owner; with a mistake among them nothing of the set is used.
    options  of the box.
    names    of the files that were read, as they are known here.
    keys     lines of authorized_keys that sshd takes, whatever else is wrong.
    files    path = octets: what the station reads, as text of this system.
    """

    notes: list[Note]
    options: BoxOptions
    names: list[str]
    keys: list[str]
    files: dict[str, bytes]

    @property
    def key_count(self) -> int:
        """Of different keys, whatever is written beside them."""
        return len({named(key) for key in self.keys})

    @property
    def is_accepted(self) -> bool:
        return not is_refused(self.notes)


def verdict(folder: Path, scratch: Path, board: str, defaults: str | None, now: float) -> Verdict:
    """The set in a folder.

    scratch   an empty folder; files are looked at there, as they will lie on the box.
    board     the box's, unless the set has a board.toml.
    defaults  captain.toml of the box, which the owner's is laid over, where this is the box.
    now       Unix time.

    Raises OSError where the folder cannot be read.
    """
    notes: list[Note] = []
    found = collect(folder, notes)
    texts = {
        name: text for name, file in found.items() if not is_kept(name) and (text := _text(file, notes)) is not None
    }
    options, imager = _options(found, texts, notes)
    written = sound_keys(found[KEYS].place, texts[KEYS], notes) if KEYS in texts else []
    keys = [*written, *(key for key in imager.keys if key not in written)]
    files = {name: file.octets for name, file in found.items() if is_kept(name)}
    files |= {name: texts[name].encode() for name in ("captain.toml", "board.toml") if name in texts}
    places = {file.name: file.place for file in found.values()}
    own = options.eth0.address if options.eth0 else ""
    is_wireless = options.wifi is not None
    look_at_station(StationFiles(files, places, scratch, board, defaults, own, is_wireless, now), notes)
    whys = {key: why for key in keys if (why := shut(key, now))}
    for key, why in whys.items():
        notes.append(remark(found[KEYS if key in written else "user-data"].place, f"the key {named(key)} {why}"))
    if all(key in whys for key in keys):
        what = "there is no {}ssh key: nobody {}can log in by ssh".format(*("other ", "else ") if keys else ("", ""))
        notes.append(remark(KEYS, what, f"put the line of your .pub file into {KEYS}"))
    return Verdict(_bounded(notes), options, sorted(found), keys, files)


def _text(file: File, notes: list[Note]) -> str | None:
    """As plain() has it. A comment of a key may be of another encoding: that key is good, and so are the others."""
    return plain(file.place, file.octets, notes, is_lenient=file.name == KEYS)


def _bounded(notes: list[Note]) -> list[Note]:
    """The first of each file: a wrong one may have thousands of mistakes, and nobody reads them."""
    told: list[Note] = []
    left: dict[str, list[Note]] = {}
    counts: Counter[str] = Counter()
    for note in notes:
        name = note.text.partition(":")[0]
        counts[name] += 1
        (told if counts[name] <= MOST_TOLD else left.setdefault(name, [])).append(note)
    for name, rest in left.items():
        say, what = (mistake, "mistakes") if is_refused(rest) else (remark, "notes")
        told.append(say(name, f"further {what}, not told here: {len(rest)}", "is it the right file?"))
    return told


# -- the box


def _options(found: Mapping[str, File], texts: Mapping[str, str], notes: list[Note]) -> tuple[BoxOptions, Imager]:
    """Of box.toml and of Imager's files together."""
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
            inner = what.partition(": ")[0]  # `eth0: gateway: "10.0.0.5" is ...`
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
        notes.append(mistake(name, "is nested too deep", "is it the right file?"))
    return {}


def _drop_country(imager: Imager, table: Mapping[str, Any]) -> None:
    """A country without a network: Imager writes it of itself, and it configures nothing."""
    wifi = imager.table.get("wifi", {})
    if "ssid" not in wifi and "wifi" not in table:
        imager.table.pop("wifi", None)


def _compare(name: str, text: str, table: Mapping[str, Any], imager: Imager, notes: list[Note]) -> None:
    """What box.toml and Imager's files say differently."""
    ours, theirs = dict(_leaves(table)), dict(_leaves(imager.table))
    for path in sorted(ours.keys() & theirs.keys() - set(SECRETS)):
        if ours[path] != theirs[path]:
            what = f"{path} is {show(ours[path])}, but {show(theirs[path])} in {imager.places[path]}"
            notes.append(mistake(at(name, line_of(text, path)), what, "remove the one that is not meant"))
    path = SECRETS[0]
    if path in ours and path in theirs and ours[path] != theirs[path] and len(str(theirs[path])) != DIGITS:
        what = f"{path} is another one than in {imager.places[path]}"
        notes.append(mistake(at(name, line_of(text, path)), what, "remove the one that is not meant"))
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
    """File and line of Imager's that a key comes from, or that its table comes from; empty where box.toml has them."""
    key = path.partition("[")[0]
    if key in imager.places:
        return "" if key in dict(_leaves(table)) else imager.places[key]
    above = key.partition(".")[0]
    places = (place for other, place in imager.places.items() if other.startswith(f"{above}."))
    return "" if above in table else next(places, "")
