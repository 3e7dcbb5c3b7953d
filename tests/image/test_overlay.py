"""Overlay of Debian's userland: consistent with itself and the description."""

import configparser
import os
import re
import subprocess
import time
import tomllib
from pathlib import Path

import pytest

from firmware.config import captain_toml
from image.description import read
from image.filesystem.tree import Tree
from image.own_files import CARD, OVERLAY
from image.own_files import read as read_own
from image.parts import accounts, root
from pps.chrony import configuration

PROJECT = Path(__file__).resolve().parents[2]
OWN = read(PROJECT / "image/image.toml")
UNITS = OVERLAY / "usr/lib/systemd/system"
SCRIPTS = sorted([*(OVERLAY / "usr/lib/captain-image").iterdir(), PROJECT / "image/early/init"])
PASSWD = "root:x:0:0:root:/root:/bin/bash\n_chrony:x:100:102::/var/lib/chrony:/usr/sbin/nologin\n"
SHADOW = "root::20000:0:99999:7:::\n_chrony:!:20000::::::\n"
GROUP = "root:x:0:\nadm:x:4:\ndialout:x:20:\nsystemd-journal:x:999:\ni2c:x:103:\n"


def unit(name: str) -> configparser.RawConfigParser:
    found = configparser.RawConfigParser(strict=False, interpolation=None, delimiters="=")
    found.optionxform = str  # type: ignore[assignment, method-assign]
    found.read_string(read_own(f"usr/lib/systemd/system/{name}", CARD))
    return found


def debian() -> Tree:
    tree = Tree()
    for name, text in (
        ("passwd", PASSWD),
        ("shadow", SHADOW),
        ("group", GROUP),
        ("gshadow", GROUP.replace(":x:", "::")),
    ):
        tree.write(f"etc/{name}", re.sub(r":\d+:$", "::", text, flags=re.MULTILINE) if name == "gshadow" else text)
    return tree


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.name)
def test_a_script_has_no_mistake_that_a_shell_sees(path: Path):
    assert path.stat().st_mode & 0o111 == 0o111 or path.name == "init"
    assert subprocess.run(["sh", "-n", str(path)], capture_output=True, text=True, check=False).stderr == ""


def test_what_is_started_is_there_or_debians():
    ours = {name for units in root.WANTED.values() for name in units if name.startswith("captain")}
    assert ours <= {path.name for path in UNITS.iterdir()}
    assert not ours & set(root.MASKED)


def test_the_station_runs_as_its_own_user_with_two_capabilities_and_is_watched():
    service = unit("captain.service")["Service"]
    assert (service["User"], service["Type"]) == ("captain", "notify")
    # Raw frames; link, address and route of the 5G module.
    assert service["CapabilityBoundingSet"] == service["AmbientCapabilities"] == "CAP_NET_RAW CAP_NET_ADMIN"
    assert float(service["WatchdogSec"]) == 10
    assert service["ReadWritePaths"] == "/var/lib/captain /sys/devices"
    # libzmq dies of a refusal by signal; and of groups that are too wide.
    filters = re.findall(r"(?m)^SystemCallFilter=(.*)$", read_own("usr/lib/systemd/system/captain.service", CARD))
    assert filters == ["@system-service", "~@privileged", "adjtimex clock_adjtime"]
    groups = {group.name for group in accounts.GROUPS} | {"dialout"}
    assert set(service["SupplementaryGroups"].split()) <= groups


def test_the_limit_of_a_new_slot_waits_for_nothing_that_could_hang():
    limit = unit("captain-unproven.timer")["Unit"]
    assert limit["DefaultDependencies"] == unit("captain-unproven.service")["Unit"]["DefaultDependencies"] == "no"
    assert not {"After", "Requires", "Wants", "BindsTo"} & limit.keys()


def test_no_station_listens_where_the_firewall_has_failed():
    service = unit("captain.service")["Unit"]
    assert "nftables.service" in service["Requires"].split()
    assert "nftables.service" in service["After"].split()


