"""Files of Raspberry Pi Imager: data is used, scripts are never run."""

from collections.abc import Iterator
from pathlib import Path

from tests.firmware.card.conftest import KEY
from tests.firmware.card.imager_card import CMDLINE, NETWORK_WITH_CABLE, USER_DATA
from tests.proof.image.console_notes import all_told, notes, reachable, taken_away
from tests.proof.image.login import Key, said
from tests.proof.image.machine import powered, put
from tests.proof.image.rows import Row

FILES = {
    "user-data": USER_DATA.replace("captain-7", "depot-3"),  # another name than it had
    "network-config": NETWORK_WITH_CABLE,
    "meta-data": "instance-id: rpi-imager-1784124660514\n",
    "cmdline.txt": CMDLINE,
    "firstrun.sh": "#!/bin/sh\ntouch /data/firstrun\n",
    "box.toml": "[console]\nshell = false\n",  # beside them
}


def rows(card: Path, folder: Path, key: Key) -> Iterator[Row]:
    taken_away(
        card,
        "captain.toml",
        "captain.toml.txt",
        "box.toml",
        "authorised_keys",
        "mqtt/ca.pem",
        "mqtt/box.pem",
        "mqtt/box.key",
    )
    put(card, {name: text.replace(KEY, key.line.strip()) for name, text in FILES.items()})
    with powered(card, folder) as guest:
        guest.stop_loader("modules_load=mac80211_hwsim")  # a Wi-Fi device of the kernel's own
        shown = notes(guest)
        yield from all_told(shown, {
            "Imager's settings": "the owner's files are in force: box.toml, network-config, user-data; 1 ssh key",
            "packages": "user-data:5: packages is ignored: the box runs and installs nothing",
            "a password": "user-data:22: passwd is refused: the box has no passwords",
            "another user": 'user-data:18: user "pi" is not created; its ssh keys log in as operator',
            "a keyboard": "user-data: keys ignored: keyboard (line 14)",
        })  # fmt: skip
        yield Row(
            "console.shell = false", "a key" if "s shell" in shown else "no key", "no key", "s shell" not in shown
        )
        yield from reachable(guest, key, "depot-3", "with Imager's settings")
        for what, command, goal in (
            ("Wi-Fi", "systemctl is-active wpa_supplicant@wlan0.service", "active"),
            ("country", "/usr/sbin/iw reg get | sed -n 's/^country \\(..\\).*/\\1/p' | head -n 1", "DE"),
            ("firstrun.sh", "test -e /data/firstrun && echo run || echo not run", "not run"),
        ):
            found = said(guest, key, command)
            yield Row(f"Imager: {what}", found[:40], goal, found == goal)
