"""Messages of the meter's own: well-formed, each another, as long as is asked for."""

import json

import pytest

from board.runtime.errors import RequestError
from drivers.message import Position
from firmware.codec.decoding import Decoder
from firmware.codec.library import load
from firmware.codec.reading import Pdu
from firmware.meter.event import PROBES
from firmware.meter.probe import Probes
from firmware.meter.sender_position import position_of

NOW_S = 1_795_182_426.0


def probes(kind: str = "cam", octets: int | None = None, position: Position | None = None) -> Probes:
    return Probes(load(), kind, octets, lambda: NOW_S, position)


@pytest.mark.parametrize("kind", ["cam", "denm"])
@pytest.mark.parametrize("octets", [None, 100, 300, 390])
def test_a_probe_is_a_message_of_its_type_and_says_what_it_is(kind: str, octets: int | None) -> None:
    pdu = probes(kind, octets).next()
    found = Decoder(load()).identify(Pdu(pdu, "")).message
    assert found.type == kind
    assert int.from_bytes(pdu[2:6]) == PROBES
    assert octets is None or octets <= len(pdu) <= octets + 9


@pytest.mark.parametrize("kind", ["cam", "denm"])
def test_each_is_another_though_the_clock_stands_still(kind: str) -> None:
    made = probes(kind)
    assert len({made.next() for _ in range(1000)}) == 1000


def test_a_cam_does_not_come_again_though_its_time_does() -> None:
    now_s = [NOW_S]
    made = Probes(load(), "cam", None, lambda: now_s[0])
    seen = set()
    for _ in range(1000):
        seen.add(made.next())
        now_s[0] += 65.536  # generationDeltaTime is the same
    assert len(seen) == 1000


def test_a_denm_may_be_long() -> None:
    assert 1390 <= len(probes("denm", 1390).next()) <= 1400


@pytest.mark.parametrize(("kind", "octets"), [("cam", 1400), ("denm", 3000)])
def test_a_size_that_no_message_of_the_type_has_is_refused(kind: str, octets: int) -> None:
    with pytest.raises(RequestError, match="octets"):
        probes(kind, octets)


def test_a_type_that_there_is_no_probe_of_is_refused() -> None:
    with pytest.raises(RequestError, match="mapem"):
        probes("mapem")


def test_a_cam_is_nowhere_unless_somebody_says_where() -> None:
    assert position_of(probes().next()) is None
    assert position_of(probes(position=Position(487_000_000, 114_000_000)).next()) == (487_000_000, 114_000_000)


def test_a_denm_warns_nobody() -> None:
    message = load().find("denm")
    told = json.loads(message.to_json(probes("denm").next()))
    assert told["denm"]["management"]["termination"] == "isCancellation"
