"""Debian package captain-box: its drop-ins, and its groups in a root of its own."""

import re
import tomllib
from pathlib import Path, PurePosixPath

import pytest

from image import own_files
from image.program import box, deb
from image.project import PROJECT
from image.tool import run
from pps.chrony import configuration
from tests.image.program.conftest import dpkg

FILES = box.files()
RULES = "usr/lib/udev/rules.d/70-captain.rules"
# Folders that systemd, udev and chrony read beside the files of a stock Debian.
DROP_INS = {
    "etc/chrony/conf.d", "usr/lib/modules-load.d", "usr/lib/sysctl.d", "usr/lib/systemd/network",
    "usr/lib/systemd/system/chrony.service.d", "usr/lib/udev/rules.d",
}  # fmt: skip
OWN = {"usr/share/captain", "usr/share/doc/captain-box"}
NAME = re.compile(r"([0-9]+-)?captain(-\w+)?\.(conf|rules|network)")


@pytest.fixture(scope="module")
def boxed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("boxed") / "captain-box.deb"
    box.make("1.2.3", 1_750_000_000, target)
    return target


def test_package_with_equal_sources_has_equal_octets(boxed: Path, tmp_path: Path):
    box.make("1.2.3", 1_750_000_000, tmp_path / "again.deb")
    assert (tmp_path / "again.deb").read_bytes() == boxed.read_bytes()


def test_package_needs_the_station_and_fits_every_processor(boxed: Path):
    said = run(["dpkg-deb", "--field", boxed])
    assert "Package: captain-box\nVersion: 1.2.3\nArchitecture: all\n" in said
    assert "Depends: captain (>= 1.2.3), passwd, udev\nRecommends: chrony\n" in said


def test_file_is_a_drop_in_with_our_name_or_lies_in_our_folders():
    for path in map(PurePosixPath, FILES):
        folder = path.parent.as_posix()
        assert folder in OWN or (folder in DROP_INS and NAME.fullmatch(path.name)), path


def test_firewall_and_console_of_the_card_are_shipped_and_not_in_force():
    assert FILES["usr/share/captain/nftables.conf"] == own_files.read("etc/nftables.conf", own_files.CARD)
    assert not {"etc/nftables.conf", "etc/systemd/system/serial-getty@.service.d/captain.conf"} & FILES.keys()
    console = FILES["usr/share/captain/serial-console.conf"]
    assert "User=captain\nExecStart=\nExecStart=-/usr/bin/captain console --stay\n" in console
    assert "shell" not in console.partition("[Unit]")[2].lower()


def test_cable_and_wifi_are_in_no_file_that_is_in_force():
    for path, text in FILES.items():
        if not path.startswith("usr/share/"):
            assert not re.search("eth0|wlan0|operator|/data|captain-image|@[A-Z_]{3,}@", text), path


def test_networks_are_those_of_the_modules_and_after_files_of_the_owner():
    matches = {
        PurePosixPath(path).name: re.findall(r"(?s)\[Match\]\n(.*?)\n\n", text)
        for path, text in FILES.items()
        if path.endswith(".network")
    }
    assert matches == {
        "90-captain-radio.network": ["Property=CAPTAIN_NETWORK=radio"],
        "90-captain-wwan.network": ["Property=CAPTAIN_NETWORK=cellular"],
    }


def test_network_manager_ignores_networks_in_the_radios_slot_and_of_the_modem_only():
    rules = [row for row in FILES[RULES].splitlines() if row.startswith('SUBSYSTEM=="net"') and "NETWORK" in row]
    board = tomllib.loads((PROJECT / "board/boards/quad.toml").read_text())["slots"]
    (vendor,) = {usb_id.partition(":")[0] for usb_id in board["cellular"]["ids"]}
    assert f'KERNELS=="{board["v2x"]["usb"]}:*", DRIVERS=="rndis_host|cdc_ncm|cdc_ether|cdc_eem"' in rules[0]
    assert f'ATTRS{{idVendor}}=="{vendor}"' in rules[1]
    for rule, network in zip(rules, ("radio", "cellular"), strict=True):
        assert rule.endswith(f'ENV{{CAPTAIN_NETWORK}}="{network}", ENV{{NM_UNMANAGED}}="1"')
    assert "".join(FILES.values()).count("NM_UNMANAGED") == 2


