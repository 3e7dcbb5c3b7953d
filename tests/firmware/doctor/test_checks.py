"""Checks of a station's machine, one at a time: ports, interfaces, clock, versions, library."""

import socket

import pytest

from board.runtime.errors import InterfaceError
from drivers.sim.options import NeighboursOptions
from drivers.sim8202g.driver import ModemOptions
from drivers.udp.driver import UdpOptions
from firmware.codec import library
from firmware.config import board_file
from firmware.config.board_file import Board
from firmware.config.captain_toml import InterfaceConfig
from firmware.config.tables import EndpointOptions, QueueOptions
from firmware.doctor import checks
from firmware.doctor.finding import Finding, Level
from tests.firmware.commands.fake import STATUS
from tests.said import tells

MAC = bytes.fromhex("02000000000b")


def udp(listen: str) -> InterfaceConfig:
    return InterfaceConfig("g5", QueueOptions("udp"), UdpOptions(listen=listen, beacon_s=0.0))


def only(found: object) -> Finding:
    (finding,) = found
    return finding


def endpoint_of(block: int, **more: object) -> EndpointOptions:
    return EndpointOptions(from_users=block, to_users=block + 1, pull=block + 2, report=block + 3, **more)


def test_free_ports_are_fine(block):
    assert only(checks.endpoint(endpoint_of(block), None)).level is Level.OK


def test_port_of_another_program_is_a_problem_with_the_option_to_set(block):
    with socket.create_server(("127.0.0.1", block + 2)):
        found = only(checks.endpoint(endpoint_of(block), None))
    assert found.level is Level.PROBLEM
    assert tells(found.text, f" {block + 2} of 127.0.0.1 ", "taken")
    assert "endpoint.pull" in found.remedy


def test_ports_of_a_running_station_are_a_warning_with_its_name(block):
    with socket.create_server(("127.0.0.1", block)):
        found = only(checks.endpoint(endpoint_of(block), STATUS))
    assert found.level is Level.WARNING
    assert "belong to station 'fake', pid 4711" in found.text


def test_an_address_of_another_machine_is_a_problem(block):
    found = only(checks.endpoint(endpoint_of(block, address="192.0.2.1"), None))
    assert found.level is Level.PROBLEM
    assert "endpoint.address" in found.remedy


def test_an_interface_that_can_start_says_what_it_would_do():
    found = only(checks.interface(udp("127.0.0.1:0"), MAC, None))
    assert found.level is Level.OK
    assert found.text.startswith("udp: listens at 127.0.0.1:")


def test_an_interface_whose_address_is_taken_is_a_problem_with_a_remedy():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        found = only(checks.interface(udp(address), MAC, None))
    assert found.level is Level.PROBLEM
    assert found.remedy


def test_a_trial_leaves_nothing_open():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{probe.getsockname()[1]}"
    for _ in range(2):
        assert only(checks.interface(udp(address), MAC, None)).level is Level.OK


def test_interface_of_a_running_station_is_reported_by_its_status():
    found = only(checks.interface(udp("192.0.2.1:1"), MAC, STATUS))
    assert found.level is Level.OK
    assert tells(found.text, "udp: up ", "running station", "127.0.0.1:8947")


def test_interface_whose_address_another_configuration_may_hold_is_not_checked():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        found = only(checks.interface(udp(address), MAC, None, is_beside=True))
    assert found.level is Level.WARNING
    assert tells(found.text, "udp: ", "not checked", "another configuration")
    assert found.remedy == "restart it"


def test_interface_that_waits_in_the_running_station_is_a_problem():
    told = {"interfaces": {"g5": {"driver": "udp", "state": "waiting", "why": "address is gone"}}}
    found = only(checks.interface(udp("127.0.0.1:0"), MAC, told))
    assert found.level is Level.PROBLEM
    assert tells(found.text, "udp: waiting ", "running station", ": address is gone")
    assert "captain status" in found.remedy


