"""Setup of a machine: what it lacks for a board, made and reverted."""

from pathlib import Path

import pytest

from board.runtime.errors import StorageError, UsageError
from firmware.setup import setup
from firmware.setup.kept import RECORD, Kept
from tests.firmware.setup.conftest import COMMAND_LINE, CONFIG, Machine

# A receiver at the header's first UART, a sensor at a second I2C bus.
MINE = """
name = "mine"
[buses.main]
path = "/dev/i2c-1"
[buses.second]
path = "/dev/i2c-3"
[pulse]
device = "/dev/pps0"
gpio = 4
edge = "falling"
[interfaces.gnss]
driver = "zed_f9p"
port = "{port}"
"""
CAPTAIN_TXT, CONFIG_TXT, CMDLINE = (f"boot/firmware/{name}.txt" for name in ("captain", "config", "cmdline"))


def mine(machine: Machine, port: str = "/dev/serial0") -> str:
    return str(machine.write("etc/captain/mine.toml", MINE.format(port=port)))


def lines(machine: Machine, board: str = "pi", pi: int = 4, has_firewall: bool = False) -> list[str]:
    parts = setup.parts(Kept(machine.root, machine.run), board, pi, has_firewall)
    return [f"{one.file}: {one.line}" for one in setup.lacking(parts)]


def make(machine: Machine, board: str = "pi", pi: int = 4, has_firewall: bool = False) -> None:
    kept = Kept(machine.root, machine.run)
    for part in setup.parts(kept, board, pi, has_firewall):
        if part.lacking():
            part.make(kept)


def undo(machine: Machine) -> list[str]:
    return list(Kept(machine.root, machine.run).undo())


def test_setup_of_a_stock_pi_names_each_setting_with_its_file(machine: Machine):
    assert lines(machine) == [
        "/etc/default/captain: CAPTAIN_BOARD=pi",
        "/etc/group: captain in i2c",
        "/boot/firmware/captain.txt: dtoverlay=pps-gpio,gpiopin=18",
        "/boot/firmware/config.txt: include captain.txt",
    ]


def test_setup_made_lacks_nothing_and_is_in_force_for_all_models(machine: Machine):
    make(machine)
    assert lines(machine) == []
    assert machine.read(CONFIG_TXT) == f"{CONFIG}[all]\ninclude captain.txt\n"
    assert machine.read(CAPTAIN_TXT).splitlines()[1:] == ["dtoverlay=pps-gpio,gpiopin=18"]
    assert "\nCAPTAIN_BOARD=pi\n" in machine.read("etc/default/captain")
    assert machine.read(CMDLINE) == COMMAND_LINE


@pytest.mark.parametrize("board", ["pi", "quad", "mine"])
@pytest.mark.parametrize("has_firewall", [False, True])
def test_undo_restores_every_octet(machine: Machine, board: str, has_firewall: bool):
    board = mine(machine) if board == "mine" else board
    before = machine.state()
    make(machine, board, has_firewall=has_firewall)
    assert machine.state() != before
    undo(machine)
    assert machine.state() == before
    assert not (machine.root / RECORD).parent.exists()
    assert undo(machine) == []


def test_setup_made_twice_changes_nothing_the_second_time(machine: Machine):
    before = machine.state()
    make(machine)
    made = machine.state()
    make(machine)
    assert machine.state() == made
    undo(machine)
    assert machine.state() == before


def test_setup_for_another_board_replaces_the_lines_of_the_first(machine: Machine):
    make(machine, mine(machine))
    before = {name: octets for name, octets in machine.state().items() if name != "etc/captain/mine.toml"}
    make(machine, "pi")
    assert lines(machine, "pi") == []
    assert machine.read(CAPTAIN_TXT).splitlines()[1:] == ["dtoverlay=pps-gpio,gpiopin=18"]
    undo(machine)
    assert machine.read(CONFIG_TXT) == CONFIG
    assert machine.read(CMDLINE) == COMMAND_LINE
    assert set(before) - set(machine.state()) >= {CAPTAIN_TXT, RECORD}


def test_overlays_of_a_raspberry_pi_5_have_other_names(machine: Machine):
    board = mine(machine, "/dev/ttyAMA2")
    own = [line.partition(": ")[2] for line in lines(machine, board, 5) if "captain.txt: " in line]
    assert own == [
        "dtoverlay=pps-gpio,gpiopin=4,capture_clear", "dtparam=i2c_arm=on", "dtoverlay=i2c3-pi5", "dtoverlay=uart2-pi5"
    ]  # fmt: skip
    own = [line.partition(": ")[2] for line in lines(machine, board, 4) if "captain.txt: " in line]
    assert own == [
        "dtoverlay=pps-gpio,gpiopin=4,capture_clear", "dtparam=i2c_arm=on", "dtoverlay=i2c3", "dtoverlay=uart2"
    ]  # fmt: skip


def test_line_that_config_txt_has_for_this_model_is_not_added(machine: Machine):
    board = mine(machine, "/dev/ttyAMA3")
    machine.write(CONFIG_TXT, f"{CONFIG}[all]\ndtoverlay=pps-gpio,gpiopin=4,capture_clear,pull=down # mine\n")
    make(machine, board, 5)
    assert machine.read(CAPTAIN_TXT).splitlines()[1:] == ["dtparam=i2c_arm=on", "dtoverlay=i2c3-pi5"]


