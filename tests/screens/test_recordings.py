"""Screens of record and meter: frames with losses, no station, two recordings, a measurement in progress."""

from pathlib import Path

import pytest

from firmware.client.show.table import Screen
from firmware.meter.meter import Meter
from firmware.meter.report.text import tables
from firmware.meter.result import About, result
from tests.firmware.commands.fake import FakeStation
from tests.firmware.meter.events import START_NS, received, sent
from tests.firmware.meter.test_recording import GOOD, IN, OUT, UNKNOWN, recorded
from tests.firmware.recorder.reported_frames import message
from tests.screens.terminal import Terminal, compare


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Working folder, so that paths are short."""
    monkeypatch.chdir(tmp_path)


def run_at(station: FakeStation, terminal: Terminal, name: str, *argv: str) -> None:
    """Run a command at a station, and compare its screen; the station's random port becomes 5558."""
    terminal.run(*argv, *station.options)
    compare(
        name,
        [
            line.replace(f":{station.ports[3]}", ":5558").replace(f":{station.ports[1]}", ":5556")
            for line in terminal.lines()
        ],
    )


def test_a_recording_ends_with_its_frames_and_losses(terminal: Terminal) -> None:
    with FakeStation(reports=[message(1), message(2), message(5)]) as station:
        run_at(station, terminal, "record", "record", "--pcapng", "drive.pcapng", "--count", "3")


def test_a_recording_over_an_existing_file_ends_with_the_error(terminal: Terminal) -> None:
    Path("drive.pcapng").touch()
    with FakeStation() as station:
        run_at(station, terminal, "record-exists", "record", "--pcapng", "drive.pcapng")


def test_record_into_a_missing_folder_for_the_ring_ends_with_the_error(terminal: Terminal) -> None:
    with FakeStation() as station:
        run_at(station, terminal, "record-ring", "record", "--ring", "/data/of/a/disk/that/is/not/mounted/at/all/ring")


def test_the_loss_and_delay_of_two_recordings_fit_their_columns(terminal: Terminal) -> None:
    recorded(Path("a.pcapng"), "boot", OUT, GOOD)
    recorded(Path("b.pcapng"), "boot", IN, GOOD)
    terminal.run("meter", "a.pcapng", "b.pcapng")
    compare("meter", terminal.lines())


def test_two_recordings_of_unknown_clocks_say_why_there_is_no_delay(terminal: Terminal) -> None:
    recorded(Path("a.pcapng"), "one", OUT, UNKNOWN)
    recorded(Path("b.pcapng"), "other", IN, UNKNOWN)
    terminal.run("meter", "a.pcapng", "b.pcapng")
    compare("meter-clocks", terminal.lines())


def test_meter_of_a_capture_without_frames_ends_with_the_error(terminal: Terminal) -> None:
    recorded(Path("a.pcapng"), "boot", [], GOOD)
    terminal.run("meter", "a.pcapng", "absent.pcapng")
    compare("meter-absent", terminal.lines())


def test_the_glance_at_a_measurement_fits_a_screen(terminal: Terminal) -> None:
    meter = Meter()
    for name in "AB":
        meter.station(name, {"g5": "its-g5"})
        meter.hears(name, START_NS / 1e9 - 1)
    for number in range(100):
        meter.sent(sent(number, number / 10, by="g5"))
        if number % 9:
            meter.received(received(number, number / 10 + 0.004, by="g5"))
    meter.finish()
    stations = {
        name: {"where": f"10.0.0.{at}:5555", "version": "0.1.0", "time": "locked", "uncertainty_us": 1.2}
        for at, name in enumerate("AB", 1)
    }
    about = About("link meter", "over the network", 1_795_182_426.0, 10.0, stations)
    with Screen(terminal) as screen:
        screen.show(tables(result(meter, about, is_glance=True)))
    compare("meter-glance", terminal.lines())
