"""Finds the owner's files on the boot partition, despite changed names."""

import os
import stat
from collections.abc import Iterator
from difflib import get_close_matches
from pathlib import Path
from typing import NamedTuple

from firmware.card.note import Note, mistake, remark

OWN = ("captain.toml", "box.toml", "authorized_keys", "board.toml", "user-data", "network-config", "cmdline.txt")
FOLDER = "mqtt"  # certificates, keys and passwords for brokers
LIBRARIES = "lib"  # libraries of module vendors, which the image does not contain
FOLDERS = (FOLDER, LIBRARIES)
# Files for other systems, and the remedy for each on this box.
FOREIGN = {
    "firstrun.sh": "the box runs no scripts; it reads Imager's user-data and network-config",
    "custom.toml": "write box.toml",
    "wpa_supplicant.conf": "write the network into box.toml: [wifi] country, ssid, password",
    "ssh": "ssh is always on: put your public key into authorized_keys",
    "ssh.txt": "ssh is always on: put your public key into authorized_keys",
    "userconf": "no password exists on this box: put your public key into authorized_keys",
    "userconf.txt": "no password exists on this box: put your public key into authorized_keys",
}
# Files of the firmware and the boot loader, and files that computers leave on every card.
OTHERS = (".elf", ".dat", ".bin", ".dtb", ".dtbo", ".scr", ".img", ".uf2")
THEIRS = ("config.txt", "readme.txt", "issue.txt", "meta-data", "autorun.inf")
# Wrong names that people give to these files.
MEANT = {
    "authorised_keys": "authorized_keys", "authorized-keys": "authorized_keys", "id_ed25519.pub": "authorized_keys",
    "id_rsa.pub": "authorized_keys", "id_ecdsa.pub": "authorized_keys", "captain.conf": "captain.toml",
    "captain.txt": "captain.toml", "captain": "captain.toml", "box.txt": "box.toml", "box": "box.toml",
    "wifi.txt": "box.toml", "network-config.yaml": "network-config", "user-data.yaml": "user-data",
}  # fmt: skip
# Private keys, which lie beside the .pub file that was meant.
PRIVATE = ("id_ed25519", "id_rsa", "id_ecdsa", "id_ed25519_sk", "id_ecdsa_sk")
# Unknown files with these endings are reported, because their author expects an effect.
EXPECTED = (".toml", ".pub", ".pem", ".crt", ".key", ".conf", ".yaml", ".yml", ".sh")
# Largest file in octets. Files at the top are written by hand, and YAML of more would take seconds. In mqtt/, a file
# with all authorities of a system has some 220,000 octets.
LARGEST = 64 << 10
LARGEST_IN = {FOLDER: 256 << 10, LIBRARIES: 16 << 20}
MOST = {FOLDER: 64, LIBRARIES: 8}  # most files in the folder


class File(NamedTuple):
    """File of the owner. name: its proper name; place: its name on the card."""

    name: str
    place: str
    octets: bytes


def collect(folder: Path, notes: list[Note]) -> dict[str, File]:
    """Return the owner's files by their proper names. Raises OSError if the folder cannot be read."""
    found: dict[str, File] = {}
    by_name: dict[str, list[Path]] = {}
    for path in sorted(folder.iterdir()):
        name = path.name.lower()
        if path.name.startswith((".", "~")) or name.endswith(OTHERS) or name in THEIRS:
            continue  # such as ._authorized_keys, in which macOS keeps attributes of another file
        by_name.setdefault(_known(name, path), []).append(path)
    for name, paths in by_name.items():
        if name in FOREIGN:
            notes.append(remark(paths[0].name, "is not read here", FOREIGN[name]))
        elif name in PRIVATE:
            what = "is a private key, which must stay on your own computer"
            notes.append(mistake(paths[0].name, what, "make a new key pair, and put its .pub file here"))
        elif name in FOLDERS and paths[0].is_dir():
            found |= {file.name: file for file in _below(paths[0], name, notes)}
        elif name in FOLDERS:
            notes.append(mistake(paths[0].name, "is not a folder", f"make a folder {name}, and put the files into it"))
        elif name in OWN and (file := _chosen(name, paths, notes)):
            found[name] = file
    for name, paths in by_name.items():
        _look_for_slips(name, paths[0], found, notes)
    return found


def is_kept(name: str) -> bool:
    """Return whether a file is passed on unchanged, because it is for a broker or a library."""
    return name.partition("/")[0] in FOLDERS and "/" in name


def _known(name: str, path: Path) -> str:
    """Return the proper name: captain.toml for captain.toml.txt, whose ending Windows hides."""
    plain = name.removesuffix(".txt")
    return plain if plain in OWN and path.is_file() else name


def _chosen(name: str, paths: list[Path], notes: list[Note]) -> File | None:
    """Return the file for a proper name; report two files with different contents as a conflict."""
    files = [file for path in paths if (file := _read(name, path.name, path, notes))]
    files.sort(key=lambda file: file.place.lower() != name)
    if len({file.octets for file in files}) > 1:
        what = f"conflicts with {files[1].place}"
        notes.append(mistake(files[0].place, what, "remove the wrong one"))
    elif files and files[0].place.lower() != name:
        notes.append(remark(files[0].place, f"is read as {name}", "rename it; Windows hides the end of names"))
    return files[0] if files else None


def _below(folder: Path, known: str, notes: list[Note]) -> Iterator[File]:
    paths = [path for path in sorted(folder.iterdir()) if not path.name.startswith((".", "~"))]
    if len(paths) > MOST[known]:
        what = f"has {len(paths)} files; at most {MOST[known]} are read"
        notes.append(mistake(folder.name, what, "remove those that captain.toml does not name"))
    for path in paths[: MOST[known]]:
        name = f"{known}/{path.name}"
        if path.is_dir():
            notes.append(mistake(name, "is a folder", f"put the files into {known}/ itself"))
        elif file := _read(name, name, path, notes):
            yield file


def _read(name: str, place: str, path: Path, notes: list[Note]) -> File | None:
    most = LARGEST_IN.get(name.partition("/")[0], LARGEST)
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            if not stat.S_ISREG(os.fstat(descriptor).st_mode):
                notes.append(mistake(place, "is not a file", "put a text file there"))
                return None
            octets = os.read(descriptor, most + 1)
        finally:
            os.close(descriptor)
    except OSError as error:
        notes.append(mistake(place, f"cannot be read: {error.strerror}", "copy it again, or replace the card"))
        return None
    if len(octets) > most:
        notes.append(mistake(place, f"has more than {most} octets", "check that it is the right file"))
        return None
    return File(name, place, octets)


def _look_for_slips(name: str, path: Path, found: dict[str, File], notes: list[Note]) -> None:
    """Report an unknown file whose name is similar to a proper one; it is a mistake if the proper one is absent."""
    if name in (*OWN, *FOREIGN, *FOLDERS, *PRIVATE):
        return
    near = [MEANT[name]] if name in MEANT else get_close_matches(name, OWN[:-1], 1, 0.8)
    if near and near[0] not in found:
        notes.append(mistake(path.name, "is not read", f"rename it to {near[0]}"))
    elif near:
        notes.append(remark(path.name, f"is not read: {near[0]} is"))
    elif name.endswith(EXPECTED):
        notes.append(remark(path.name, "is not read", f"what is: {', '.join(OWN[:-1])}, {FOLDER}/, {LIBRARIES}/"))
