"""Which files of the boot partition are the owner's, under whatever names computers have given them."""

import os
import stat
from collections.abc import Iterator
from difflib import get_close_matches
from pathlib import Path
from typing import NamedTuple

from firmware.box.note import Note, mistake, remark

OWN = ("captain.toml", "box.toml", "authorized_keys", "board.toml", "user-data", "network-config", "cmdline.txt")
FOLDER = "mqtt"  # certificates, keys and passwords for brokers
LIBRARIES = "lib"  # of modules' makers: no part of the image
FOLDERS = (FOLDER, LIBRARIES)
# What other systems read there, and what to do here instead.
FOREIGN = {
    "firstrun.sh": "nothing here is ever run; Imager's settings count as user-data and network-config",
    "custom.toml": "write box.toml",
    "wpa_supplicant.conf": "write the network into box.toml: [wifi] country, ssid, password",
    "ssh": "ssh is always on: put your public key into authorized_keys",
    "ssh.txt": "ssh is always on: put your public key into authorized_keys",
    "userconf": "no password exists on this box: put your public key into authorized_keys",
    "userconf.txt": "no password exists on this box: put your public key into authorized_keys",
}
# The firmware's and the boot loader's, and what computers leave on every card.
OTHERS = (".elf", ".dat", ".bin", ".dtb", ".dtbo", ".scr", ".img", ".uf2")
THEIRS = ("config.txt", "readme.txt", "issue.txt", "meta-data", "autorun.inf")
# What people call them.
MEANT = {
    "authorised_keys": "authorized_keys", "authorized-keys": "authorized_keys", "id_ed25519.pub": "authorized_keys",
    "id_rsa.pub": "authorized_keys", "id_ecdsa.pub": "authorized_keys", "captain.conf": "captain.toml",
    "captain.txt": "captain.toml", "captain": "captain.toml", "box.txt": "box.toml", "box": "box.toml",
    "wifi.txt": "box.toml", "network-config.yaml": "network-config", "user-data.yaml": "user-data",
}  # fmt: skip
# Files beside the .pub that was meant.
PRIVATE = ("id_ed25519", "id_rsa", "id_ecdsa", "id_ed25519_sk", "id_ecdsa_sk")
# Whoever puts such a file there expects something of it.
EXPECTED = (".toml", ".pub", ".pem", ".crt", ".key", ".conf", ".yaml", ".yml", ".sh")
# Octets of a file: one that a person writes, for YAML of more takes seconds; of mqtt/, for one with all authorities of
# a system has some 220,000; of lib/.
LARGEST = 64 << 10
LARGEST_IN = {FOLDER: 256 << 10, LIBRARIES: 16 << 20}
MOST = {FOLDER: 64, LIBRARIES: 8}  # files


class File(NamedTuple):
    """name: as it is known here; place: as it is called on the card."""

    name: str
    place: str
    octets: bytes


def collect(folder: Path, notes: list[Note]) -> dict[str, File]:
    """The owner's files by name. Raises OSError where the folder cannot be read."""
    found: dict[str, File] = {}
    by_name: dict[str, list[Path]] = {}
    for path in sorted(folder.iterdir()):
        name = path.name.lower()
        if path.name.startswith((".", "~")) or name.endswith(OTHERS) or name in THEIRS:
            continue  # ._authorized_keys is macOS's, of another file
        by_name.setdefault(_known(name, path), []).append(path)
    for name, paths in by_name.items():
        if name in FOREIGN:
            notes.append(remark(paths[0].name, "is not read here", FOREIGN[name]))
        elif name in PRIVATE:
            what = "is a private key, which belongs on your own computer only"
            notes.append(mistake(paths[0].name, what, "put the file that ends in .pub here, and make a new pair"))
        elif name in FOLDERS and paths[0].is_dir():
            found |= {file.name: file for file in _below(paths[0], name, notes)}
        elif name in FOLDERS:
            notes.append(mistake(paths[0].name, "is no folder", f"make a folder {name}, and put the files into it"))
        elif name in OWN and (file := _chosen(name, paths, notes)):
            found[name] = file
    for name, paths in by_name.items():
        _look_for_slips(name, paths[0], found, notes)
    return found


def is_kept(name: str) -> bool:
    """Whether its octets are nobody's to change: it is for a broker, or a library."""
    return name.partition("/")[0] in FOLDERS and "/" in name


def _known(name: str, path: Path) -> str:
    """captain.toml of captain.toml.txt, which Windows shows without its end."""
    plain = name.removesuffix(".txt")
    return plain if plain in OWN and path.is_file() else name


def _chosen(name: str, paths: list[Path], notes: list[Note]) -> File | None:
    """One of the files that are meant by a name; with two that say different things nobody knows which is meant."""
    files = [file for path in paths if (file := _read(name, path.name, path, notes))]
    files.sort(key=lambda file: file.place.lower() != name)
    if len({file.octets for file in files}) > 1:
        what = f"is there beside {files[1].place}, which says something else"
        notes.append(mistake(files[0].place, what, "remove the one that is not meant"))
    elif files and files[0].place.lower() != name:
        notes.append(remark(files[0].place, f"is taken as {name}", "better rename it; Windows hides the end of names"))
    return files[0] if files else None


def _below(folder: Path, known: str, notes: list[Note]) -> Iterator[File]:
    paths = [path for path in sorted(folder.iterdir()) if not path.name.startswith((".", "~"))]
    if len(paths) > MOST[known]:
        what = f"has {len(paths)} files, and {MOST[known]} at most are read"
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
                notes.append(mistake(place, "is no file", "put a text file there"))
                return None
            octets = os.read(descriptor, most + 1)
        finally:
            os.close(descriptor)
    except OSError as error:
        notes.append(mistake(place, f"cannot be read: {error.strerror}", "copy it again; is the card sound?"))
        return None
    if len(octets) > most:
        notes.append(mistake(place, f"has more than {most} octets", "is it the right file?"))
        return None
    return File(name, place, octets)


def _look_for_slips(name: str, path: Path, found: dict[str, File], notes: list[Note]) -> None:
    """A name that is nearly one of ours: when that one is not there, it is a slip."""
    if name in (*OWN, *FOREIGN, *FOLDERS, *PRIVATE):
        return
    near = [MEANT[name]] if name in MEANT else get_close_matches(name, OWN[:-1], 1, 0.8)
    if near and near[0] not in found:
        notes.append(mistake(path.name, "is not read", f"rename it to {near[0]}"))
    elif near:
        notes.append(remark(path.name, f"is not read: {near[0]} is"))
    elif name.endswith(EXPECTED):
        notes.append(remark(path.name, "is not read", f"what is: {', '.join(OWN[:-1])}, {FOLDER}/, {LIBRARIES}/"))
