"""Setup of a machine: what it lacks for a board, made."""

from pathlib import Path

import pytest

from board.runtime.errors import ConfigurationError, UsageError
from firmware.setup import setup
from firmware.setup.kept import Kept
from tests.firmware.setup.conftest import (
    CAPTAIN_TXT,
    CMDLINE,
    COMMAND_LINE,
    CONFIG,
    CONFIG_TXT,
    FILTERED,
    Machine,
    lines,
    make,
    mine,
    undo,
)  # fmt: skip


def test_setup_of_a_stock_pi_names_each_setting_with_its_file(machine: Machine):
    assert lines(machine) == [
        "/etc/default/captain: CAPTAIN_BOARD=pi",
        "/etc/group: captain in i2c",
        "/boot/firmware/captain.txt: dtoverlay=pps-gpio,gpiopin=18",
        "/boot/firmware/config.txt: include captain.txt",
    ]


@pytest.mark.parametrize("config", [CONFIG, FILTERED])
def test_setup_made_lacks_nothing_and_is_in_force_for_all_models(machine: Machine, config: str):
    machine.write(CONFIG_TXT, config)
    make(machine)
    assert lines(machine) == []
    assert machine.read(CONFIG_TXT) == f"{config}[all]\ninclude captain.txt\n"
    assert machine.read(CAPTAIN_TXT).splitlines()[1:] == ["dtoverlay=pps-gpio,gpiopin=18"]
    assert "\nCAPTAIN_BOARD=pi\n" in machine.read("etc/default/captain")
    assert machine.read(CMDLINE) == COMMAND_LINE


def test_overlays_of_a_raspberry_pi_5_have_other_names(machine: Machine):
    board = mine(machine, "/dev/ttyAMA2")
    own = [line.partition(": ")[2] for line in lines(machine, board, 5) if "captain.txt: " in line]
    assert own == [
        "dtoverlay=pps-gpio,gpiopin=17,capture_clear", "dtparam=i2c_arm=on", "dtoverlay=i2c3-pi5", "dtoverlay=uart2-pi5"
    ]  # fmt: skip
    own = [line.partition(": ")[2] for line in lines(machine, board, 4) if "captain.txt: " in line]
    assert own == [
        "dtoverlay=pps-gpio,gpiopin=17,capture_clear", "dtparam=i2c_arm=on", "dtoverlay=i2c3", "dtoverlay=uart2"
    ]  # fmt: skip


def test_line_that_config_txt_has_for_this_model_is_not_added(machine: Machine):
    board = mine(machine, "/dev/ttyAMA3")
    machine.write(CONFIG_TXT, f"{FILTERED}[all]\ndtoverlay=pps-gpio,gpiopin=17,capture_clear,pull=down\n")
    make(machine, board, 5)
    assert machine.read(CAPTAIN_TXT).splitlines()[1:] == ["dtparam=i2c_arm=on", "dtoverlay=i2c3-pi5"]


@pytest.mark.parametrize(
    ("line", "port", "pi", "is_same"),
    [
        ("dtoverlay=disable-bt", "/dev/ttyAMA0", 4, True),
        ("dtparam=uart0=on", "/dev/ttyAMA0", 5, True),
        ("dtparam=i2c1=on", "/dev/ttyUSB0", 4, True),
        ("dtoverlay=pps-gpio,pull=down", "", 4, True),
        ("dtparam=i2c_arm=on # a part of the value", "/dev/ttyUSB0", 4, False),
        ("#dtparam=i2c_arm=on", "/dev/ttyUSB0", 4, False),
        ("[cm4]\ndtparam=i2c_arm=on", "/dev/ttyUSB0", 4, False),
    ],
)
def test_line_of_config_txt_with_the_same_effect_is_not_added(
    machine: Machine, line: str, port: str, pi: int, is_same: bool
):
    board = mine(machine, port) if port else "pi"
    before = [one for one in lines(machine, board, pi) if "captain.txt: " in one]
    machine.write(CONFIG_TXT, f"{CONFIG}{line}\n")
    after = [one for one in lines(machine, board, pi) if "captain.txt: " in one]
    assert len(before) - len(after) == is_same