def test_console_stays_unless_a_module_uses_its_port(machine: Machine):
    make(machine, mine(machine, "/dev/ttyAMA3"))
    assert machine.read(CMDLINE) == COMMAND_LINE
    assert "dtoverlay=uart3" in machine.read(CAPTAIN_TXT)


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


def test_undo_keeps_what_the_owner_has_changed_since(machine: Machine):
    make(machine, mine(machine))
    config = machine.write(CONFIG_TXT, machine.read(CONFIG_TXT).replace("audio=on", "audio=off") + "gpu_mem=16\n")
    machine.write(CMDLINE, machine.read(CMDLINE).replace("rootwait", "rootwait quiet"))
    machine.write("etc/default/captain", machine.read("etc/default/captain").replace("OPTIONS=", "OPTIONS=--journal"))
    said = undo(machine)
    assert config.read_text() == CONFIG.replace("audio=on", "audio=off") + "gpu_mem=16\n"
    assert machine.read(CMDLINE) == COMMAND_LINE.replace("rootwait", "rootwait quiet")
    assert machine.read("etc/default/captain").endswith("CAPTAIN_BOARD=none\nCAPTAIN_OPTIONS=--journal\n")
    for name in ("boot/firmware/config.txt", "boot/firmware/cmdline.txt", "etc/default/captain"):
        assert f"/{name}: changed since the setup: only its own lines are removed" in said


def test_undo_after_a_change_between_two_setups_keeps_that_change(machine: Machine):
    make(machine, "pi")
    machine.write("etc/default/captain", machine.read("etc/default/captain") + "# mine\n")
    make(machine, "quad")
    undo(machine)
    assert machine.read("etc/default/captain").endswith("CAPTAIN_BOARD=none\nCAPTAIN_OPTIONS=\n# mine\n")


def test_undo_after_a_file_was_removed_between_two_setups_removes_it_again(machine: Machine):
    make(machine, "pi")
    (machine.root / "etc/default/captain").unlink()
    make(machine, "quad")
    undo(machine)
    assert not (machine.root / "etc/default/captain").exists()


def test_undo_keeps_own_lines_of_the_owner_in_captain_txt(machine: Machine):
    make(machine)
    machine.write(CAPTAIN_TXT, machine.read(CAPTAIN_TXT) + "gpu_mem=16\n")
    undo(machine)
    assert machine.read(CAPTAIN_TXT) == "gpu_mem=16\n"
    assert machine.read(CONFIG_TXT) == CONFIG


def test_undo_after_all_files_are_gone_makes_none(machine: Machine):
    make(machine)
    for name in (CONFIG_TXT, CAPTAIN_TXT, "etc/default/captain"):
        (machine.root / name).unlink()
    undo(machine)
    assert not (machine.root / CONFIG_TXT).exists()
    assert not (machine.root / RECORD).exists()


def test_files_without_an_end_of_line_or_missing_are_restored(machine: Machine):
    machine.write(CONFIG_TXT, "dtparam=audio=on")
    machine.write(CMDLINE, "root=/dev/mmcblk0p2 console=serial0,115200")
    (machine.root / "etc/default/captain").unlink()
    before = machine.state()
    board = mine(machine)
    make(machine, board)
    assert lines(machine, board) == []
    assert machine.read(CONFIG_TXT) == "dtparam=audio=on\n[all]\ninclude captain.txt\n"
    assert machine.read(CMDLINE) == "root=/dev/mmcblk0p2"
    undo(machine)
    (machine.root / "etc/captain/mine.toml").unlink()
    assert machine.state() == before


def test_setup_that_breaks_off_is_reverted_by_undo(machine: Machine):
    before = machine.state()
    machine.fails = "usermod"
    with pytest.raises(Exception, match="usermod"):
        make(machine)
    machine.fails = ""
    machine.said.clear()
    undo(machine)
    assert machine.state() == before
    assert machine.said == []


def test_undo_of_a_group_that_is_gone_says_so_and_reverts_the_rest(machine: Machine):
    make(machine)
    machine.fails = "gpasswd"
    assert any(line.startswith("failed: gpasswd --delete captain i2c") for line in undo(machine))
    assert machine.read(CONFIG_TXT) == CONFIG
    assert not (machine.root / RECORD).exists()


def test_record_that_is_damaged_is_an_error_with_its_path(machine: Machine):
    machine.write(RECORD, "{")
    with pytest.raises(StorageError, match=r"setup\.json: is not a record of a setup"):
        Kept(machine.root)


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


def test_firewall_without_nftables_is_refused(machine: Machine):
    (machine.root / "usr/sbin/nft").unlink()
    with pytest.raises(UsageError, match="nftables is not installed"):
        lines(machine, has_firewall=True)


def test_machine_that_is_no_pi_gets_groups_and_board_only(machine: Machine):
    assert lines(machine, "quad", 0) == ["/etc/default/captain: CAPTAIN_BOARD=quad", "/etc/group: captain in i2c"]


def test_config_txt_is_that_of_the_older_place_where_only_that_exists(machine: Machine):
    (machine.root / CONFIG_TXT).unlink()
    machine.write("boot/config.txt", CONFIG)
    assert lines(machine)[-1] == "/boot/config.txt: include captain.txt"


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
    with pytest.raises(UsageError, match="the service may not read this folder"):
        setup.board_name(Kept(machine.root), "/home/me/mine.toml")
