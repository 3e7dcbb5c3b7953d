"""Addresses of running stations, as the client takes them."""

from captain_client import Address
from tests.system.conftest import Bench


def address_of(bench: Bench) -> Address:
    ports = bench.station.ports
    return Address("127.0.0.1", ports["from_users"], ports["to_users"], ports["pull"], ports["report"])
