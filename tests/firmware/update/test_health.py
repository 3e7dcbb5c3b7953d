"""When a station counts as well: for a slot that was updated it is the difference between staying and being left."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import zmq

from board.runtime.errors import StationError
from firmware.config.tables import EndpointOptions
from firmware.endpoint.users import HEARTBEAT, heartbeat
from firmware.update import health
from firmware.update.health import Counts, address


def counted(*numbers: int | None) -> Counts:
    found = Counts()
    for number in numbers:
        if number is None:
            found.miss()
        else:
            found.take(heartbeat(number))
    return found


@pytest.mark.parametrize("numbers", [(0, 1, 2), (7, 8, 9), (65_535, 0, 1), (1, 2, None, 3, 4, 5), (9, 0, 1, 2)])
def test_heartbeats_three_in_a_row_are_enough(numbers: tuple[int | None, ...]):
    assert counted(*numbers).are_enough


@pytest.mark.parametrize(
    ("numbers", "said"),
    [
        ((), "no heartbeat received"),
        ((0, 0, 0, 0), "heartbeats 0"),
        ((0, 2, 4, 6), "heartbeats 6"),
        ((0, 1, 0, 1, 0), "heartbeats 0"),
        ((0, 1, None), "heartbeats stop or restart after 2"),
        ((0, 1, None, 2, 3), "heartbeats 2, 3"),
    ],
)
def test_heartbeats_that_stand_skip_or_begin_again_are_not_enough(numbers: tuple[int | None, ...], said: str):
    found = counted(*numbers)
    assert not found.are_enough
    assert found.words == said


@pytest.mark.parametrize("body", [b"", b"{}", b"[]", b"\xff", b'{"heartbeat_counter": null}'])
def test_octets_of_no_heartbeat_count_as_a_missing_one(body: bytes):
    found = counted(0, 1)
    found.take(body)
    assert found.words == "heartbeats stop or restart after 2"


def test_address_of_heartbeats_is_that_of_the_configuration_on_this_machine():
    assert address(EndpointOptions()) == "tcp://127.0.0.1:5556"
    assert address(EndpointOptions(address="0.0.0.0", to_users=6000)) == "tcp://127.0.0.1:6000"
    assert address(EndpointOptions(address="10.0.0.1")) == "tcp://10.0.0.1:5556"
    assert address(EndpointOptions(address="fe80::1")) == "tcp://[fe80::1]:5556"


class Beating:
    """A station of which only the heartbeat is left."""

    def __init__(self) -> None:
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._socket = self._context.socket(zmq.XPUB)
        self.port = self._socket.bind_to_random_port("tcp://127.0.0.1")
        self._count = 0

    def clock(self) -> float:
        """A second for each time that somebody looks, with a heartbeat in it once somebody listens."""
        if self._count or self._socket.poll(2000):
            self._socket.send_multipart([HEARTBEAT, heartbeat(self._count)])
        self._count += 1
        return float(self._count)

    def close(self) -> None:
        self._context.destroy(linger=0)


@pytest.fixture
def station() -> Iterator[Beating]:
    made = Beating()
    yield made
    made.close()


def environment(folder: Path, port: int) -> dict[str, str]:
    path = folder / "captain.toml"
    path.write_text(f"[endpoint]\nto_users = {port}\n")
    return {"CAPTAIN_CONFIG": str(path), "CAPTAIN_BOARD": "none"}


def test_station_that_beats_is_well(tmp_path: Path, station: Beating):
    said = health.check(60.0, environment(tmp_path, station.port), station.clock)
    assert re.search(r" (\d+), (\d+), (\d+)$", said)


def test_station_that_is_silent_is_not_well_after_the_limit(tmp_path: Path):
    times = iter([0.0, 59.9, 60.0])
    with pytest.raises(StationError, match=r" 60 s: "):
        health.check(60.0, environment(tmp_path, 9), lambda: next(times))


def test_configuration_that_does_not_load_is_told_at_once(tmp_path: Path):
    path = tmp_path / "captain.toml"
    path.write_text("[endpoint]\nto_user = 1\n")
    with pytest.raises(StationError, match="to_user"):
        health.check(60.0, {"CAPTAIN_CONFIG": str(path)})