def test_line_below_the_filter_of_a_compute_module_counts_there(machine: Machine):
    machine.write(CONFIG_TXT, f"{CONFIG}[cm4]\ndtoverlay=pps-gpio\n")
    machine.write("proc/device-tree/model", "Raspberry Pi Compute Module 4 Rev 1.1\0")
    assert not any("captain.txt" in line for line in lines(machine))


def test_other_pulse_in_config_txt_is_refused_with_its_gpio(machine: Machine):
    machine.write(CONFIG_TXT, f"{CONFIG}dtoverlay=pps-gpio,gpiopin=4\n")
    with pytest.raises(UsageError, match="pps-gpio,gpiopin=4 has GPIO 4; the board needs") as error:
        lines(machine)
    assert error.value.hint == "change this line, or set pulse.gpio = 4 in a board file"


def test_gpio_that_two_devices_of_the_board_use_is_refused_with_both_keys(machine: Machine):
    with pytest.raises(ConfigurationError, match=r"buses\.second and interfaces\.gnss: both use GPIO 4"):
        lines(machine, mine(machine, "/dev/ttyAMA3"))


def test_console_stays_unless_a_module_uses_its_port(machine: Machine):
    make(machine, mine(machine, "/dev/ttyAMA5"))
    assert machine.read(CMDLINE) == COMMAND_LINE
    assert "dtoverlay=uart5" in machine.read(CAPTAIN_TXT)


@pytest.mark.parametrize(
    ("port", "pi", "units"),
    [
        ("/dev/serial0", 4, {"ttyS0", "ttyAMA0"}),
        ("/dev/ttyS0", 4, {"ttyS0"}),
        ("/dev/ttyAMA0", 4, {"ttyAMA0"}),
        ("/dev/ttyAMA10", 5, {"ttyAMA10"}),
        ("/dev/ttyAMA0", 5, set()),
    ],
)
def test_console_of_a_modules_port_is_freed(machine: Machine, port: str, pi: int, units: set[str]):
    make(machine, mine(machine, port), pi)
    made = {path.name for path in (machine.root / "etc").glob("systemd/system/serial-getty@*")}
    assert made == {f"serial-getty@{unit}.service" for unit in units}
    assert machine.read(CMDLINE) == (COMMAND_LINE.removeprefix("console=serial0,115200 ") if units else COMMAND_LINE)
    assert lines(machine, mine(machine, port), pi) == []


def test_login_that_is_enabled_on_a_modules_port_is_masked_and_returns(machine: Machine):
    machine.write(CMDLINE, "console=tty1 rootwait\n")
    link = machine.root / "etc/systemd/system/getty.target.wants/serial-getty@ttyS0.service"
    link.parent.mkdir(parents=True)
    link.symlink_to("/usr/lib/systemd/system/serial-getty@.service")
    board = mine(machine, "/dev/ttyS0")
    before = machine.state()
    make(machine, board)
    assert (machine.root / "etc/systemd/system/serial-getty@ttyS0.service").read_bytes() == b""
    assert lines(machine, board) == []
    undo(machine)
    assert machine.state() == before


def test_firewall_names_open_ports_that_it_closes(machine: Machine):
    # ssh, a web server and a printer server of this machine only; an NTP server
    rows = ["00000000:0016 00000000:0000 0A", "00000000:0050 00000000:0000 0A", "0100007F:0277 00000000:0000 0A"]
    machine.write("proc/net/tcp", "head\n" + "".join(f"  {at}: {row} 0\n" for at, row in enumerate(rows)))
    machine.write("proc/net/udp6", f"head\n  0: {'0' * 32}:007B {'0' * 32}:0000 07 0\n")
    parts = setup.parts(Kept(machine.root, machine.run), "none", 4, has_firewall=True)
    assert [one.reason for one in setup.lacking(parts) if "nftables" in one.file] == [
        "on eth0 and wlan0, closes tcp/80 udp/123; on other networks, all ports; forwards no packets"
    ]


def test_firewall_that_was_enabled_is_loaded_again_with_the_owners_rules(machine: Machine):
    (machine.root / "run/systemd/system").mkdir(parents=True)
    link = machine.root / "etc/systemd/system/sysinit.target.wants/nftables.service"
    link.parent.mkdir(parents=True)
    link.symlink_to("/usr/lib/systemd/system/nftables.service")
    make(machine, has_firewall=True)
    machine.said.clear()
    undo(machine)
    assert machine.said[:2] == ["systemctl daemon-reload", "systemctl restart nftables.service"]
    assert link.is_symlink()


