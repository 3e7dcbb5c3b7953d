"""Screens of update, box, run, ros2 and extcap: done, and what is wrong with its remedy as the last lines."""

import json
import logging
from pathlib import Path

import pytest

from firmware.commands import box, ros2
from firmware.setup.kept import Kept
from tests.firmware.card.conftest import write
from tests.firmware.card.test_command import BAD, GOOD
from tests.firmware.commands.test_ros2 import WHOLE, without
from tests.firmware.setup.conftest import Machine
from tests.firmware.update.conftest import bundle, service
from tests.firmware.update.rauc_service import BROKEN, Service
from tests.screens.terminal import Terminal, compare

__all__ = ["bundle", "service"]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Working folder, so that paths are short."""
    monkeypatch.chdir(tmp_path)


def test_both_slots_and_the_last_update_are_on_one_screen(service: Service, terminal: Terminal) -> None:
    last = {"time": 1_795_182_426.0, "source": "https://example.org/captain-1.2.3-arm64.raucb", "version": "1.2.3"}
    Path("update/last.json").write_text(json.dumps(last | {"slot": "B", "result": "installed"}))
    terminal.run("update", "--status")
    compare("update-status", terminal.lines())


def test_an_update_ends_with_the_next_step(service: Service, bundle: str, terminal: Terminal) -> None:
    terminal.run("update", Path(bundle).name)
    compare("update", terminal.lines())


def test_update_that_breaks_ends_with_the_state_of_both_slots(
    service: Service, bundle: str, terminal: Terminal
) -> None:
    service.installs(BROKEN, 1)
    terminal.run("update", Path(bundle).name)
    compare("update-broken", terminal.lines())


def test_update_without_a_bundle_ends_with_the_error(service: Service, terminal: Terminal) -> None:
    terminal.run("update", "--status", "--restart")
    compare("update-wrong", terminal.lines())


@pytest.mark.parametrize(("name", "files"), [("box", GOOD), ("box-bad", BAD)])
def test_check_of_a_card_ends_with_the_verdict(name: str, files: dict[str, str | bytes], terminal: Terminal) -> None:
    Path("card").mkdir()
    write(Path("card"), files)
    terminal.run("box", "check", "card", "--board", "none")
    compare(name, terminal.lines())


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("box-setup", ()),
        ("box-setup-firewall", ("--firewall",)),
        ("box-setup-write", ("--write",)),
        ("box-undo", ("--undo",)),
    ],
)
def test_setup_of_a_pi_ends_with_the_next_step(
    name: str, options: tuple[str, ...], terminal: Terminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine = Machine(Path("root").absolute())
    monkeypatch.setattr(box, "ROOT", machine.root)
    monkeypatch.setattr(box, "Kept", lambda root: Kept(root, machine.run))
    if name == "box-undo":
        Terminal().run("box", "setup", "--board", "pi", "--write")
        machine.write("boot/firmware/config.txt", f"{machine.read('boot/firmware/config.txt')}gpu_mem=16\n")
    terminal.run("box", "setup", *(() if name == "box-undo" else ("--board", "pi")), *options)
    compare(name, terminal.lines())


def test_setup_without_captain_box_ends_with_the_remedy(terminal: Terminal, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(box, "ROOT", Path.cwd())
    terminal.run("box", "setup")
    compare("box-setup-bad", terminal.lines())


def test_a_station_with_mistakes_in_its_configuration_ends_with_them(
    terminal: Terminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(logging.root, "handlers", [])
    Path("captain.toml").write_text('[statoin]\nname = "rsu-7"\n[endpoint]\nto_users = "5556"\npull = 70000\n')
    terminal.run("run", "--config", "captain.toml", "--board", "none")
    compare("run-bad", terminal.lines())


@pytest.mark.parametrize(("name", "found"), [("ros2", WHOLE), ("ros2-lacks", without("zmq", "captain_messages"))])
def test_check_for_ros_ends_with_what_is_missing(
    name: str, found: dict[str, str], terminal: Terminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ros2, "probe", lambda environment: found)
    terminal.run("ros2", "--check")
    compare(name, terminal.lines())


def test_installation_for_wireshark_ends_with_the_next_step(terminal: Terminal) -> None:
    terminal.run("extcap", "--install", "extcap")
    compare("extcap", terminal.lines())
