"""captain meter at running stations: sent, lost and reflected messages, and its page."""

import json
import select
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from firmware import cli
from firmware.client import client
from firmware.lab.laboratory import Seat, bench
from firmware.meter.meter import Meter
from firmware.meter.session import Session, TimeLine
from firmware.meter.shows import table_3
from tests.system.station import PROGRAM


def meter(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*PROGRAM, "meter", *arguments], capture_output=True, text=True, timeout=60, check=False)


def said(*arguments: str) -> dict[str, Any]:
    done = meter(*arguments, "--json")
    assert done.returncode == 0, done.stderr + done.stdout
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def at(seat: Seat) -> tuple[str, str]:
    place = seat.place
    return "--at", f"{seat.name}={place.host}:{place.from_users},{place.to_users},{place.pull},{place.report}"


@pytest.fixture(scope="module")
def seats() -> Iterator[tuple[Seat, Seat]]:
    with bench("udp", 0.0, None) as made:
        a, b = made.seats
        yield a, b


PROBES = ("--probe", "cam", "--rate", "50", "--count", "20", "--grace", "0.4")


def test_probes_from_one_to_the_other_arrive_and_their_delays_are_by_one_clock(
    seats: tuple[Seat, Seat], tmp_path: Path
) -> None:
    a, b = seats
    page = tmp_path / "page.html"
    told = said(*at(a), *at(b), *PROBES, "--report", str(page))
    (way,) = told["ways"]
    assert (way["way"], way["sent"], way["arrived"], way["lost"]) == ("A > B air", 20, 20, 0)
    assert way["one_way_us"]["count"] == 20
    assert way["link_us"]["median"] + way["doubt_us"]["most"] > 0
    (row,) = told["rows"]
    assert (row["type"], row["station_id"]) == ("cam", 0x50524F42)
    trips = {(one["sender"], one["receiver"]): one["user_us"] for one in told["trips"]}
    assert trips["A", "B"]["count"] == 20
    assert trips["A", "B"]["least"] > way["link_us"]["least"]
    assert {one["version"] for one in told["stations"].values()} != {""}
    assert page.read_text().startswith("<!DOCTYPE html>")
    assert json.loads(page.with_suffix(".json").read_text())["ways"] == told["ways"]
    assert json.loads(page.with_suffix(".geojson").read_text())["type"] == "FeatureCollection"


@contextmanager
def reflecting(seat: Seat) -> Iterator[None]:
    command = [*PROGRAM, "meter", "--reflect", *at(seat)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stderr is not None
            assert "reflecting probes" in process.stderr.readline()
            yield
        finally:
            process.terminate()


def test_reflected_probes_have_a_round_trip_that_needs_the_other_station_not_at_all(seats: tuple[Seat, Seat]) -> None:
    a, b = seats
    with reflecting(b):
        told = said(*at(a), *PROBES, "--round-trip")
    (way,) = told["ways"]
    assert way["is_round_trip"]
    assert (way["sent"], way["lost"], way["one_way_us"]["count"]) == (20, 0, 20)


def test_stations_under_load_are_joined_without_a_loss(seats: tuple[Seat, Seat]) -> None:
    """Messages are sent before the meter starts, while it connects, and after it has ended by a signal."""
    a, b = seats
    command = [*PROGRAM, "meter", *at(a), *at(b), "--grace", "0.4", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        number, last, heeded = 0, None, [process.stdout, process.stderr]
        while number < 10_000 and process.poll() is None:
            number += 1
            a.send_pdu(bytes([2, 2]) + number.to_bytes(12))
            ready = select.select(heeded, [], [], 0.004)[0]
            if process.stdout in ready:
                break
            if last is None and process.stderr in ready:
                assert "heard" in process.stderr.readline()
                last, heeded = number + 200, [process.stdout]
            if number == last:
                process.terminate()
        told = json.loads(process.communicate(timeout=30)[0])
    (way,) = told["ways"]
    assert (way["lost"], way["unseen"], way["late"]) == (0, 0, 0)
    assert 0 < way["sent"] == way["arrived"]


def test_a_station_that_is_not_there_is_told() -> None:
    done = meter("--at", "A=127.0.0.1:1", "--duration", "1")
    assert done.returncode == 1
    assert "no station answers" in done.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        ("one.pcapng",),
        ("table1", "--at", "A=127.0.0.1"),
        ("--at", "127.0.0.1", "--at", "127.0.0.1"),
        ("--at", "A=127.0.0.1", "--round-trip"),
        ("--at", "A=127.0.0.1", "--probe", "cam", "--from", "B"),
        ("--at", "A=127.0.0.1", "--report", "page.pdf"),
        ("--at", "A=127.0.0.1", "--report", "/nowhere/page.html"),
        ("--at", "A=127.0.0.1", "--between", "A:g5"),
        ("--at", "A=127.0.0.1:1,2,3"),
        ("one.pcapng", "two.pcapng", "--probe", "cam"),
        ("one.pcapng", "two.pcapng", "--interface", "zzz"),
        ("one.pcapng", "two.pcapng", "--duration", "3"),
        ("table1", "--rate", "20"),
        ("table2",),
        ("--reflect", "--probe", "cam"),
        ("--reflect", "--report", "page.html"),
        ("--at", "A=127.0.0.1", "--rate", "20"),
    ],
)
def test_what_does_not_go_together_is_wrong_usage(arguments: tuple[str, ...]) -> None:
    with pytest.raises(SystemExit, match=f"^{cli.USAGE_ERROR}$"):
        sys.exit(cli.main(["meter", *arguments]))


