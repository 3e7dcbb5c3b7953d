"""Screens of live tables: the demo, and what a tap takes from a broker; and where colour is left out."""

import io
import re
import time
from types import SimpleNamespace
from typing import Any

import pytest

from drivers.message import RxInfo
from drivers.sim import messages
from drivers.sim.track import Motion
from drivers.wire import raw
from firmware.client import client
from firmware.client.received import Message, Pairing
from firmware.client.show.table import Screen, Table
from firmware.client.show.tally import Tally
from firmware.codec.decoding import Decoder
from firmware.codec.library import load
from firmware.commands import demo
from firmware.lab.demo_user import MAC, STATION_ID
from firmware.tap.counts import Counts, Taken
from firmware.tap.display import Display
from tests.screens.terminal import Terminal, compare

OWN = 1234  # stationID of the reader's program
MOTION = Motion(487_660_000, 114_310_000, 420_000, 20_280, 4_250_000)
PATH = [MOTION] * (messages.TRACE + 1)


def received(kind: str, station: int, mac: str) -> Message:
    pdu = messages.cam(station, 0, MOTION) if kind == "cam" else messages.denm(station, 0, PATH, 1)
    rx = RxInfo(source_mac=bytes.fromhex(mac.replace(":", "")))
    return Message(kind, pdu, raw.RawRx(pdu, 0, rx, None))


def user(name: str, heard: list[tuple[int, str]]) -> Any:
    """A user who has heard stations for three seconds: ten CAMs and one DENM a second of each."""
    tally = Tally()
    for tenth in range(31):
        for station, mac in heard:
            tally.add(received("cam", station, mac), tenth / 10)
            if tenth % 10 == 0 and station != OWN:
                tally.add(received("denm", station, mac), tenth / 10)
        if tenth % 10 == 0:
            tally.mark(tenth / 10)
    return SimpleNamespace(name=name, tally=tally, pairing=Pairing())


def test_the_demo_shows_an_own_message_at_b_below_the_ports(terminal: Terminal) -> None:
    neighbour = "02:aa:00:00:12:67"
    users = [
        user("A", [(STATION_ID["B"], MAC["B"]), (4711, neighbour), (4712, neighbour)]),
        user("B", [(STATION_ID["A"], MAC["A"]), (OWN, MAC["A"])]),
    ]
    stations: list[Any] = [
        demo.DemoStation(name, client.Address("127.0.0.1", *range(first, first + 4)), None)  # type: ignore[arg-type]
        for name, first in (("A", 5555), ("B", 5565))
    ]
    print(demo.introduction(stations), file=terminal)
    with Screen(terminal) as screen:
        screen.show(demo.view(users, 3.05, screen.height - demo.INTRODUCTION, Decoder(load())))
        compare("demo", terminal.lines())


def test_a_tap_shows_each_type_and_station(terminal: Terminal, monkeypatch: pytest.MonkeyPatch) -> None:
    now = 1000.0
    monkeypatch.setattr(time, "monotonic", lambda: now)
    monkeypatch.setattr(time, "strftime", lambda _form: "12:00:00")
    connection: Any = SimpleNamespace(is_up=True, broker="mqtt://localhost:1883")
    display = Display(Screen(terminal), Counts(), connection)
    for station in range(40):
        display.add(Taken(messages.cam(station, 0, MOTION), 2001, "vm", "v2x/btp/2001", 0))
    display.add(Taken(messages.denm(7, 0, PATH, 1), 2002, "vm", "v2x/btp/2002", 0))
    display.draw(now + 1.0)
    compare("v2n-tap", terminal.lines())


@pytest.mark.parametrize(
    ("name", "value", "is_styled"), [("TERM", "xterm", True), ("TERM", "dumb", False), ("NO_COLOR", "1", False)]
)
def test_a_title_is_bold_on_a_terminal_that_wants_it(
    name: str, value: str, is_styled: bool, terminal: Terminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(name, value)
    with Screen(terminal) as screen:
        screen.show([Table("title", ("n",), [("1",)])])
    assert bool(re.search(r"\x1b\[[0-9;]*m", terminal.getvalue())) is is_styled


def test_elsewhere_than_on_a_terminal_there_are_no_escape_codes() -> None:
    with Screen(out := io.StringIO()) as screen:
        screen.show([Table("title", ("n",), [("1",)])])
    assert "\x1b" not in out.getvalue()