ROUTES = """Iface Destination Gateway Flags RefCnt Use Metric Mask MTU Window IRTT
{default} 00000000 0101A8C0 0003 0 0 100 00000000 0 0 0
eth0 0001A8C0 00000000 0001 0 0 100 00FFFFFF 0 0 0
wg0 0000000A 00000000 0001 0 0 0 000000FF 0 0 0
"""
# Local and remote address of a connection: 192.168.1.2 with 192.168.1.3, or with 10.0.0.3; fe80::2 with fe80::3.
NEAR_SSH, FAR_SSH = "0201A8C0:0016 0301A8C0:D000 01", "0200000A:0016 0300000A:D000 01"
IPV6_SSH = "000080FE000000000000000002000000:0016 000080FE000000000000000003000000:D000 01"


@pytest.mark.parametrize(
    ("default", "session", "refused"),
    [
        ("eth0", "", ""),
        ("end0", "", "end0"),
        ("wwan0", "", ""),
        ("end0", NEAR_SSH, ""),
        ("eth0", FAR_SSH, "wg0"),
        ("eth0", IPV6_SSH, "enx1"),
    ],
)
def test_firewall_that_would_close_ssh_is_refused(machine: Machine, default: str, session: str, refused: str):
    machine.write("proc/net/route", ROUTES.format(default=default))
    machine.write("proc/net/if_inet6", "fe800000000000000000000000000002 02 40 20 80 enx1\n")
    machine.write(
        f"proc/net/tcp{'6' if session == IPV6_SSH else ''}", f"head\n 0: {session} 0\n" if session else "head\n"
    )
    if not refused:
        make(machine, has_firewall=True)
        return
    with pytest.raises(UsageError, match=f"--firewall: closes ssh on {refused}: permits eth0, wlan0 only"):
        lines(machine, has_firewall=True)


def test_firewall_without_nftables_is_refused(machine: Machine):
    (machine.root / "usr/sbin/nft").unlink()
    with pytest.raises(UsageError, match="nftables is not installed"):
        lines(machine, has_firewall=True)


def test_machine_that_is_no_pi_gets_groups_and_board_only(machine: Machine):
    assert lines(machine, "quad", 0) == ["/etc/default/captain: CAPTAIN_BOARD=quad", "/etc/group: captain in i2c"]


def test_pi_without_config_txt_is_refused(machine: Machine):
    (machine.root / CONFIG_TXT).unlink()
    with pytest.raises(UsageError, match=r"has no config\.txt"):
        lines(machine)


def test_card_of_a_box_and_a_machine_without_captain_box_are_refused(machine: Machine):
    setup.check(machine.root)
    assert setup.is_for(machine.root)
    (machine.root / "run/captain-image").mkdir(parents=True)
    with pytest.raises(UsageError, match="this is the card of a box"):
        setup.check(machine.root)
    (machine.root / "run/captain-image").rmdir()
    (machine.root / "usr/share/captain/nftables.conf").unlink()
    with pytest.raises(UsageError, match="captain-box is not installed"):
        setup.check(machine.root)
    assert not setup.is_for(machine.root)


def test_boot_partition_that_is_read_only_is_refused(machine: Machine, monkeypatch: pytest.MonkeyPatch):
    setup.check_writable(machine.root)
    monkeypatch.setattr("os.access", lambda path, mode: False)
    with pytest.raises(UsageError, match="/boot/firmware: is read-only"):
        setup.check_writable(machine.root)


def test_user_without_rights_is_refused(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("os.geteuid", lambda: 1000)
    with pytest.raises(UsageError, match="only root may change settings"):
        setup.check_writable(Path("/"))


@pytest.mark.parametrize(
    ("wanted", "board"), [(None, "none"), ("quad", "quad"), ("/etc/captain/mine.toml", "/etc/captain/mine.toml")]
)
def test_board_is_that_of_the_service_or_the_named_one(machine: Machine, wanted: str | None, board: str):
    assert setup.board_name(Kept(machine.root), wanted) == board


def test_board_file_that_the_service_may_not_read_is_refused(machine: Machine):
    for folder in ("/home/me", "/tmp", "/var/tmp"):
        with pytest.raises(UsageError, match="the service may not read this folder"):
            setup.board_name(Kept(machine.root), f"{folder}/mine.toml")