def test_the_stations_own_configuration_is_one_it_takes():
    loaded = captain_toml.load(OVERLAY / "etc/captain/captain.toml", [], OWN.device_tree.board)
    assert loaded.tables.endpoint.address == "::"
    assert loaded.tables.time.chrony == configuration.SOCKET


def test_only_what_the_readme_lists_may_come_in():
    text = (OVERLAY / "etc/nftables.conf").read_text()
    assert "policy drop" in text.split("chain near")[0]
    near = text.split("chain near {")[1].split("}\n\n    chain")[0]
    assert set(re.findall(r"tcp dport (\S+) accept", near)) == {"22", "5555-5558"}
    assert set(re.findall(r"udp (?:sport \d+ udp )?dport (\d+) accept", near)) == {"5353", "68", "546"}
    # From the radio module replies, and a lease; from 5G replies.
    lease = ["meta nfproto ipv4 udp sport 67 udp dport 68"]
    assert re.findall(r'iifname \{ "usb\*", "enx\*" \} (.*) accept', text) == lease
    assert "wwan" not in text


def test_a_network_by_usb_is_never_the_cable_that_the_firewall_trusts():
    # net.ifnames=0: whoever comes first is eth0, and an address of the maker's own makes a USB network an eth as well.
    assert "net.ifnames=0" in OWN.kernel.command_line
    rules = (OVERLAY / "usr/lib/udev/rules.d/70-captain-net.rules").read_text().splitlines()
    lines = [line for line in rules if not line.startswith("#")]
    own = 'SUBSYSTEMS=="usb", DRIVERS=="smsc95xx|lan78xx", NAME="eth0", GOTO="captain_net_end"'
    assert lines.index(own) < lines.index('SUBSYSTEMS=="usb", NAME="usb%n"')
    assert 'DRIVERS=="bcmgenet", NAME="eth0"' in lines


def test_the_networks_speak_no_llmnr_and_only_near_ones_speak_mdns():
    for path in (OVERLAY / "usr/lib/systemd/network").iterdir():
        text = path.read_text()
        assert "LLMNR=no" in text
        is_near = any(f"Name={name}\n" in text for name in ("eth0", "wlan0"))
        assert f"MulticastDNS={'yes' if is_near else 'no'}" in text


def test_ssh_takes_a_key_and_nothing_else():
    text = (OVERLAY / "etc/ssh/sshd_config.d/captain.conf").read_text()
    for word in (
        "PasswordAuthentication no",
        "KbdInteractiveAuthentication no",
        "PermitRootLogin no",
        "AllowUsers operator",
    ):
        assert word in text


def test_the_boot_counters_are_looked_for_where_the_card_has_them():
    (text,) = (one.text for one in root.overlaid(OWN) if one.path == "etc/fw_env.config")
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    assert [line.split() for line in lines] == [
        ["/dev/disk/by-partuuid/43505401-05", "0x000000", "0x1000"],
        ["/dev/disk/by-partuuid/43505401-05", "0x400000", "0x1000"],
    ]


def test_every_word_of_the_overlay_gets_its_value():
    laid = list(root.overlaid(OWN))
    assert len(laid) > 3
    for one in laid:
        assert not re.search(r"@[A-Z_]{3,}@", one.text)


def test_users_have_fixed_numbers_and_nobody_has_a_password():
    tree = debian()
    accounts.add(tree)
    passwd = dict(line.split(":", 1) for line in tree.read("etc/passwd").decode().splitlines())
    assert passwd["captain"] == "x:560:560::/var/lib/captain:/usr/sbin/nologin"
    assert passwd["operator"] == "x:561:561::/home/operator:/bin/bash"
    assert {line.split(":")[1] for line in tree.read("etc/shadow").decode().splitlines()} == {"*"}
    groups = dict(line.split(":", 1) for line in tree.read("etc/group").decode().splitlines())
    assert groups["captain"] == "x:560:operator"
    assert groups["i2c"] == "x:103:operator"  # the number that Debian's package has chosen
    assert groups["gpio"] == "x:562:operator"
    assert groups["systemd-journal"] == "x:999:operator"
    assert groups["adm"] == "x:4:"  # its files are in /var/log, where there are none