def test_what_the_running_station_cannot_start_is_a_problem_with_its_remedy():
    told = {"interfaces": {"g5": {"driver": "udp", "state": "waiting", "why": "no /dev/x", "hint": "plug it in"}}}
    found = only(checks.interface(udp("127.0.0.1:0"), MAC, told))
    assert (found.level, found.remedy) == (Level.PROBLEM, "plug it in")


@pytest.mark.parametrize(
    ("utc_s", "level"), [(1795182426.0, Level.OK), (0.0, Level.PROBLEM), (1e9, Level.PROBLEM), (5e9, Level.PROBLEM)]
)
def test_a_clock_that_was_never_set_is_a_problem(utc_s, level):
    assert only(checks.clock(utc_s, is_monotonic=True)).level is level


def test_a_clock_that_goes_back_is_a_problem():
    assert [one.level for one in checks.clock(1795182426.0, is_monotonic=False)] == [Level.OK, Level.PROBLEM]


@pytest.mark.parametrize(
    ("most", "level"), [("212992\n", Level.WARNING), ("4194304\n", Level.OK), ("x", Level.WARNING)]
)
def test_a_small_receive_buffer_is_a_warning_with_the_number_to_set(tmp_path, most, level):
    (tmp_path / "rmem_max").write_text(most)
    found = only(checks.receive_buffer([udp("127.0.0.1:0")], tmp_path / "rmem_max"))
    assert found.level is level
    assert found.text
    if most == "212992\n":
        assert found.remedy == "sysctl -w net.core.rmem_max=4194304"


def test_interfaces_without_a_receive_buffer_need_none(tmp_path):
    assert list(checks.receive_buffer([InterfaceConfig("a", QueueOptions("udp"), object())], tmp_path)) == []


@pytest.mark.parametrize(("python", "libzmq"), [((3, 10, 2), (4, 3, 5)), ((3, 11, 2), (4, 1, 6))])
def test_versions_that_are_too_old_are_a_problem(python, libzmq):
    assert Level.PROBLEM in [one.level for one in checks.versions(python, libzmq)]
    assert {one.level for one in checks.versions()} == {Level.OK}


def test_message_library_that_is_absent_is_a_warning_with_make_codec(without_library):
    found = only(checks.codec(library.load))
    assert found.level is Level.WARNING
    assert tells(found.text, "decode", "encode", "explain", "listen")
    assert "make codec" in found.remedy


def test_the_messages_of_the_library_are_named_with_their_editions(standin):
    found = only(checks.codec(library.load))
    assert found.level is Level.OK
    assert found.text == "5 in the library: ball 2.1 1.2 1.1, bare 1, door 1.1"


def test_a_worker_that_does_not_answer_is_a_problem():
    def silent() -> str:
        raise InterfaceError("it ended with 2", "look above")

    assert only(checks.worker(silent)) == Finding(Level.PROBLEM, "worker", "it ended with 2", "look above")


def test_a_pin_that_others_may_read_is_a_warning_and_one_that_is_missing_a_problem(tmp_path):
    path = tmp_path / "pin"
    one = InterfaceConfig("modem", QueueOptions("sim8202g"), ModemOptions(usb="1-1.4", pin_file=str(path)))
    assert only(checks.pin_file(one)).level is Level.PROBLEM
    path.write_text("0000")
    path.chmod(0o644)
    found = only(checks.pin_file(one))
    assert (found.level, found.remedy) == (Level.WARNING, f"chmod 600 {path}")
    path.chmod(0o600)
    assert list(checks.pin_file(one)) == []


def test_neighbours_whose_port_is_taken_are_a_problem_with_the_key_to_change():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        air = NeighboursOptions(listen=f"127.0.0.1:{taken.getsockname()[1]}", to="127.0.0.1:0")
        found = only(checks.neighbours(Board("a", neighbours=air), None))
    assert found.level is Level.PROBLEM
    assert "neighbours.listen" in found.remedy
    assert list(checks.neighbours(board_file.load("sim"), None)) == []
