"""Address at which a station receives a swarm, by its status."""

import pytest

from board.runtime.errors import StationError
from firmware.swarm.audience import ear_of


def udp(listen: object = "127.0.0.1:9001", framing: object = "ethernet") -> dict[str, object]:
    return {"driver": "udp", "details": {"listen": listen, "framing": framing}}


@pytest.mark.parametrize(
    ("status", "host", "to"),
    [
        ({"simulation": {"hears": "127.0.0.1:20043"}, "interfaces": {"air": udp()}}, "127.0.0.1", "127.0.0.1:20043"),
        ({"interfaces": {"air": udp()}}, "localhost", "127.0.0.1:9001"),
        ({"interfaces": {"g5": {"driver": "som301e"}, "air": udp()}}, "127.0.0.1", "127.0.0.1:9001"),
        ({"interfaces": {"air": udp("0.0.0.0:9001")}}, "10.0.0.7", "10.0.0.7:9001"),
        ({"interfaces": {"air": udp("10.0.0.7:9001")}}, "10.0.0.7", "10.0.0.7:9001"),
    ],
)
def test_an_ear_is_the_simulated_radio_or_a_udp_interface(status, host, to):
    assert str(ear_of(status, host).to) == to


@pytest.mark.parametrize("framing", ["ethernet", "btp", "pdu"])
def test_an_ear_has_the_framing_of_its_interface(framing):
    assert ear_of({"interfaces": {"air": udp(framing=framing)}}, "127.0.0.1").framing == framing


@pytest.mark.parametrize(
    "status",
    [
        {},
        {"interfaces": {"g5": {"driver": "som301e"}}},
        {"simulation": {"hears": ""}, "interfaces": {"air": udp(listen="")}},
        {"simulation": {"hears": "nowhere"}, "interfaces": {"air": udp(7, [])}},
        {"interfaces": {"air": udp(framing="smoke")}},
    ],
)
def test_a_station_that_hears_no_datagrams_is_refused_with_other_ways(status):
    with pytest.raises(StationError, match="has no interface that receives UDP") as refused:
        ear_of({"station": "box", **status}, "127.0.0.1")
    assert "--udp HOST:PORT" in refused.value.hint


def test_a_station_elsewhere_that_hears_its_own_machine_alone_is_refused():
    with pytest.raises(
        StationError,
        match=r"station box at 10\.0\.0\.7 listens on 127\.0\.0\.1:9001, which only its own machine can reach",
    ):
        ear_of({"station": "box", "interfaces": {"air": udp()}}, "10.0.0.7")
