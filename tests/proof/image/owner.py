"""The owner's files: the guide followed to the letter, and each kind of mistake named on the serial console."""

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

from firmware.lab.certificates import Authority
from tests.proof.image import led, owner_imager, owner_page
from tests.proof.image.console_notes import all_told, notes, reachable, taken_away
from tests.proof.image.login import Key, new_key, said
from tests.proof.image.machine import Guest, powered, put
from tests.proof.image.rows import Options, Row

CARD_MIB = 4096


def rows(card: Path, folder: Path, options: Options) -> Iterator[Row]:
    key = new_key(folder, "id_ed25519")
    own = folder / "card.img"
    subprocess.run(["cp", "--sparse=always", card, own], check=True)
    os.truncate(own, CARD_MIB << 20)  # a larger card than the image
    yield from _first_set_with_mistakes(own, folder, key)
    if options.is_short:
        return
    yield from owner_page.rows(own, folder, key)
    yield from _later_set_with_mistakes(own, folder, key)
    yield from owner_imager.rows(own, folder, key)


def _first_set_with_mistakes(card: Path, folder: Path, key: Key) -> Iterator[Row]:
    """Of a box that never took a set: it runs as it was made, with the sound keys."""
    put(card, {
        "captain.toml": "[statoin]\nname = 'x'\n[endpoint]\npull = 66000\n",
        "box.toml": 'host_name = "captain_7"\n[wifi]\ncountry = "UK"\nssid = "depot"\npassword = 12345678\n',
        "authorized_keys": f"{key.line}{key.line[:40]}\n",
        "board.toml": 'name = "mine"\n[identity]\nbus = "main"\naddress = 80\n',
        "user-data": "#cloud-config\nusers:\n\t- default\n",
    })  # fmt: skip
    with powered(card, folder, machine=led.machine(folder)) as guest:
        shown = notes(guest)
        yield from all_told(shown, {
            "nothing is taken": "the owner's files are REJECTED, for 8 mistakes; the box runs with its defaults",
            "a key that nobody knows": "captain.toml:1: statoin: is not a known key; did you mean station?",
            "a number out of range": "captain.toml:4: endpoint.pull: 66000 is out of range",
            "a host name that is none": 'box.toml:1: host_name: invalid host name: "captain_7"',
            "a country that is none": 'box.toml:3: wifi.country: unknown country: "UK"; the United Kingdom is GB',
            "text without quotes": "box.toml:5: wifi.password: is not text; write it in quotes",
            "half a line of a key": "authorized_keys:2: the key",
            "a board file with a hole": "board.toml:3: identity.bus: 'main' is not declared",
            "a tab in YAML": "user-data:3: is not YAML: found character",
        })  # fmt: skip
        yield Row(
            "the Wi-Fi's password",
            "not shown" if "12345678" not in shown else "shown",
            "not shown",
            "12345678" not in shown,
        )
        yield from reachable(guest, key, "captain", "its first files refused")
        leases = said(guest, key, owner_page.LEASES)
        yield Row("leases of eth0, its first files refused", leases, "1", leases == "1")
        seen = led.blinks(guest, key)
        is_two = len(seen) > 1 and set(seen) == {2}
        yield Row("blinks of the ACT LED, from pause to pause", " ".join(map(str, seen)) or "none", "2", is_two)
        yield _grown(guest, key)


def _later_set_with_mistakes(card: Path, folder: Path, key: Key) -> Iterator[Row]:
    """Of a box that has taken one: that one stays in force."""
    authority = Authority(folder)
    pair = authority.issue("box", "extendedKeyUsage=clientAuth\n", ("-days", "2"))
    other = authority.issue("other", "extendedKeyUsage=clientAuth\n", ("-days", "2"))
    broker = '[interfaces.cloud]\ndriver = "mqtt"\nurl = "mqtts://broker.example"\n'
    files: dict[str, str | bytes] = {
        "captain.toml": f'{broker}ca = "mqtt/ca.pem"\ncertificate = "mqtt/box.pem"\nkey = "mqtt/box.key"\n',
        "captain.toml.txt": '[station]\nname = "other"\n',
        "mqtt/ca.pem": Path(authority.certificate).read_bytes(),
        "mqtt/box.pem": pair.certificate.read_bytes(),
        "mqtt/box.key": other.key.read_bytes(),
        "box.toml": "# Büro\n".encode("latin-1"),
        "authorised_keys": key.line,
        "firstrun.sh": "reboot\n",
    }
    taken_away(card, "authorized_keys", "user-data")
    put(card, files)
    with powered(card, folder, machine=owner_page.STATIC) as guest:
        shown = notes(guest)
        yield from all_told(shown, {
            "what was taken stays": "the owner's files are REJECTED, for 4 mistakes; the last accepted set stays in force",
            "a key of another certificate": "captain.toml:6: interfaces.cloud.key mqtt/box.key: is not the key of",
            "two files that differ": "captain.toml: conflicts with captain.toml.txt",
            "letters that are not UTF-8": "box.toml:1: octet 0xfc is not UTF-8; save it as UTF-8",
            "a slip in a file's name": "authorised_keys: is not read; rename it to authorized_keys",
            "a script": "firstrun.sh: is not read here; the box runs no scripts",
        })  # fmt: skip
        yield from reachable(guest, key, "captain-7", "later files refused")


def _grown(guest: Guest, key: Key) -> Row:
    """The table of partitions at the early boot, the file system behind the start's back."""
    wait = 'while [ "$(systemctl show -P ActiveState captain-grow.service)" = activating ]; do sleep 1; done'
    said(guest, key, wait, 600)
    size = said(guest, key, "df -m --output=size /data | tail -n 1").strip()
    room = CARD_MIB - 1742  # where it begins; ext4 itself needs a few percent
    return Row(
        f"data on a card of {CARD_MIB} MiB", f"{size} MiB", f"over {room * 0.9:.0f}", int(size or 0) > room * 0.9
    )
