"""A receiver is found, configured and supervised; its fixes are those of the drive that is simulated."""

import re

import pytest

from board.runtime.errors import ConfigurationError, InterfaceError, RequestError, StuckError
from board.time.scales import Carrier, FixKind
from drivers.contract import Can, Operated
from drivers.gnss.driver import ZedF9p
from drivers.gnss.options import GnssOptions
from drivers.sim.machine import SimulatedDevice, SimulatedInterface, SimulatedMachine
from drivers.sim.receiver.habits import Habits
from drivers.sim.receiver.receiver import Receiver
from drivers.wire.gnss import nmea
from drivers.wire.ublox.health import MonVer
from drivers.wire.ublox.messages import encode
from drivers.wire.ublox.time import TimTp
from drivers.wire.ublox.ubx import Kind
from tests.drivers.gnss.receiver import UTC
from tests.drivers.host import SHARED, request
from tests.drivers.test_contract import descriptors, sources
from tests.said import tells

PATIENCE_S = 0.0  # ptys tell when octets are on their way
UART = Habits(port="uart1")
SIGNALS = "CFG-MSGOUT-UBX_SEC_SIG_USB"


def test_a_receiver_from_the_factory_is_configured_and_gives_fixes(make_receiver, loop):
    one = make_receiver().up()
    host, memory = one.host, one.receiver.memory
    assert [is_up for is_up, _ in host.links] == [False, True]
    assert host.links[1][1].startswith("ZED-F9P HPG 1.32 at ")
    fix = host.fixes[-1]
    motion = one.track.at(fix.utc_ns / 1e9 - UTC)
    assert (fix.kind, fix.carrier) == (FixKind.FULL, Carrier.NONE)
    assert (fix.latitude, fix.longitude, fix.altitude) == motion[:3]
    assert (fix.speed, fix.heading, fix.horizontal, fix.satellites) == (13_900, motion.heading, 1200, 28)
    assert memory.value("CFG-USBOUTPROT-NMEA") == 0
    assert memory.value("CFG-NAVSPG-DYNMODEL") == 4
    assert memory.value("CFG-TP-LEN_TP1") == 0
    assert memory.value("CFG-TP-ANT_CABLEDELAY") == 50
    assert memory.flash_writes == 0
    assert host.drops == {}


def test_its_epochs_come_at_the_rate_that_is_wanted(make_receiver, loop):
    one = make_receiver(rate_hz=10, dynamics="pedestrian", antenna_delay_ns=-20).up()
    before = len(one.host.fixes)
    loop.run_for(2.05)
    assert len(one.host.fixes) - before == 20
    assert one.receiver.memory.value("CFG-NAVSPG-DYNMODEL") == 3
    assert one.receiver.memory.value("CFG-TP-ANT_CABLEDELAY") == -20


def test_a_time_mark_comes_once_a_second_and_names_the_second_that_follows(make_receiver, loop):
    one = make_receiver(rate_hz=5).up()
    del one.host.time_marks[:]
    loop.run_for(4)
    marks = one.host.time_marks
    assert [mark.utc_s - marks[0].utc_s for mark in marks] == [0, 1, 2, 3]
    for mark in marks:
        said = one.gps_s() - 18 + UTC - (one.receiver.habits.gps_s - 18) - (loop.now - mark.monotonic)
        assert 0 < mark.utc_s - said < 1
        assert (mark.is_locked, mark.accuracy_ns, mark.leap_seconds) == (True, 22, 18)
        assert -4000 <= mark.quantisation_ps < 4000


def test_a_pulse_that_is_announced_before_the_first_epoch_is_not_trusted(make_receiver, loop):
    one = make_receiver().start()
    loop.run_until(lambda: "module" in one.details())
    one.receiver.say(encode(TimTp(1000, 0, 0, 2400, 3, 0x30)))
    loop.run_until(lambda: one.host.time_marks)
    mark = one.host.time_marks[0]
    assert (mark.utc_s, mark.is_locked, mark.leap_seconds) == (None, False, None)


def test_without_pulses_there_are_no_time_marks(make_receiver, loop):
    one = make_receiver(pulse=False).up()
    loop.run_for(3)
    assert one.host.time_marks == []
    assert one.receiver.memory.value("CFG-TP-TP1_ENA") == 0


def test_a_uart_at_the_rate_of_the_factory_is_found_and_made_faster(make_receiver):
    one = make_receiver(UART).up()
    assert one.receiver.memory.baud == 230_400
    assert one.receiver.memory.value("CFG-UART1OUTPROT-NMEA") == 0