def test_chronyd_takes_pulses_of_the_stations_group_and_starts_without_them():
    assert FILES["etc/chrony/conf.d/captain.conf"] == configuration.refclock()
    rows = FILES["usr/lib/systemd/system/chrony.service.d/captain.conf"].splitlines()
    assert f"ExecStartPost=-+/bin/chgrp captain {configuration.SOCKET}" in rows
    assert all(row.startswith("ExecStartPost=-+") for row in rows if "=" in row)


def test_settings_of_the_kernel_are_buffers_of_sockets_alone():
    rows = [row for row in FILES["usr/lib/sysctl.d/70-captain.conf"].splitlines() if not row.startswith("#")]
    assert [row.partition(" ")[0] for row in rows] == ["net.core.rmem_max", "net.core.wmem_max"]


def test_modules_are_those_that_the_station_opens_devices_of():
    rows = FILES["usr/lib/modules-load.d/captain.conf"].splitlines()
    modules = {row for row in rows if not row.startswith("#")}
    assert modules == {"i2c-dev", "usbserial", "cdc-acm", "cdc-wdm"}
    wanted = own_files.read("usr/lib/systemd/system/captain.service", own_files.PACKAGE)
    assert set(re.findall(r"modprobe@(\w+)\.service", wanted)) == {name.replace("-", "_") for name in modules}


def test_groups_of_the_rules_are_those_that_the_package_makes():
    groups = set(re.findall(r'GROUP="(\w+)"', "".join(FILES.values())))
    (line,) = re.findall("for group in (.*); do", (box.SCRIPTS / "postinst").read_text())
    assert groups == set(line.split())


def test_installed_the_stations_user_has_the_devices_groups(made: Path, boxed: Path, root: Path):
    dpkg(root, "--install", made, boxed)
    assert dpkg(root, "--verify", "captain", "captain-box") == ""
    rows = [line.split(":") for line in (root / "etc/group").read_text().splitlines()]
    assert {row[0]: row[3] for row in rows} == {
        "dialout": "captain", "i2c": "captain", "gpio": "captain", "pps": "captain", "captain": ""
    }  # fmt: skip


def test_purged_a_group_of_the_machine_stays_and_those_of_the_package_go(made: Path, boxed: Path, root: Path):
    dpkg(root, "--install", made)
    before = (root / "etc/group").read_text()
    dpkg(root, "--install", boxed)
    dpkg(root, "--install", boxed)  # as an upgrade does
    dpkg(root, "--purge", "captain-box")
    assert (root / "etc/group").read_text() == before
    for folder in ("etc/chrony", "usr/share/captain", "var/lib/captain-box"):
        assert not (root / folder).exists()


def test_purge_keeps_a_created_group_that_others_use_and_says_so(made: Path, boxed: Path, root: Path):
    dpkg(root, "--install", made, boxed)
    groups = root / "etc/group"
    groups.write_text(re.sub("(?m)^(gpio:.*:)captain$", r"\1captain,alice", groups.read_text()))
    rules = root / "etc/udev/rules.d/90-own.rules"
    rules.parent.mkdir(parents=True)
    record = root / "var/lib/captain-box/setup.json"  # of settings that were not reverted
    record.write_text("{}")
    rules.write_text('KERNEL=="pps0", GROUP="pps"\nSUBSYSTEM=="i2c", GROUP="dialout"\n')
    said = dpkg(root, "--purge", "captain-box")
    assert "captain-box: group gpio stays" in said
    assert "captain-box: group pps stays" in said
    assert [path.name for path in record.parent.iterdir()] == ["setup.json"]
    assert {line.split(":")[0] for line in groups.read_text().splitlines()} >= {"gpio", "pps"}


def test_change_of_the_owner_outlives_an_upgrade(made: Path, boxed: Path, root: Path, tmp_path: Path):
    dpkg(root, "--install", made, boxed)
    own = root / "etc/chrony/conf.d/captain.conf"
    own.write_text("# mine\n")
    box.make("1.3.0", 1_750_000_000, tmp_path / "new.deb")
    dpkg(root, "--install", tmp_path / "new.deb")
    assert own.read_text() == "# mine\n"


def test_scripts_and_the_owners_file_are_named(boxed: Path, tmp_path: Path):
    run(["dpkg-deb", "--control", boxed, tmp_path])
    assert {path.name for path in tmp_path.iterdir()} == {
        "control",
        "conffiles",
        "md5sums",
        "postinst",
        "prerm",
        "postrm",
    }
    assert (tmp_path / "conffiles").read_text() == "/etc/chrony/conf.d/captain.conf\n"
    assert (deb.FILES / "box").is_dir()
