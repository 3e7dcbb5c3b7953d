"""ITS-G5 radio with the simulated library: messages on the air, and all failures."""

import errno
import os
import random
import signal
from pathlib import Path

import pytest

from board.runtime.errors import InterfaceError, RequestError, StuckError
from drivers.contract import Can, Sent
from drivers.message import Area, Position, SecurityStatus, Shape
from drivers.reason import Reason
from drivers.som301e.handlers import Caster
from drivers.som301e.module import SILENCE_S, WINDOW
from drivers.som301e.outbox import DEPTH
from drivers.wire.geonet.protocol import GeoNetworking, Mib, Received
from drivers.wire.v2xcast import ALIVE
from tests.drivers.host import CAM, DENM, EGO, Host, request, requests
from tests.drivers.radio import PATIENCE_S, Air, SimulatedRadio, all_work, library
from tests.said import tells

TWO = (Caster(0, 2001), Caster(1, 2002))  # CAM and DENM


@pytest.fixture(autouse=True)
def _patience(loop):
    loop.patience_s = PATIENCE_S


@pytest.fixture
def air():
    station = Air()
    yield station
    station.close()


@pytest.fixture
def start(loop, host, air):
    """Return a function that starts a driver on a simulated radio in range of `air`; it is stopped after the test."""
    drivers = []

    def start(settings="", wait=True, **options):
        radio = SimulatedRadio(settings, (air.address,))
        driver = radio.driver(**{"casters": TWO, **options})
        drivers.append(driver)
        driver.start(host)
        if wait:
            loop.run_until(lambda: all_work(host) or host.failures)
            assert host.failures == []
        return driver, radio

    yield start
    leave(loop, *drivers)


def leave(loop, *drivers):
    """Stop drivers and wait until their processes have ended."""
    for driver in drivers:
        driver.stop()
    loop.run_until(lambda: not loop._sources)


def pass_by(loop, seconds):
    """Advance the virtual clock while the process with the library runs in real time."""
    loop.patience_s = 0.0
    loop.run_for(seconds)
    loop.patience_s = PATIENCE_S


def send(loop, host, driver, wanted):
    """Send one request and wait for its outcome."""
    assert driver.send(wanted) is Sent.LATER
    loop.run_until(lambda: any(confirmed is wanted for confirmed, _ in host.confirms))
    return host.confirms[-1][1]


def links(host):
    """Link reports without those of the bring-up."""
    return [link for link in host.links if link[1] not in host.bring_up]


# What crosses the air.


def test_its_link_is_up_once_however_many_handlers_follow(start, host):
    start()
    assert links(host) == [(True, "module 192.168.1.3 answers")]
    assert host.details[-1]["casters"] == [
        {"caster_id": 0, "btp_port": 2001, "rx": "up", "tx": "up"},
        {"caster_id": 1, "btp_port": 2002, "rx": "up", "tx": "up"},
    ]


def test_module_is_starting_until_its_first_answer(start, loop, host):
    start("down=1", wait=False)
    assert host.bring_up == ["waiting for module 192.168.1.3"]
    loop.run_until(lambda: links(host))
    assert host.bring_up == ["waiting for module 192.168.1.3"]


def test_the_module_of_a_received_message_is_told_in_full(start, loop, host, air):
    _, radio = start("rssi=-83")
    air.say(CAM, radio)
    loop.run_until(lambda: host.count)
    pdu, _, rx = host.indications[0]
    assert pdu == CAM
    assert (rx.btp_port, rx.rssi_dbm, rx.data_rate, rx.traffic_class, rx.hop_limit) == (2001, -83, 12, 2, 1)
    assert (rx.source_mac, rx.area, rx.security.status) == (bytes.fromhex("020000000077"), None, SecurityStatus.NONE)


def test_a_request_with_an_area_leaves_as_a_geobroadcast_with_its_class(start, loop, host, air):
    driver, _ = start()
    area = Area(Shape.ELLIPSE, EGO.position, 300, 100, 45)
    assert send(loop, host, driver, request(DENM, area=area)._replace(traffic_class=1)) is None
    ethernet = air.hear()
    event = GeoNetworking(bytes(6)).receive(ethernet.packet, ethernet.source, 0.0, EGO.its_ms, lambda: EGO)
    assert isinstance(event, Received)
    assert (event.pdu, event.rx.btp_port, event.rx.area, event.rx.traffic_class) == (DENM, 2002, area, 1)


