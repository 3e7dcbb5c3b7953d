"""The owner's files: the README's page followed to the letter, and each kind of mistake named on the serial console."""

import os
import re
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path

from firmware.lab.certificates import Authority
from tests.image import led
from tests.image.login import Key, new_key, said, wait_for_ssh
from tests.image.machine import Guest, Ports, partition_offset, powered, put
from tests.image.rows import Options, Row
from tests.image.screen import HEAD, Screen
from tests.image.user import user

PROJECT = Path(__file__).resolve().parents[2]
README = (PROJECT / "README.md").read_text()
PAGE = README[README.index("## Flash, boot, connect") : README.index("## The serial console")]
BLOCKS = {
    kind: re.findall(rf"^```{kind} box\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL) for kind in ("sh", "toml", "text")
}
# Where a desktop mounts the card, and the box's name, which this machine's network does not tell: QEMU forwards ports.
MOUNTED, NAME = "/media/$USER/BOOT", "captain-7.local"
CARD_MIB = 4096
HEARTBEAT = "[b'hb.counter'"
NEXT = re.compile(r"next page \((\d+)\)")

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


def rows(card: Path, folder: Path, options: Options) -> Iterator[Row]:
    key = new_key(folder, "id_ed25519")
    own = folder / "card.img"
    subprocess.run(["cp", "--sparse=always", card, own], check=True)
    os.truncate(own, CARD_MIB << 20)  # a larger card than the image
    yield from _first_set_with_mistakes(own, folder, key)
    if options.is_short:
        return
    yield from _page(own, folder, key)
    yield from _later_set_with_mistakes(own, folder, key)
    yield from _imager(own, folder, key)


# -- mistakes


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
        shown = _notes(guest)
        yield _told(
            shown, "nothing is taken", "the owner's files are NOT taken, for 8 mistakes; the box runs as it was made"
        )
        yield _told(
            shown, "a key that nobody knows", "captain.toml:1: statoin: is not a known key; did you mean station?"
        )
        yield _told(shown, "a number out of range", "captain.toml:4: endpoint.pull: 66000 is out of range")
        yield _told(shown, "a host name that is none", 'box.toml:1: host_name: "captain_7" is no host name')
        yield _told(
            shown, "a country that is none", 'box.toml:3: wifi.country: "UK" is no country; the United Kingdom is GB'
        )
        yield _told(shown, "text without quotes", "box.toml:5: wifi.password: is no text; write it in quotes")
        yield _told(shown, "half a line of a key", "authorized_keys:2: the key")
        yield _told(shown, "a board file with a hole", "board.toml:3: identity.bus: 'main' is not declared")
        yield _told(shown, "a tab in YAML", "user-data:3: is not YAML: found character")
        yield Row(
            "the Wi-Fi's password",
            "not shown" if "12345678" not in shown else "shown",
            "not shown",
            "12345678" not in shown,
        )
        yield from _reachable(guest, key, "captain", "its first files refused")
        seen = led.blinks(guest, key)
        is_two = len(seen) > 1 and set(seen) == {2}
        yield Row("blinks of the ACT LED, from pause to pause", " ".join(map(str, seen)) or "none", "2", is_two)
        yield _grown(guest, key)


def _later_set_with_mistakes(card: Path, folder: Path, key: Key) -> Iterator[Row]:
    """Of a box that has taken one: that one stays in force."""
    authority = Authority(folder)
    pair = authority.issue("box", "extendedKeyUsage=clientAuth\n", 2)
    other = authority.issue("other", "extendedKeyUsage=clientAuth\n", 2)
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
    _take(card, "authorized_keys", "user-data")
    put(card, files)
    with powered(card, folder) as guest:
        shown = _notes(guest)
        yield _told(
            shown,
            "what was taken stays",
            "the owner's files are NOT taken, for 4 mistakes; those of before stay in force",
        )
        yield _told(
            shown,
            "a key of another certificate",
            "captain.toml:6: interfaces.cloud.key mqtt/box.key: is not the key of",
        )
        yield _told(
            shown, "two files that differ", "captain.toml: is there beside captain.toml.txt, which says something else"
        )
        yield _told(shown, "letters that are not UTF-8", "box.toml:1: octet 0xfc is not UTF-8; save it as UTF-8")
        yield _told(shown, "a slip in a file's name", "authorised_keys: is not read; rename it to authorized_keys")
        yield _told(shown, "a script", "firstrun.sh: is not read here; nothing here is ever run")
        yield from _reachable(guest, key, "captain-7", "later files refused")


def _reachable(guest: Guest, key: Key, name: str, when: str) -> Iterator[Row]:
    with user(guest.ports) as one:
        number = one.heartbeat()
    yield Row(f"the endpoint, {when}", f"heartbeat {number}", "answers", True)
    wait_for_ssh(guest)
    found = said(guest, key, "id -un; hostname")
    yield Row(
        f"ssh, {when}", found.replace("\n", " at ") or "refused", f"operator at {name}", found == f"operator\n{name}"
    )


def _grown(guest: Guest, key: Key) -> Row:
    """The table of partitions at the early boot, the file system behind the start's back."""
    wait = 'while [ "$(systemctl show -P ActiveState captain-grow.service)" = activating ]; do sleep 1; done'
    said(guest, key, wait, 600)
    size = said(guest, key, "df -m --output=size /data | tail -n 1").strip()
    room = CARD_MIB - 1742  # where it begins; ext4 itself needs a few percent
    return Row(
        f"data on a card of {CARD_MIB} MiB", f"{size} MiB", f"over {room * 0.9:.0f}", int(size or 0) > room * 0.9
    )


# -- the page


def _page(card: Path, folder: Path, key: Key) -> Iterator[Row]:
    """Its commands and files as they stand; only the card's place, the box's name and ports are this machine's."""
    home, mounted, desk = folder / "home", folder / "BOOT", folder / "desk"
    for path in (home / ".ssh", mounted, desk):
        path.mkdir(parents=True)
    for name in ("id_ed25519", "id_ed25519.pub"):
        shutil.copy(folder / name, home / ".ssh" / name)  # with its mode: ssh takes no key that others may read
    (desk / "box.toml").write_text(BLOCKS["toml"][0])
    (desk / "captain.toml").write_text('[station]\nname = "captain-7"\n')
    prepare, connect = BLOCKS["sh"]
    done = _run(prepare.replace(MOUNTED, str(mounted)), desk, home)
    verdict = (done.stdout.strip().splitlines() or [done.stderr])[-1]
    yield Row("README: Your files", verdict[:40], "the box will take it", verdict.startswith("the box will take it"))
    _take(card, "board.toml", "user-data")
    put(card, {path.name: path.read_bytes() for path in mounted.iterdir()})
    with powered(card, folder) as guest:
        shown = _notes(guest)
        for line in BLOCKS["text"][0].splitlines():
            yield _told(shown, "README: first lines", line.removeprefix("! "))
        wait_for_ssh(guest)
        with user(guest.ports) as one:
            one.heartbeat()
        status, heartbeat = connect.splitlines()
        found = _run(status, desk, home, guest.ports).stdout.splitlines()[:1]
        yield Row("README: ssh, captain status", found[0][:40] if found else "nothing", "it answers", bool(found))
        found = _run(_local(heartbeat, guest.ports), desk, home).stdout.split(",")[:1]
        yield Row("README: a heartbeat by pyzmq", found[0] if found else "nothing", HEARTBEAT, found == [HEARTBEAT])
        yield from _as_written(guest, key)


def _as_written(guest: Guest, key: Key) -> Iterator[Row]:
    """What box.toml of the page has asked for."""
    for what, command, goal in (
        ("host name", "hostname", "captain-7"),
        ("time zone", "readlink /etc/localtime", "/usr/share/zoneinfo/Europe/Berlin"),
        ("address of eth0", "ip -4 -o address show dev eth0 scope global | awk '{print $4}'", "10.0.2.15/24"),
        ("it is no lease", "networkctl status eth0 | grep -c 'via DHCP4'", "0"),
        ("way out", "ip route show default | awk '{print $3}'", "10.0.2.2"),
        ("passwords on the partition", "cat /boot/firmware/box.toml 2>&1 | grep -c 'Permission denied'", "1"),
        ("units that have failed", "systemctl --failed --plain --no-legend | wc -l", "0"),
    ):
        found = said(guest, key, command)
        yield Row(f"box.toml: {what}", found[:40], goal, found == goal)


# -- Raspberry Pi Imager


def _imager(card: Path, folder: Path, key: Key) -> Iterator[Row]:
    _take(
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
        shown = _notes(guest)
        yield _told(
            shown, "Imager's settings", "the owner's files are in force: box.toml, network-config, user-data; 1 ssh key"
        )
        yield _told(shown, "a password", "user-data:16: passwd is refused: no password exists on this box")
        yield _told(shown, "another user", 'user-data:12: no user "pi" is made; its ssh keys are operator')
        yield _told(shown, "packages", "user-data:4: packages is not taken: nothing is run or installed")
        yield _told(shown, "a keyboard", "user-data: not taken: keyboard (line 7)")
        yield Row(
            "console.shell = false", "a key" if "s shell" in shown else "no key", "no key", "s shell" not in shown
        )
        yield from _reachable(guest, key, "depot-3", "with Imager's settings")
        for what, command, goal in (
            ("Wi-Fi", "systemctl is-active wpa_supplicant@wlan0.service", "active"),
            ("country", "/usr/sbin/iw reg get | sed -n 's/^country \\(..\\).*/\\1/p' | head -n 1", "DE"),
            ("firstrun.sh", "test -e /data/firstrun && echo run || echo not run", "not run"),
        ):
            found = said(guest, key, command)
            yield Row(f"Imager: {what}", found[:40], goal, found == goal)


# -- what is used above


def _notes(guest: Guest) -> str:
    """All pages of the serial console. Its notes are complete once the station is there."""
    screen = Screen(guest)
    screen.wait(HEAD)
    shown = [screen.settle()]
    while (following := NEXT.search(shown[-1])) and following[1] != "1":
        screen.type("n")
        screen.wait(rf"page {following[1]}/")
        shown.append(screen.settle())
    return "\n".join(shown)


def _told(shown: str, what: str, words: str) -> Row:
    is_there = "".join(words.split()) in "".join(shown.split())
    return Row(what, words[:40] if is_there else "not on the serial console", "told", is_there)


def _run(script: str, folder: Path, home: Path, ports: Ports | None = None) -> "subprocess.CompletedProcess[str]":
    """A block of the page, in a shell with this project's commands; ssh finds the box by its name."""
    programs = home / "bin"
    programs.mkdir(exist_ok=True)
    if ports is not None:
        options = "StrictHostKeyChecking=no UserKnownHostsFile=/dev/null LogLevel=ERROR BatchMode=yes ConnectTimeout=60"
        words = [f"HostName=127.0.0.1 Port={ports.ssh} IdentityFile={home}/.ssh/id_ed25519", options]
        given = " ".join(f"-o {word}" for each in words for word in each.split())
        (programs / "ssh").write_text(f'#!/bin/sh\nexec /usr/bin/ssh {given} "$@"\n')
        (programs / "ssh").chmod(0o755)
    script = script.replace("~/", f"{home}/")
    path = f"{programs}:{PROJECT}/.venv/bin:{os.environ['PATH']}"
    environment: Mapping[str, str] = {**os.environ, "HOME": str(home), "PATH": path}
    return subprocess.run(
        ["bash", "-eu", "-c", script],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def _local(script: str, ports: Ports) -> str:
    return script.replace(f"{NAME}:5556", f"127.0.0.1:{ports.to_users}")


def _take(card: Path, *names: str) -> None:
    """Files away from the boot partition, where they are there."""
    words = ["mdel", "-i", f"{card}@@{partition_offset(card)}"]
    environment = {**os.environ, "MTOOLS_SKIP_CHECK": "1"}
    for name in names:
        subprocess.run([*words, f"::{name}"], env=environment, stderr=subprocess.DEVNULL, check=False)