def test_a_uart_that_has_our_rate_already_is_left_at_it(make_receiver):
    one = make_receiver(UART).up().again().up()
    rates = [
        frame for frame in one.receiver.requests if frame.kind == Kind.CFG_VALSET and b"\1\0\x52\x40" in frame.payload
    ]
    assert len(rates) == 1
    assert one.details()["garbage_octets"] == 0


@pytest.mark.parametrize("baud", [9600, 38_400, 115_200, 921_600])
def test_any_rate_may_be_wanted(make_receiver, baud):
    assert make_receiver(UART, baud=baud).up().receiver.memory.baud == baud


def test_a_firmware_without_signal_security_is_told_of_jamming_by_other_messages(make_receiver, loop, caplog):
    one = make_receiver(
        Habits(unknown=(SIGNALS,), version=MonVer("EXT CORE 1.00", "00190000", ("PROTVER 27.11",)))
    ).up()
    assert one.details()["refused"] == [SIGNALS]
    assert one.receiver.memory.value("CFG-ITFM-ENABLE") == 1
    assert f"does not know {SIGNALS}" in caplog.text
    one.receiver.sky = one.receiver.sky.__class__(jamming=3, spoofing=2)
    loop.run_for(2)
    details = one.details()
    assert (details["jamming"], details["spoofing"], details["firmware"]) == ("critical", "indicated", "EXT CORE 1.00")


def test_several_keys_that_are_not_known_are_found_among_those_that_are(make_receiver):
    unknown = ("CFG-TP-ALIGN_TO_TOW_TP1", "CFG-TP-USE_LOCKED_TP1", "CFG-RATE-TIMEREF", SIGNALS)
    one = make_receiver(Habits(unknown=unknown)).up()
    assert set(one.details()["refused"]) == set(unknown)
    assert one.receiver.memory.value("CFG-TP-LEN_LOCK_TP1") == 100_000


def test_a_receiver_that_refuses_epochs_is_named_as_too_old(make_receiver, loop):
    one = make_receiver(Habits(unknown=("CFG-MSGOUT-UBX_NAV_PVT_USB",))).start()
    loop.run_until(lambda: one.host.failures)
    assert "refuses CFG-MSGOUT-UBX_NAV_PVT_USB" in one.host.failures[0].message
    assert "HPG 1.32" in one.host.failures[0].hint


def test_receiver_that_acknowledges_nothing_is_a_fault(make_receiver, loop):
    one = make_receiver().start()
    one.receiver.acknowledges = False
    loop.run_until(lambda: one.host.failures)
    assert tells(one.host.failures[0].message, "not acknowledge", "ports")


def test_acknowledgements_that_are_lost_now_and_then_are_asked_for_again(make_receiver, loop):
    one = make_receiver().start()
    one.receiver.acknowledges = False
    loop.run_for(1.5)
    one.receiver.acknowledges = True
    loop.run_until(one.has_fix)
    assert one.host.failures == []


def test_receiver_that_does_not_answer_fails_by_its_port_and_is_stuck_after_three_times(make_receiver, loop):
    one = make_receiver(UART)
    one.receiver.is_mute = True
    for failure in range(3):
        one.start()
        loop.run_until(lambda failure=failure: len(one.host.failures) > failure, within=20)
        one.driver.stop()
    texts = {error.message for error in one.host.failures}
    (text,) = texts
    assert tells(text, f"{one.options.port}: ", "u-blox", "230400 and 38400 baud")
    assert [isinstance(error, StuckError) for error in one.host.failures] == [False, False, True]


def test_what_speaks_nmea_alone_is_told_apart(make_receiver, loop):
    one = make_receiver(Habits(speaks_ubx=False)).start()
    loop.run_until(lambda: one.host.failures)
    assert 'kind = "nmea"' in one.host.failures[0].hint


def test_it_is_kept_in_flash_once_and_not_written_again(make_receiver, loop):
    one = make_receiver(UART, save=True).up()
    writes = one.receiver.memory.flash_writes
    assert writes == 8  # a group each, and the rate
    one.again(save=True).up()
    assert one.receiver.memory.flash_writes == writes
    one.again(save=True, antenna_delay_ns=77).up()
    assert one.receiver.memory.flash_writes == writes + 1
    one.driver.stop()
    one.receiver.power(False)
    one.receiver.power(True)
    loop.run_until(lambda: one.receiver.boots == 2)
    assert (one.receiver.memory.baud, one.receiver.memory.value("CFG-TP-ANT_CABLEDELAY")) == (230_400, 77)


def test_a_port_that_another_program_has_is_not_taken(make_receiver, loop):
    one = make_receiver().up()
    with pytest.raises(InterfaceError, match="in use by another program"):
        ZedF9p(one.options, SHARED).start(one.host)