def test_the_area_of_a_geobroadcast_is_received_without_its_centre(start, loop, host, air):
    _, radio = start()
    area = Area(Shape.RECTANGLE, Position(487_000_000, 114_000_000), 500, 250, 90)
    packet = GeoNetworking(bytes.fromhex("020000000078"), Mib(beacon_s=0.0)).encode(request(DENM, area=area), 0.0, EGO)
    air.say_frame(b"\xff" * 6 + bytes.fromhex("0200000000788947") + packet, radio)
    loop.run_until(lambda: host.count)
    rx = host.indications[0][2]
    assert (rx.area, rx.position) == (area._replace(centre=Position()), EGO.position)


def test_two_stations_hear_each_other_a_thousand_times(loop):
    radios = [SimulatedRadio("mac=02:00:00:00:00:01"), SimulatedRadio("mac=02:00:00:00:00:02")]
    settings = [f"peers={radios[1].listen}", f"peers={radios[0].listen}"]
    hosts, drivers = [Host(loop), Host(loop)], [radio.driver(casters=TWO) for radio in radios]
    for driver, host, radio, peer in zip(drivers, hosts, radios, settings, strict=True):
        driver.start(host)
        loop.run_until(lambda host=host: all_work(host))
        radio.control.ask(peer + " tx_ms=0")
    sent = [CAM[:6] + number.to_bytes(2) for number in range(1000)]
    for at in range(0, len(sent), 25):  # as much as a caster's queue on the module holds
        for driver, host in zip(drivers, hosts, strict=True):
            send_all(loop, host, driver, requests(sent[at : at + 25]))
        loop.run_until(lambda at=at: all(host.count == at + 25 for host in hosts))
    assert [host.pdus for host in hosts] == [sent, sent]
    assert [host.drops for host in hosts] == [{}, {}]
    leave(loop, *drivers)


def send_all(loop, host, driver, wanted):
    """Send requests as a station does, as many at once as the driver accepts. Check that each is sent."""
    before = len(host.confirms)
    for one in wanted:
        while driver.send(one) is Sent.BUSY:
            times = host.times_writable
            loop.run_until(lambda times=times: host.times_writable > times)
    loop.run_until(lambda: len(host.confirms) == before + len(wanted))
    assert {reason for _, reason in host.confirms[before:]} == {None}


def test_what_the_air_loses_is_exactly_what_is_missing(start, loop, host, air):
    _, radio = start("loss=0.1 seed=7")
    for number in range(500):
        air.say(CAM[:6] + number.to_bytes(2), radio)
        if number % 25 == 24:
            loop.run_until(lambda expected=number + 1: radio.control.ask()["lost"] + host.count == expected)
    counters = radio.control.ask()
    assert counters["heard"] == 500
    assert 25 < counters["lost"] < 80
    assert counters["delivered"] == host.count == 500 - counters["lost"]
    assert len(set(host.pdus)) == host.count


def test_delay_and_reordering_lose_nothing(start, loop, host, air):
    _, radio = start("delay_ms=2 jitter_ms=3 reorder=0.2 seed=3")
    sent = [CAM[:6] + number.to_bytes(2) for number in range(30)]
    for pdu in sent:
        air.say(pdu, radio)
    loop.run_until(lambda: host.count == len(sent))
    assert sorted(host.pdus) == sent
    assert host.pdus != sent


def test_garbage_on_the_air_disturbs_nobody(start, loop, host, air):
    _, radio = start()
    chance = random.Random(5)
    good = air.station.encode(CAM)
    for count in range(20):
        for _ in range(50):
            octets = bytearray(good if chance.random() < 0.5 else chance.randbytes(chance.randrange(1600)))
            for _ in range(3):
                if octets:
                    octets[chance.randrange(len(octets))] = chance.randrange(256)
            air.say_frame(bytes(octets), radio)
        assert radio.control.ask()["heard"] == 50 * (count + 1)
    counters = radio.control.ask()
    assert counters["heard"] == sum(
        counters[name] for name in ("foreign", "own", "duplicate", "no_caster", "overflow", "delivered")
    )
    air.say(DENM, radio)
    loop.run_until(lambda: DENM in host.pdus)
    assert host.failures == []


# Fairness.