def test_of_table_2_it_is_said_what_measures_it() -> None:
    assert "make ros2" in meter("table2").stderr


@pytest.mark.parametrize("suffix", [".html", ".json", ".geojson"])
def test_a_page_of_before_is_not_written_over(tmp_path: Path, suffix: str) -> None:
    """The meter refuses an existing file before the measurement starts, not after an hour."""
    old = tmp_path / f"drive{suffix}"
    old.write_text("of before")
    done = meter("--at", "A=127.0.0.1:1", "--report", str(tmp_path / "drive.html"))
    assert done.returncode == 2
    assert f"--report: {old}: the file exists" in done.stderr
    assert old.read_text() == "of before"


def test_the_second_signal_ends_a_meter_that_waits_for_what_is_under_way(seats: tuple[Seat, Seat]) -> None:
    a, b = seats
    command = [*PROGRAM, "meter", *at(a), *at(b), "--grace", "60", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        assert "heard" in process.stderr.readline()
        process.send_signal(signal.SIGINT)
        said = process.stderr.readline()
        assert "at most 120.5 s" in said
        assert "Ctrl-C" in said
        process.send_signal(signal.SIGINT)
        told = json.loads(process.communicate(timeout=30)[0])
    assert process.returncode == 0
    assert any("cut short" in note for note in told["notes"])


def test_table_1_loses_nothing_and_the_meter_says_so() -> None:
    told = said("table1", "--duration", "0.5")
    assert [(one["way"], one["sent"], one["arrived"], one["lost"]) for one in told["ways"]] == [
        ("A > B air", 50, 50, 0),
        ("B > A air", 50, 50, 0),
    ]


def test_table_3_measures_the_loss_of_the_radios() -> None:
    """Messages are lost while the car is out of sight, behind the block of houses."""
    shown = table_3(2.0, 1.0, from_s=15.5)
    assert shown.is_right, shown.verdict
    assert all(0 < way["lost"] < way["sent"] == 20 for way in shown.result["ways"])
    assert len(shown.result["map"]) == 40


def test_by_radio_and_broker_at_once_it_is_known_which_was_first_and_what_the_air_lost() -> None:
    with bench("radio", 0.3, None, has_broker=True) as made, client.session() as context:
        session = Session(Meter(1.0, 0.5), TimeLine())
        for seat in made.seats:
            session.watch(seat.name, seat.place, context)
        session.begin()
        for number in range(40):
            made.seats[0].send_pdu(bytes([2, 2]) + number.to_bytes(12))
            session.serve(0.01)
        session.wait_for("A", 2 * 40)
        session.end()
        lost = made.lost_on_air()
    ((_, both),) = session.meter.paths.both.items()
    ways = {way.out: one for way, one in both.ways.items()}
    assert 0 < lost == 40 - ways["air"].arrived == ways["v2n"].alone
    assert (both.sent, both.arrived, ways["v2n"].arrived, both.gain) == (40, 40, 40, 0.0)
    assert sum(one.first + one.alone for one in ways.values()) == 40