def test_a_user_is_of_the_group_of_its_name_also_where_debian_has_one():
    tree = debian()
    tree.write("etc/group", tree.read("etc/group") + b"operator:x:37:\n")
    tree.write("etc/gshadow", tree.read("etc/gshadow") + b"operator:*::\n")
    accounts.add(tree)
    passwd = dict(line.split(":", 1) for line in tree.read("etc/passwd").decode().splitlines())
    assert passwd["operator"] == "x:561:37::/home/operator:/bin/bash"
    assert b"operator:x:37:\n" in tree.read("etc/group")


def test_no_number_is_given_twice():
    numbers = [user.number for user in accounts.USERS] + [group.number for group in accounts.GROUPS]
    assert len(set(numbers)) == len(numbers)


def script(name: str, folder: Path) -> "subprocess.CompletedProcess[str]":
    """One of the box's, with its data in a folder."""
    text = (OVERLAY / "usr/lib/captain-image" / name).read_text().replace("/data/", f"{folder}/")
    return subprocess.run(["sh", "-c", text], capture_output=True, text=True, check=False)


@pytest.mark.parametrize("lost", ["ssh_host_ed25519_key", "ssh_host_ed25519_key.pub"])
def test_a_key_that_a_power_cut_has_emptied_is_made_again(tmp_path: Path, lost: str):
    assert not any(name.startswith("Condition") for name in unit("captain-host-key.service")["Unit"])
    (tmp_path / "ssh").mkdir()
    for _ in range(2):
        assert script("host-key", tmp_path).returncode == 0
        (tmp_path / "ssh" / lost).write_bytes(b"")
    assert script("host-key", tmp_path).returncode == 0
    assert all(path.stat().st_size for path in (tmp_path / "ssh").iterdir())


def kept_s(folder: Path) -> float:
    assert script("keep-clock", folder).returncode == 0
    return (folder / "identity/clock").stat().st_mtime


def test_the_time_that_is_kept_is_never_set_back_by_a_clock_that_nobody_steers(tmp_path: Path):
    (tmp_path / "identity").mkdir()
    now_s = time.time()
    assert abs(kept_s(tmp_path) - now_s) < 100
    os.utime(tmp_path / "identity/clock", (now_s + 86_400, now_s + 86_400))
    assert kept_s(tmp_path) == pytest.approx(now_s + 86_400, abs=1)


@pytest.mark.parametrize(("drift_s", "is_set_back"), [(-600, True), (-86_400, False), (86_400, False)])
def test_a_date_that_was_wrong_is_kept_until_chrony_steers_the_clock(tmp_path: Path, drift_s: int, is_set_back: bool):
    now_s = time.time()
    for name, at_s in (("identity/clock", now_s + 1e9), ("chrony/chrony.drift", now_s + drift_s)):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).touch()
        os.utime(tmp_path / name, (at_s, at_s))
    assert (abs(kept_s(tmp_path) - now_s) < 100) == is_set_back


def test_the_early_boot_and_chrony_agree_where_the_drift_lies_and_which_journal_tells_the_time():
    drift = (OVERLAY / "usr/lib/captain-image/keep-clock").read_text().partition("drift=")[2].split()[0]
    assert "/data/chrony     /var/lib/chrony " in (OVERLAY / "etc/fstab").read_text()
    assert f"driftfile {{state}}/{Path(drift).name}" in Path(str(configuration.__file__)).read_text()
    # A closed journal of a date that was wrong stays for months.
    assert "$kept/journal/*/system.journal;" in (PROJECT / "image/early/init").read_text()


def test_the_description_installs_what_the_overlay_starts():
    installed = tomllib.loads((PROJECT / "image/image.toml").read_text())["packages"]["install"]
    assert {"chrony", "openssh-server", "nftables", "systemd-resolved", "rauc", "libubootenv-tool"} <= set(installed)