def test_a_denm_overtakes_a_flood_of_cams_and_what_is_dropped_is_counted(start, loop, host, air):
    driver, radio = start()
    for _ in range(40):  # the station does not read meanwhile
        for _ in range(25):
            air.say(CAM, radio)
        radio.control.ask()
    air.say(DENM, radio)
    told = radio.control.ask()["delivered"]
    loop.run_until(lambda: DENM in host.pdus)
    assert host.pdus.index(DENM) < 200  # only messages in the worker's socket precede it, not all 1,000

    def are_all_known() -> bool:
        driver.refresh()  # each time: what a thread of the library's has still to drop is in a later answer
        return host.total == told

    loop.run_until(are_all_known)
    assert host.drops[Reason.RECEIVE_QUEUE] >= told - DEPTH - 60


# Sent messages.


def test_it_takes_a_few_requests_ahead_and_tells_when_it_takes_more(start, loop, host):
    driver, _ = start("tx_ms=5")
    wanted = requests([CAM] * (WINDOW + 1))
    assert [driver.send(one) for one in wanted] == [Sent.LATER] * WINDOW + [Sent.BUSY]
    loop.run_until(lambda: host.times_writable)
    assert driver.send(wanted[-1]) is Sent.LATER
    loop.run_until(lambda: len(host.confirms) == len(wanted))
    assert host.times_writable == 1


def test_a_port_without_a_caster_is_refused(start, loop, host):
    driver, _ = start()
    with pytest.raises(RequestError, match="no caster sends to BTP port 2999"):
        driver.send(request(CAM)._replace(btp_port=2999))


def test_casters_that_only_receive_make_an_interface_that_only_receives():
    driver = SimulatedRadio().driver(casters=(Caster(0, 2001, "rx"),))
    assert driver.capabilities.can == Can.RECEIVE


def test_a_request_that_fails_is_confirmed_so_and_the_next_one_leaves(start, loop, host):
    driver, radio = start()
    radio.control.ask("fail=tx:-6171:1")  # too long: the message's fault
    assert send(loop, host, driver, request(CAM, 1)) is Reason.SEND_FAILED
    created = radio.control.ask()["created"]
    assert send(loop, host, driver, request(CAM, 2)) is None
    assert radio.control.ask()["created"] == created
    assert "overload" in host.details[-1]["last_error"]
    assert links(host) == [(True, "module 192.168.1.3 answers")]


# The module goes away and comes back.


def test_a_module_that_disappears_is_told_and_so_is_its_return(start, loop, host, air):
    _, radio = start()
    radio.control.ask("down=1")
    loop.run_until(lambda: not host.is_up)
    # With what words depends on what its handlers were at: creating, or receiving for less than they count as steady.
    assert "module 192.168.1.3 does not answer: Caster" in links(host)[-1][1]
    radio.control.ask("down=0")
    loop.run_until(lambda: all_work(host))
    assert len(links(host)) < 8
    assert host.failures == []
    air.say(CAM, radio)
    loop.run_until(lambda: host.count)


def test_one_that_fails_to_send_has_all_look_for_the_module(start, loop, host):
    driver, radio = start()
    created = radio.control.ask()["created"]
    radio.control.ask("fail=tx:-6169:1,create:-6156:1")
    assert send(loop, host, driver, request(CAM)) is Reason.SEND_FAILED
    loop.run_until(lambda: radio.control.ask()["created"] >= created + 2 and all_work(host))


def test_module_that_is_full_is_reported_and_the_rest_works(start, loop, host):
    start("limit=3", wait=False)
    loop.run_until(lambda: len(links(host)) == 2)
    assert links(host)[0] == (True, "module 192.168.1.3 answers")
    assert tells(links(host)[1][1], "caster: ", "Caster create: ", "over limit")


def test_module_that_is_absent_is_reported_once_and_is_no_failure(start, loop, host):
    start("down=1", wait=False)
    loop.run_until(lambda: links(host))
    assert links(host)[0][0] is False
    assert tells(links(host)[0][1], "not answer: ", "Caster create: ", "(-6156)")
    assert host.failures == []


def test_a_process_that_is_frozen_is_a_failure_within_seconds(start, loop, host):
    driver, _ = start(beats=True)
    os.kill(driver._module._worker._child._process.pid, signal.SIGSTOP)
    loop.patience_s = 0.05  # earlier messages of it have arrived
    before = loop.now
    loop.run_until(lambda: host.failures)
    assert loop.now - before <= SILENCE_S + 1.0
    assert host.failures[0].message.endswith("was silent for 5 s, SIGKILL")


def test_a_process_that_has_nothing_to_say_says_that_it_is_alive(start, loop, host):
    driver, _ = start(quick=True)
    heard = []
    driver._module._take[ALIVE] = heard.append
    loop.run_until(lambda: len(heard) == 3)
    assert host.failures == []