def test_a_receiver_in_a_slot_is_found_by_its_place(loop, host, tmp_path):
    machine = SimulatedMachine(tmp_path)

    def appeared(path):
        acm = SimulatedInterface(0, "cdc_acm", path)
        machine.plug("1-1.1", SimulatedDevice("1546", "01a9", [acm], "u-blox AG", "u-blox GNSS receiver"))

    receiver = Receiver(loop, appeared=appeared, vanished=lambda: machine.unplug("1-1.1"))
    machine.sit("1-1.1", receiver.power)
    driver = ZedF9p(GnssOptions(usb="1-1.1", rate_hz=1), SHARED._replace(machine=machine.machine))
    with pytest.raises(InterfaceError, match=re.escape("1-1.1")):
        driver.start(host)
    loop.run_until(lambda: receiver.boots)
    driver.start(host)
    loop.run_until(lambda: host.fixes)
    assert host.is_up
    driver.stop()
    receiver.unplug()
    machine.close()


def test_it_carries_no_messages(make_receiver):
    one = make_receiver().start()
    assert one.driver.capabilities.can == Can.POSITION | Can.TIMEMARK
    assert isinstance(one.driver, Operated)
    with pytest.raises(RequestError, match="sends nothing"):
        one.driver.send(request(b"\2\2\0\0\0\1"))


def test_stopped_at_any_moment_it_leaves_nothing_behind(make_receiver, loop):
    one = make_receiver()
    one.driver.stop()
    before, others = descriptors(), sources(loop)
    for moment in (0.0, 0.01, 0.3, 2.0):
        one.start()
        loop.run_for(moment)
        one.driver.stop()
        one.driver.stop()
        assert (descriptors(), sources(loop)) == (before, others)
    told = len(one.host.links)
    loop.run_for(5)
    assert (len(one.host.links), one.host.failures) == (told, [])
    one.receiver.unplug()
    loop.run_for(2)
    assert loop.delay() is None


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ({}, "one of usb, port and i2c"),
        ({"usb": "1-1.1", "port": "/dev/ttyACM0"}, "one of usb, port and i2c"),
        ({"kind": "static"}, "no latitude"),
        ({"port": "/dev/ttyACM0", "corrections": "tcp://caster.example:2101"}, "invalid IPv4 address"),
        ({"port": "/dev/ttyACM0", "kind": "nmea", "corrections": "/tmp/x"}, 'corrections: needs kind = "ubx"'),
    ],
)
def test_options_that_contradict_each_other_are_explained(options, what):
    with pytest.raises(ConfigurationError, match=what):
        GnssOptions(**options)


def test_a_surveyed_position_is_told_every_second(loop, host):
    driver = ZedF9p(
        GnssOptions(kind="static", latitude=48.7668616, longitude=11.432068, altitude_m=420.5, accuracy_m=0.05), SHARED
    )
    assert driver.capabilities.can == Can.POSITION
    driver.start(host)
    loop.run_for(2.5)
    assert len(host.fixes) == 3
    fix = host.fixes[-1]
    assert fix[1:6] == (FixKind.FULL, 487_668_616, 114_320_680, 420_500, 50)
    assert fix.utc_ns is None
    loop.run_for(10)
    assert [is_up for is_up, _ in host.links] == [True]
    driver.stop()
    assert loop.delay() is None


def test_receiver_of_nmea_gives_positions_and_the_time_of_day(make_receiver, loop):
    one = make_receiver(Habits(speaks_ubx=False), kind="nmea").up()
    assert one.driver.capabilities.can == Can.POSITION
    fix = one.host.fixes[-1]
    motion = one.track.at(fix.utc_ns / 1e9 - UTC)
    assert (fix.latitude, fix.longitude, fix.altitude) == motion[:3]
    assert one.host.links[-1][1].startswith("NMEA receiver, talker GN, at ")
    one.receiver.is_mute = True
    loop.run_until(lambda: not one.host.is_up)
    assert one.host.links[-1][1].endswith("no epoch for 3 s")
    one.receiver.is_mute = False
    loop.run_until(lambda: one.host.is_up)
    one.receiver.is_mute = True
    loop.run_until(lambda: one.host.failures)
    assert tells(one.host.failures[0].message, "no data", "38400 baud")


def test_receiver_of_nmea_without_a_position_is_never_up_and_soon_a_fault(make_receiver, loop):
    one = make_receiver(Habits(speaks_ubx=False), kind="nmea").start()
    one.receiver.is_mute = True
    for _ in range(30):
        one.receiver.say(nmea.encode("GPGSA,A,1,,,,,,,,,,,,,99.9,99.9,99.9"))
        loop.run_for(0.6)
    assert not any(is_up for is_up, _ in one.host.links)
    assert tells(one.host.failures[0].message, "sentences", "no position")
