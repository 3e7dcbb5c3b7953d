"""Process of the station: start, refusal to start, reload and end."""

import os
import pty
import signal
import socket
import subprocess
from pathlib import Path

import pytest

from tests.system.conftest import Launcher
from tests.system.station import PATIENCE, PROGRAM, Station
from tests.system.user import air_hears_nothing_before_a_mark, mark

CAM = bytes.fromhex("020200000539")
UDP = '[interfaces.g5]\ndriver = "udp"\nframing = "pdu"\nlisten = "127.0.0.1:0"\n'


def run(folder: Path, text: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run `captain run` with a configuration that it must refuse; return the ended process."""
    file = folder / "captain.toml"
    file.write_text(text)
    command = [*PROGRAM, "run", "--config", str(file), "--board", "none", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=2 * PATIENCE, check=False)


def test_it_ends_on_sigterm_with_users_connected_and_messages_waiting(launch: Launcher) -> None:
    bench = launch("pdu", options={"g5": {"rate_per_s": 0.5}})
    for number in range(50):
        bench.user.push_pdu(b"v2x.cam.", CAM + bytes((number,)), lifetime_s=60)
    bench.station.until(lambda status: status["endpoint"]["accepted"] >= 50)
    bench.station.stop()


def test_what_waits_in_a_queue_at_the_end_is_confirmed_as_stopped_or_sent(launch: Launcher) -> None:
    bench = launch("pdu", options={"g5": {"rate_per_s": 2}})
    reports = bench.make_reports()
    for number in range(10):
        bench.user.push_pdu(b"v2x.cam.", CAM + bytes((number,)), lifetime_s=60, label=f"w{number}")
    bench.station.until(lambda status: status["endpoint"]["accepted"] >= 10)
    bench.station.signal(signal.SIGTERM)
    ends: dict[str, str] = {}
    while len(ends) < 10:
        confirm = reports.next()[1]
        if confirm["label"].startswith("w") and confirm["outcome"] in ("sent", "dropped"):
            ends[confirm["label"]] = confirm["reason"] or confirm["outcome"]
    assert set(ends.values()) <= {"stopped", "sent"}
    assert "stopped" in ends.values()


def test_it_ends_on_sigint_without_a_traceback(launch: Launcher) -> None:
    bench = launch("pdu")
    assert bench.station.child is not None
    bench.station.signal(signal.SIGINT)
    assert bench.station.child.wait(timeout=PATIENCE) in (0, 130)
    bench.station.child = None
    assert "Traceback" not in bench.station.stderr.read_text()


def test_the_control_socket_ends_it_as_well(launch: Launcher) -> None:
    bench = launch("pdu")
    child = bench.station.child
    assert child is not None
    assert bench.station.ask(do="stop")["ok"]
    assert child.wait(timeout=PATIENCE) == 0


def test_it_starts_again_at_once_on_the_same_ports(launch: Launcher) -> None:
    bench = launch("pdu")
    bench.user.send(b"v2x.", CAM)
    assert bench.air.hear().pdu == CAM
    bench.station.stop()
    bench.station.start()
    launch.user(bench.station).join(bench.air)


def test_users_find_a_restarted_station_by_themselves(launch: Launcher) -> None:
    bench = launch("pdu")
    bench.station.stop()
    bench.station.start()
    bench.user.join(bench.air)


def test_sighup_reads_the_policy_again_and_keeps_connections(launch: Launcher) -> None:
    bench = launch("btp")
    before = bench.station.status()["uptime_s"]
    text = bench.station.file.read_text()
    bench.station.file.write_text(text + '\n[[policy]]\nname = "no cams"\nmatch.type = ["cam"]\ninterfaces = []\n')
    bench.station.signal(signal.SIGHUP)
    status = bench.station.until(lambda status: "no cams" in [row["name"] for row in status["policy"]])
    assert status["uptime_s"] > before
    bench.user.send(b"v2x.", CAM)
    bench.user.send(b"v2x.denm.", CAM + b"denm")
    assert bench.air.hear() == (2002, CAM + b"denm")
    bench.user.hears_nothing_before_a_mark(bench.air)
    assert bench.station.drops() == {("from_users", "policy"): 1}


def test_sighup_with_a_wrong_policy_keeps_the_old_one(launch: Launcher) -> None:
    bench = launch("pdu", more='[[policy]]\nname = "old"\n')
    good = bench.station.file.read_text()
    for bad in ("[[policy]\n", "[[policy]]\nmatch.tpye = ['cam']\n", "[[policy]]\ninterfaces=['x']\n"):
        bench.station.file.write_text(good + bad)
        assert bench.station.ask(do="reload")["ok"] is False, bad
        bench.station.signal(signal.SIGHUP)
        air_hears_nothing_before_a_mark(bench.user, bench.air)
        assert "old" in [row["name"] for row in bench.station.status()["policy"]], bad


def test_sighup_with_a_file_that_was_cut_off_keeps_what_is_withheld(launch: Launcher) -> None:
    bench = launch("pdu", more='[[policy]]\nname = "never"\nmatch.type = ["cam"]\ninterfaces = []\n')
    for count, left in enumerate(("", " \n\n", "# [interfaces]\n", "[interfaces.g5]\n", "[[policy]]\n"), 1):
        bench.station.file.write_text(left)
        bench.station.signal(signal.SIGHUP)
        assert bench.station.ask(do="reload")["ok"] is False, left
        bench.user.send(b"v2x.", CAM)
        bench.user.send(b"v2x.denm.", CAM + b"denm")
        assert bench.air.hear().pdu == CAM + b"denm"
        assert bench.station.drops() == {("from_users", "policy"): count}, left


def test_watchdog_and_readiness_are_notified(launch: Launcher, tmp_path: Path) -> None:
    station = launch.station()
    station.configure({"g5": launch.air("pdu").table})
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as service:
        service.bind(path := str(tmp_path / "n"))
        service.settimeout(PATIENCE)
        environment = os.environ | {"NOTIFY_SOCKET": path, "WATCHDOG_USEC": "300000"}
        environment.pop("WATCHDOG_PID", None)
        command = [*PROGRAM, "run", "--config", str(station.file), "--board", "none"]
        with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE) as child:
            said: list[bytes] = []
            while not (said.count(b"WATCHDOG=1") >= 2 and b"READY=1" in said):
                said += service.recv(4096).split(b"\n")
            child.send_signal(signal.SIGTERM)
            while b"STOPPING=1" not in said:
                said += service.recv(4096).split(b"\n")
            assert child.wait(timeout=PATIENCE) == 0


@pytest.mark.parametrize("endpoint", ["from_users", "to_users", "pull", "report"])
def test_a_port_that_is_taken_is_named_and_ends_it(launch: Launcher, endpoint: str) -> None:
    station = launch.station()
    station.configure({"g5": launch.air("pdu").table})
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as other:
        other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        other.bind(("127.0.0.1", station.ports[endpoint]))
        other.listen()
        refused = run(station.folder, station.file.read_text())
    assert refused.returncode == 1
    assert refused.stderr.startswith("captain: ")
    assert str(station.ports[endpoint]) in refused.stderr
    assert "Traceback" not in refused.stderr


def test_a_second_station_on_the_same_ports_is_refused_and_the_first_goes_on(launch: Launcher) -> None:
    bench = launch("pdu")
    refused = run(bench.station.folder, bench.station.file.read_text())
    assert refused.returncode == 1
    assert "Traceback" not in refused.stderr
    air_hears_nothing_before_a_mark(bench.user, bench.air)
    assert bench.station.status()["station"]


def test_an_interface_whose_port_is_taken_waits_and_comes_when_it_is_free(launch: Launcher) -> None:
    air, station = launch.air("pdu"), launch.station()
    station.configure({"g5": air.table})
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(air.station)
        station.start()
        g5 = station.status()["interfaces"]["g5"]
        assert g5["state"] == "waiting"
        assert str(air.station[1]) in g5["why"]
    station.until(lambda status: status["interfaces"]["g5"]["state"] == "up")
    launch.user(station).join(air)


def test_an_interface_that_disappears_and_returns_comes_up_again(launch: Launcher, tmp_path: Path) -> None:
    """The interface is a serial line on a pseudo-terminal. Closing its other end is like unplugging an adapter."""
    device = tmp_path / "tty"
    bench = launch("pdu", more=f'[interfaces.line]\ndriver = "uart"\ndevice = "{device}"\n')
    for _ in range(2):
        ours, theirs = pty.openpty()
        device.symlink_to(os.ttyname(theirs))
        os.close(theirs)
        bench.station.until(lambda status: status["interfaces"]["line"]["state"] == "up")
        os.close(ours)
        device.unlink()
        line = bench.station.until(lambda status: status["interfaces"]["line"]["state"] == "waiting")
        assert str(device) in line["interfaces"]["line"]["why"]
        bench.user.send(b"v2x.", sent := mark())
        assert bench.air.hear().pdu == sent


WRONG = {
    "unknown table": ("[statoin]\nname = 'x'\n", ["statoin", "station"]),
    "unknown key": ("[station]\nnmae = 'x'\n", ["station.nmae", "did you mean", "name"]),
    "unknown key of an interface": (UDP + "framming = 'btp'\n", ["interfaces.g5", "framming", "framing"]),
    "wrong type": ("[endpoint]\nto_users = 'x'\n", ["endpoint.to_users", "x", "integer"]),
    "out of range": ("[endpoint]\npull = 70000\n", ["endpoint.pull", "70000", "65535"]),
    "wrong choice": ("[station]\nprofile = 'modern'\n", ["station.profile", "modern", "standard", "legacy"]),
    "missing key": ("[interfaces.g5]\nlisten = '127.0.0.1:1'\n", ["interfaces.g5", "driver"]),
    "unknown driver": ("[interfaces.g5]\ndriver = 'udq'\n", ["interfaces.g5.driver", "udq", "udp"]),
    "wrong framing": (UDP.replace("pdu", "ip"), ["interfaces.g5", "framing", "ip"]),
    "no address": (UDP.replace("127.0.0.1:0", "here"), ["interfaces.g5", "here"]),
    "no TOML": ("[station\n", ["captain.toml", "line 1"]),
    "wrong address of the station": ("[station]\nmac = '01:02'\n", ["station.mac", "01:02"]),
    "policy without its interface": ("[[policy]]\ninterfaces = ['x']\n", ["policy[0]", "'x'"]),
    "the same number twice": ("[[types]]\nnumber = 200\nname = 'a'\n" * 2, ["types", "200"]),
    "a name with a dot": ("[[types]]\nnumber = 200\nname = 'a.b'\n", ["types", "a.b"]),
    "the same port twice": ("[endpoint]\npull = 6000\nreport = 6000\n", ["endpoint", "6000"]),
}


@pytest.mark.parametrize(("text", "words"), WRONG.values(), ids=WRONG.keys())
def test_a_wrong_configuration_is_explained_with_file_and_key(tmp_path: Path, text: str, words: list[str]) -> None:
    refused = run(tmp_path, text)
    assert refused.returncode == 1
    assert refused.stderr.startswith("captain: ")
    assert "Traceback" not in refused.stderr
    for word in ["captain.toml", *words]:
        assert word in refused.stderr, f"{word!r} is not said in: {refused.stderr}"


def test_all_mistakes_of_a_configuration_are_told_at_once(tmp_path: Path) -> None:
    refused = run(tmp_path, "[station]\nnmae = 'x'\n[endpoint]\npull = -1\n[interfaces.g5]\ndriver = 'udq'\n")
    for word in ("nmae", "pull", "udq"):
        assert word in refused.stderr


def test_a_configuration_that_does_not_exist_is_named(tmp_path: Path) -> None:
    command = [*PROGRAM, "run", "--config", str(tmp_path / "no.toml")]
    refused = subprocess.run(command, capture_output=True, text=True, timeout=2 * PATIENCE, check=False)
    assert refused.returncode == 1
    assert "no.toml" in refused.stderr
    assert "Traceback" not in refused.stderr


def test_an_option_is_overridden_on_the_command_line(launch: Launcher) -> None:
    air, station = launch.air("btp"), launch.station()
    station.configure({"g5": air.table})
    station.start("--set", "station.profile=legacy", "--set", "station.name=other")
    status = station.status()
    assert (status["station"], status["profile"]) == ("other", "legacy")


@pytest.mark.parametrize("override", ["station.nmae=x", "endpoint.pull=high", "nonsense", "=", "interfaces.g5.queue=0"])
def test_a_wrong_override_is_explained(tmp_path: Path, override: str) -> None:
    refused = run(tmp_path, UDP, "--set", override)
    assert refused.returncode in (1, 2)
    assert "Traceback" not in refused.stderr
    assert refused.stderr


def test_a_wrong_use_of_the_command_line_is_exit_code_2() -> None:
    wrong = subprocess.run([*PROGRAM, "run", "--nonsense"], capture_output=True, text=True, timeout=10, check=False)
    assert wrong.returncode == 2


def test_it_is_bound_to_loopback_unless_configured(launch: Launcher) -> None:
    bench = launch("pdu")
    assert _listening(bench.station) == {"127.0.0.1"}


def _listening(station: Station) -> set[str]:
    """Return the addresses at which the station's four ports listen, from /proc/net/tcp (proc(5))."""
    found = set()
    for row in Path("/proc/net/tcp").read_text().splitlines()[1:]:
        local, state = row.split()[1], row.split()[3]
        address, port = local.split(":")
        if state == "0A" and int(port, 16) in station.ports.values():
            found.add(".".join(str(octet) for octet in reversed(bytes.fromhex(address))))
    return found
