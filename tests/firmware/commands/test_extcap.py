"""captain extcap: Wireshark's questions, and tshark capturing by them."""

import os
import signal
import stat
import subprocess
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from firmware import cli
from tests.firmware.commands.fake import FakeStation
from tests.firmware.recorder.reported_frames import message


@pytest.fixture
def folder() -> Iterator[Path]:
    """That anybody may read: tshark takes no folder of the kind from root."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o777)
        yield Path(name)


def tshark(folder: Path, *options: str) -> "subprocess.CompletedProcess[str]":
    """As a user who is not root, who may read what root may: the clone may lie where nobody else looks."""
    nobody = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
    nobody += [f"--{kept}-caps=+dac_override,+dac_read_search" for kept in ("inh", "ambient")]
    environment = {**os.environ, "WIRESHARK_EXTCAP_DIR": str(folder), "HOME": str(folder), "TMPDIR": str(folder)}
    command = [*(nobody if os.getuid() == 0 else []), "tshark", *options]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=60)


def test_it_is_installed_as_a_program(tmp_path, capsys):
    assert cli.main(["extcap", "--install", str(tmp_path / "extcap")]) == 0
    assert (tmp_path / "extcap" / "captain").stat().st_mode & stat.S_IXUSR
    assert str(tmp_path / "extcap" / "captain") in capsys.readouterr().out


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        (["--extcap-interfaces", "--extcap-version=4.0"], "interface {value=captain}{display=V2X station}"),
        (["--extcap-interface", "captain", "--extcap-dlts"], "dlt {number=1}{name=EN10MB}{display=Ethernet}"),
        (["--extcap-interface", "captain", "--extcap-config"], "arg {number=0}{call=--station}"),
    ],
)
def test_wireshark_is_answered(capsys, question, answer):
    assert cli.main(["extcap", *question]) == 0
    assert answer in capsys.readouterr().out


def test_tshark_lists_it_among_its_devices(folder):
    assert cli.main(["extcap", "--install", str(folder)]) == 0
    assert "captain (V2X station)" in tshark(folder, "-D").stdout


def test_tshark_captures_from_a_station(folder):
    assert cli.main(["extcap", "--install", str(folder)]) == 0
    with FakeStation(reports=[message(1), message(2)]) as station:
        # The ports of a fake station do not follow each other.
        script = folder / "captain"
        script.write_text(script.read_text().replace('"$@"', f'"$@" --report {station.ports[3]}'))
        where = f"extcap.captain.station:127.0.0.1:{station.ports[0]}"
        told = tshark(folder, "-n", "-i", "captain", "-o", where, "-c", "2", "-T", "fields", "-e", "frame.comment")
    assert told.stdout.splitlines() == ["cam of station 1337; time locked +-1.2 us"] * 2, told.stderr
    assert "captain: " not in told.stderr


def shown_as_errors(path: Path, capsys: pytest.CaptureFixture[str], *reports: tuple[bytes, ...]) -> str:
    """Standard error of a capture, which Wireshark ends as usual, by SIGTERM, once it has all frames."""
    os.mkfifo(path)

    def end_it() -> None:
        with path.open("rb") as fifo:
            octets = b""
            while octets.count(b'"station_id"') < len(reports):
                octets += fifo.read1()
            os.kill(os.getpid(), signal.SIGTERM)
            fifo.read()

    with FakeStation(reports=reports) as station:
        wireshark = threading.Thread(target=end_it)
        wireshark.start()
        assert cli.main(["extcap", "--capture", "--fifo", str(path), *station.options]) == 0
        wireshark.join()
    return capsys.readouterr().err


def test_what_is_ordinary_is_not_shown_as_an_error(tmp_path, capsys):
    assert shown_as_errors(tmp_path / "fifo", capsys, message(1), message(2)) == ""


def test_frames_that_are_lost_are_shown_as_an_error(tmp_path, capsys):
    shown = shown_as_errors(tmp_path / "fifo", capsys, message(1), message(5))
    assert shown == "captain: wireshark: 2 frames, 3 lost\n"


@pytest.mark.parametrize(
    ("options", "status", "words"),
    [
        (["--extcap-interface", "eth0", "--extcap-dlts"], 2, "eth0: unknown device"),
        (["--capture"], 2, "--fifo is missing"),
        (["--capture", "--fifo", "x", "--extcap-capture-filter", "tcp"], 2, "use a display filter"),
        (["--capture", "--fifo", "/nowhere/x"], 1, "/nowhere/x: No such file or directory"),
        (["--install", "/proc/self/x"], 1, "name another folder"),
    ],
)
def test_what_cannot_be_done_is_told(capsys, options, status, words):
    assert cli.main(["extcap", *options]) == status
    assert words in capsys.readouterr().err


def test_a_reader_that_leaves_ends_it(tmp_path):
    os.mkfifo(tmp_path / "fifo")
    head = ["head", "-c", "4", str(tmp_path / "fifo")]
    with FakeStation(reports=[message(1)]) as station, subprocess.Popen(head, stdout=subprocess.DEVNULL):
        status = cli.main(["extcap", "--capture", "--fifo", str(tmp_path / "fifo"), *station.options])
    assert status == 0


def test_without_wireshark_its_folder_has_to_be_named(monkeypatch, capsys):
    monkeypatch.setenv("PATH", "/nowhere")
    assert cli.main(["extcap", "--install"]) == 1
    assert "--install FOLDER" in capsys.readouterr().err
