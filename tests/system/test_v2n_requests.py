"""Requests of Vanetza-NAP's applications, through a station and a real broker."""

import json
from collections.abc import Callable

import pytest

from drivers.wire.v2n.payload.nap import NapToSend
from tests.broker.client import Message
from tests.broker.fixtures import Brokers
from tests.cases.nap import TO_SEND
from tests.drivers.wire.v2n.payload.nap import LIBRARY
from tests.system.conftest import Launcher
from tests.system.station import toml_table
from tests.system.user import mark
from tests.system.v2n import NAME, V2n, launched, table, until_up

STATION = 1337  # stationID in headers that the station makes


@pytest.fixture(scope="module")
def nap(launch_shared: Launcher, brokers_shared: Brokers) -> Callable[[bool], V2n]:
    """Return a function that starts a station with or without requests, once, and an application at its broker."""
    started: dict[bool, V2n] = {}

    def start(requests: bool) -> V2n:
        if requests not in started:
            broker = brokers_shared()
            application = brokers_shared.client(broker).subscribe("vanetza/#", no_local=True)
            options = {"profile": "nap", "station": STATION, "requests": requests}
            bench = launched(launch_shared, brokers_shared, broker.url, **options)
            until_up(bench)
            started[requests] = V2n(bench, broker, application)
        return started[requests]

    return start


def published_until_now(nap: V2n) -> list[Message]:
    """Return what the station has published since the last call, and check that g5 has sent nothing more."""
    nap.bench.user.send(b"v2x.cam.", pdu := mark())
    assert nap.bench.air.hear().pdu == pdu
    return nap.observer.until(pdu)


@pytest.mark.parametrize("kind", TO_SEND)
def test_example_with_requests_leaves_by_g5_once_and_does_not_return(nap: Callable[[bool], V2n], kind: str) -> None:
    station = nap(True)
    reports = station.bench.make_reports()
    body = TO_SEND[kind].read_bytes()
    station.observer.publish(f"vanetza/in/{kind}", body)
    heard = station.bench.air.hear()
    assert heard.pdu == NapToSend(STATION, LIBRARY).read(kind, body)[0]
    (_, accepted), (_, sent) = reports.next(f"confirm.{kind}."), reports.next(f"confirm.{kind}.")
    assert (accepted["outcome"], accepted["interfaces"]) == ("accepted", ["g5"])
    assert (sent["outcome"], sent["interface"], sent["request"]) == ("sent", "g5", accepted["request"])
    assert published_until_now(station) == []
    station.bench.user.hears_nothing_before_a_mark(station.bench.air)


@pytest.mark.parametrize("kind", TO_SEND)
def test_example_without_requests_is_received_and_does_not_leave(nap: Callable[[bool], V2n], kind: str) -> None:
    station = nap(False)
    station.observer.publish(f"vanetza/in/{kind}", TO_SEND[kind].read_bytes())
    assert station.bench.user.receive().envelope == f"v2x.{kind}.".encode()
    assert published_until_now(station) == []


def test_octets_with_requests_leave_unchanged_and_do_not_count_as_received(nap: Callable[[bool], V2n]) -> None:
    station = nap(True)
    station.observer.publish("vanetza/in/cam_enc", pdu := mark())
    assert station.bench.air.hear().pdu == pdu
    assert published_until_now(station) == []
    assert station.bench.station.status()["interfaces"][NAME]["received"] == {}


def test_message_of_a_user_with_requests_is_still_published(nap: Callable[[bool], V2n]) -> None:
    station = nap(True)
    pdu, _ = NapToSend(STATION, LIBRARY).read("cam", TO_SEND["cam"].read_bytes())
    station.bench.user.send(b"v2x.cam.", pdu)
    assert station.bench.air.hear().pdu == pdu
    published = published_until_now(station)
    assert [message.topic for message in published][:2] == ["vanetza/out/cam", "vanetza/out/cam_enc"]
    assert json.loads(published[0].payload)["stationID"] == STATION


def test_request_for_its_own_broker_alone_is_refused_and_counted(launch: Launcher, brokers: Brokers) -> None:
    broker = brokers()
    application = brokers.client(broker)
    more = toml_table(f"interfaces.{NAME}", table(brokers, broker.url, profile="nap", requests=True))
    bench = launch("btp", more=f'{more}\n[[policy]]\nmatch.type = ["cam"]\ninterfaces = ["{NAME}"]\n')
    until_up(bench)
    application.publish("vanetza/in/cam_enc", mark())
    bench.station.until(lambda _: bench.station.drops().get(("from_brokers", "no-interface")) == 1)
