"""Addresses of brokers: IPv6, and a choice of network devices, with a real mosquitto."""

from pathlib import Path

import pytest

from firmware.lab import netns
from tests.broker.certificates import Authority
from tests.broker.client import Client
from tests.broker.fixtures import certificates
from tests.broker.mosquitto import Mosquitto
from tests.drivers.mqtt.station import CAM, Station, secured, settings
from tests.drivers.veth import ip
from tests.system.ports import Ports

__all__ = ["certificates"]

TLS = """
listener {port} {address}
cafile {authority}
certfile {server.certificate}
keyfile {server.key}
require_certificate true
"""
PORT = 8883

# Two ways to one broker. The kernel takes the first; the modem is the second.
BROKER = "192.0.2.1"
WAYS = (("eth0", "198.51.100", 10), ("wwan0", "203.0.113", 100))


def broker_at(folder: Path, address: str, authority: Authority, name: str = "") -> Mosquitto:
    """Return a broker with a TLS listener at an address. name: name in its certificate, if it is not the address."""
    server = authority.server((f"IP:{name or address}",))
    more = TLS.format(port=PORT, address=address, authority=authority.certificate, server=server)
    return Mosquitto(folder, Ports(), authority, more=more)


@pytest.mark.namespace
def test_broker_at_an_ipv6_address_carries_both_ways(tmp_path, certificates):
    authority = certificates.authority
    with broker_at(tmp_path, "::1", authority) as broker:
        observer = Client(broker.plain_port, host="127.0.0.1").subscribe("#")
        station = Station(secured(f"mqtts://[::1]:{PORT}", authority, certificates.client)).up()
        station.send(1)
        station.until(lambda: 1 in station.sent)
        assert observer.next("v2x/btp/2001").payload == b"vm(2001): <AgIAAAU5AAECAwQ=>"
        observer.publish("v2x/btp/2001", b"other(2001): <AgIAAAU5AAECAwQ=>")
        assert station.until(lambda: bool(station.received)).received[0].pdu == CAM
        assert broker.has_client("vm", "::1")
        station.close()
        observer.close()


@pytest.mark.namespace
def test_a_certificate_for_another_ipv6_address_is_refused_by_name(tmp_path, certificates):
    authority = certificates.authority
    with broker_at(tmp_path, "::1", authority, name="2001:db8::1"):
        station = Station(secured(f"mqtts://[::1]:{PORT}", authority, certificates.client))
        assert "::1" in station.down("certificate")
        station.close()


@pytest.mark.namespace
def test_name_with_two_addresses_is_reached_at_the_one_that_answers(tmp_path, certificates):
    # localhost first resolves to ::1, where no program listens.
    with Mosquitto(tmp_path, Ports(), certificates.authority) as broker:
        station = Station(settings(f"mqtt://localhost:{broker.plain_port}")).up()
        assert broker.has_client("vm", "127.0.0.1")
        station.close()


@pytest.mark.namespace
@pytest.mark.parametrize(("device", "source"), [("", "198.51.100.2"), ("wwan0", "203.0.113.2")])
def test_connection_that_is_bound_to_a_device_goes_by_it_although_another_is_nearer(
    tmp_path, certificates, device: str, source: str
):
    here, there = netns.cable("eth0", "up0")
    authority = certificates.authority
    with there.inside():
        ip(f"address add {BROKER}/32 dev lo")
        broker = broker_at(tmp_path, BROKER, authority).start()
    ip(f"link add wwan0 type veth peer name up1 netns {broker.pid}")
    with there.inside():
        ip("link set up1 up")
        for number, (_, network, _) in enumerate(WAYS):
            ip(f"address add {network}.1/24 dev up{number}")
    ip("link set wwan0 up")
    for name, network, metric in WAYS:
        ip(f"address add {network}.2/24 dev {name}")
        ip(f"route add default via {network}.1 dev {name} metric {metric}")
    station = Station(secured(f"mqtts://{BROKER}:{PORT}", authority, certificates.client, device=device)).up()
    assert broker.has_client("vm", source)
    station.send(1)
    station.until(lambda: 1 in station.sent)
    station.close()
    broker.stop()
    here.close()