def test_module_in_a_slot_that_stays_silent_is_stuck(start, loop, host):
    host.slot = "v2x"
    start("down=1", wait=False, silent_s=60.0)
    loop.run_until(lambda: links(host))
    pass_by(loop, 59)
    assert host.failures == []
    pass_by(loop, 2)
    assert isinstance(host.failures[0], StuckError)
    assert tells(host.failures[0].message, "module 192.168.1.3 ", "not answered", "60 s: ", "Caster create: ")


def test_a_module_that_falls_silent_has_the_whole_time_again(start, loop, host):
    host.slot = "v2x"
    _, radio = start(silent_s=60.0)
    pass_by(loop, 600)
    assert host.failures == []
    radio.control.ask("down=1")
    loop.run_until(lambda: not host.is_up)
    pass_by(loop, 59)
    assert host.failures == []
    pass_by(loop, 2)
    assert isinstance(host.failures[0], StuckError)


def test_a_module_without_a_slot_may_stay_silent_for_ever(start, loop, host):
    start("down=1", wait=False, silent_s=60.0)
    loop.run_until(lambda: links(host))
    pass_by(loop, 10_000)
    assert host.failures == []


# The library fails.


def test_a_crash_of_the_library_is_a_failure_and_the_next_start_works(start, loop, host, air):
    driver, radio = start()
    radio.control.say("crash=1")
    loop.run_until(lambda: host.failures)
    assert host.failures[0].message == f"the process for {library()} ended, SIGSEGV"
    driver.start(host)
    loop.run_until(lambda: len(links(host)) == 2)
    air.say(CAM, radio)
    loop.run_until(lambda: host.count)
    assert host.details[-1]["restarts"] == 1


@pytest.mark.parametrize(("call", "text"), [("rx", "eu_caster_rx_timeout of caster 0 rx"), ("tx", "eu_caster_tx of")])
def test_call_that_does_not_return_is_a_failure(start, loop, host, call, text):
    driver, radio = start(quick=True)
    radio.control.ask(f"hang={call}")
    if call == "tx":
        assert driver.send(request(CAM)) is Sent.LATER
    loop.run_until(lambda: host.failures)
    assert text in host.failures[0].message or call == "rx"
    assert tells(host.failures[0].message, "not returned", "0.4 s")
    assert driver.send(request(CAM)) is Sent.BUSY


def test_library_that_cannot_be_initialised_is_a_failure_with_its_code(start, loop, host):
    start("fail=init:-6146:1", wait=False)
    loop.run_until(lambda: host.failures)
    assert host.failures[0].message.endswith(" (-6146)")


def test_a_library_without_the_calls_is_named_and_loaded_no_more_before_it_changes(start, loop, host, tmp_path):
    other = tmp_path / "libeu_v2xcast.so"
    other.write_bytes(_some_library().read_bytes())
    driver, _ = start(wait=False, library=str(other))
    loop.run_until(lambda: host.failures)
    assert "has no eu_caster_init, eu_caster_deinit" in host.failures[0].message
    for _ in range(3):
        with pytest.raises(InterfaceError, match="has no eu_caster_init"):
            driver.start(host)
    other.unlink()
    other.write_bytes(Path(library()).read_bytes())
    driver.start(host)
    loop.run_until(lambda: host.is_up)


def _some_library():
    """Return a shared library that exists on every machine that runs this test."""
    import _ctypes

    return Path(_ctypes.__file__)


def test_a_library_without_a_path_is_found_beside_the_configuration(start, loop, host, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    driver = SimulatedRadio().driver(library="libeu_v2xcast.so")
    with pytest.raises(
        InterfaceError, match=r"libeu_v2xcast\.so: not found in lib, /usr/local/lib, /usr/lib"
    ) as caught:
        driver.start(host)
    assert "into lib/ of its card" in caught.value.hint
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib/libeu_v2xcast.so").write_bytes(Path(library()).read_bytes())
    start(library="libeu_v2xcast.so")
    assert host.is_up


def test_library_that_is_absent_is_refused_with_its_option(host):
    driver = SimulatedRadio().driver(library="/nowhere/libeu_v2xcast.so")
    with pytest.raises(InterfaceError) as caught:
        driver.start(host)
    assert tells(caught.value.message, "/nowhere/libeu_v2xcast.so: ", "opened: ", os.strerror(errno.ENOENT))
    assert "option library" in caught.value.hint
    assert host.links == host.failures == []
