"""What Raspberry Pi Imager writes to a card: taken where it is data, told and never run where it is not."""

from collections.abc import Iterator
from pathlib import Path

from tests.image.console_notes import notes, reachable, taken_away, told
from tests.image.login import Key, said
from tests.image.machine import powered, put
from tests.image.rows import Row

IMAGER = {
    "user-data": """\
#cloud-config
hostname: depot-3
manage_etc_hosts: true
packages:
- avahi-daemon
timezone: Europe/Berlin
keyboard:
  model: pc105
  layout: "de"
enable_ssh: true
users:
- name: pi
  groups: users,adm,sudo
  shell: /bin/bash
  lock_passwd: false
  passwd: $5$ABCDEFGH$0123456789
  ssh_authorized_keys:
    - {key}
  sudo: ALL=(ALL) NOPASSWD:ALL
""",
    "network-config": """\
network:
  version: 2
  wifis:
    wlan0:
      dhcp4: true
      regulatory-domain: "DE"
      access-points:
        "depot":
          password: "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef"
      optional: true
""",
    "meta-data": "instance-id: rpi-imager-1784124660514\n",
    "cmdline.txt": " cfg80211.ieee80211_regdom=DE ds=nocloud;i=rpi-imager-1784124660514",
    "firstrun.sh": "#!/bin/sh\ntouch /data/firstrun\n",
    "box.toml": "[console]\nshell = false\n",
}  # what Raspberry Pi Imager writes, and one file beside it


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
    put(card, {name: text.replace("{key}", key.line.strip()) for name, text in IMAGER.items()})
    with powered(card, folder) as guest:
        guest.stop_loader("modules_load=mac80211_hwsim")  # a Wi-Fi device of the kernel's own
        shown = notes(guest)
        yield told(
            shown, "Imager's settings", "the owner's files are in force: box.toml, network-config, user-data; 1 ssh key"
        )
        yield told(shown, "a password", "user-data:16: passwd is refused: no password exists on this box")
        yield told(shown, "another user", 'user-data:12: no user "pi" is made; its ssh keys are operator')
        yield told(shown, "packages", "user-data:4: packages is not taken: nothing is run or installed")
        yield told(shown, "a keyboard", "user-data: not taken: keyboard (line 7)")
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
