"""MQTT process with faulty addresses, names and devices: reported, and retried."""

import socket
import threading

import pytest

from drivers.mqtt.client import connector
from drivers.mqtt.client.connector import MOST_HANGING, Connector
from drivers.reason import Reason
from tests.broker.bad import FullBacklog
from tests.broker.mute import Mute
from tests.drivers.mqtt.station import Station, settings
from tests.drivers.mqtt.watched import idles, start, turns

__all__ = ["start", "turns"]


def test_an_address_that_answers_no_syn_is_named(start, turns):
    with FullBacklog() as full:
        station = start(full.port, connect_s=0.6, first_delay_s=9.0)
        station.down(f"mqtt://127.0.0.1:{full.port}: no answer to SYN from 127.0.0.1 within 0.6 s")
        idles(station, 0.3, turns)


def test_a_port_where_nobody_listens_is_named(start):
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    start(port).down(f"mqtt://127.0.0.1:{port}: 127.0.0.1: refuses the connection; no broker listens there")


def test_a_name_that_is_none_is_told(monkeypatch, start):
    def unknown(*_, **__):
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(connector.socket, "getaddrinfo", unknown)
    start(1).down("unknown host name; correct the host in url")


@pytest.mark.parametrize("host", ["x" * 64, "a..b"])
def test_a_name_that_cannot_be_one_is_told(turns, host):
    station = Station(settings(f"mqtt://{host}"))
    station.down(f"mqtt://{host}:1883: unknown host name")
    station.close()


def test_a_name_server_that_hangs_stops_nothing_and_few_threads_wait_for_it(monkeypatch, start, turns):
    release = threading.Event()

    def hang(*_, **__):
        release.wait(20.0)
        raise socket.gaierror(socket.EAI_AGAIN, "again")

    monkeypatch.setattr(connector.socket, "getaddrinfo", hang)
    before = set(threading.enumerate())
    try:
        station = start(1, connect_s=0.1)
        station.down("no answer from the name server within 0.1 s")
        station.send(1, lifetime=0.2)
        station.until(lambda: station.sent)
        assert station.sent[1][0] is Reason.EXPIRED
        station.down(f"{MOST_HANGING} look-ups of the broker's name have no answer yet")
        waiting = set(threading.enumerate()) - before - {station._thread}
        assert len(waiting) <= MOST_HANGING
    finally:
        release.set()
    monkeypatch.undo()
    for one in waiting:
        one.join(5.0)
    assert Connector._hanging == 0
    with Mute() as broker:
        start(broker.port).up()


def test_a_device_that_is_not_there_is_named(start):
    with Mute() as broker:
        start(broker.port, device="wwan9").down("device wwan9: No such device; `ip -brief link` lists them")


def test_a_device_that_is_there_is_used(start):
    with Mute() as broker:
        start(broker.port, device="lo").up()


def test_another_address_of_the_name_is_tried_when_one_refuses(monkeypatch, start):
    with Mute() as broker:
        both = [(socket.AF_INET, 1, 6, "", (host, broker.port)) for host in ("127.0.0.2", "127.0.0.1")]
        monkeypatch.setattr(connector.socket, "getaddrinfo", lambda *_, **__: both)
        start(broker.port).up()
