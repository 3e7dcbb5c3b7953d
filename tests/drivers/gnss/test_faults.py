"""Faults of a receiver: tunnel, jamming, reset, silence, garbage, jump, unknown time."""

import calendar
from dataclasses import replace
from itertools import pairwise

import pytest

from board.runtime.errors import InterfaceError, RequestError
from board.time.leaps import BUILT_IN, Leaps
from board.time.scales import GPS_EPOCH, GPS_LEAD, FixKind
from drivers.reason import Reason
from drivers.sim.receiver import messages as says
from drivers.sim.receiver.habits import Habits
from drivers.wire.gnss.time import Leap
from tests.drivers.gnss.receiver import UTC
from tests.said import tells

PATIENCE_S = 0.0  # ptys tell when octets are on their way
UART = Habits(port="uart1")
MIDNIGHT = calendar.timegm((2017, 1, 1, 0, 0, 0))
EVENT = MIDNIGHT - GPS_EPOCH + 17


def test_in_a_tunnel_the_link_stays_up_and_fixes_say_that_there_is_none(make_receiver, loop):
    one = make_receiver().up()
    one.receiver.sky = replace(one.receiver.sky, satellites=0)
    loop.run_for(10.5)
    fix = one.host.fixes[-1]
    assert (fix.kind, fix.latitude, fix.satellites) == (FixKind.NONE, None, 0)
    assert fix.utc_ns is not None
    assert not one.host.time_marks[-1].is_locked
    assert one.details()["fix"] == "none"
    one.receiver.sky = replace(one.receiver.sky, satellites=25)
    loop.run_until(one.has_fix)
    assert one.host.links[-1][0]
    assert len(one.host.links) == 2
    assert one.details()["jumps"] == 0


def test_jamming_spoofing_and_the_antenna_are_told_and_logged_once(make_receiver, loop, caplog):
    caplog.set_level("INFO", "captain.gnss")
    one = make_receiver().up()
    loop.run_for(2.5)
    caplog.clear()
    quiet = one.receiver.sky
    one.receiver.sky = replace(quiet, jamming=3, spoofing=2, antenna=3)
    loop.run_for(5.5)
    told = one.host.details[-1]
    assert (told["jamming"], told["spoofing"], told["antenna"]) == ("critical", "indicated", "short circuit")
    assert [record.message for record in caplog.records] == [
        "bench: antenna: short circuit, was ok",
        "bench: jamming: critical, was none",
        "bench: spoofing: indicated, was none",
    ]
    caplog.clear()
    one.receiver.sky = quiet
    loop.run_for(3.5)
    assert len(caplog.records) == 3
    assert one.host.details[-1]["jamming"] == "none"


def test_from_a_cold_start_no_second_is_named_before_leap_seconds_come_from_satellites(make_receiver, loop):
    one = make_receiver(Habits(leap_s=20.0, default_leap=16)).up()
    loop.run_for(3.5)
    assert one.host.fixes[-1].utc_ns is None
    mark = one.host.time_marks[-1]
    assert (mark.utc_s, mark.is_locked, mark.leap_seconds) == (None, False, None)
    assert mark.its_s == int(one.gps_s()) + 1 - GPS_LEAD
    details = one.details()
    assert (details["leap_source"], details["leap_seconds"], details["utc_resolved"]) == ("firmware", None, False)
    loop.run_until(lambda: one.host.time_marks[-1].is_locked)
    loop.run_for(1.5)
    # The fix of this very second may still be on its way.
    now = UTC + int(one.gps_s() - one.receiver.habits.gps_s)
    loop.run_until(lambda: round(one.host.fixes[-1].utc_ns / 1e9) >= now)
    assert round(one.host.fixes[-1].utc_ns / 1e9) == now
    assert one.details()["leap_source"] == "gps"
    assert all(mark.utc_s is None or mark.is_locked for mark in one.host.time_marks)
    seconds = [mark.its_s for mark in one.host.time_marks if mark.its_s is not None]
    assert seconds == list(range(seconds[0], seconds[0] + len(seconds)))


@pytest.mark.parametrize("repeats", [False, True])
@pytest.mark.parametrize("rate_hz", [1, 5])
def test_across_a_leap_second_each_pulse_and_each_epoch_has_its_second(make_receiver, loop, repeats, rate_hz):
    habits = Habits(gps_s=EVENT - 9, leap=Leap(17, EVENT, 1), repeats=repeats, fix_s=1.0, leap_s=1.0)
    one = make_receiver(habits, rate_hz=rate_hz).up()
    loop.run_for(1.5)
    change = one.details()["leap_change"]
    assert change == {"seconds": 1, "unix": MIDNIGHT}
    del one.host.time_marks[:], one.host.fixes[:]
    loop.run_until(lambda: one.gps_s() > EVENT + 3.5)
    seconds = [mark.utc_s - MIDNIGHT for mark in one.host.time_marks]
    assert seconds == [*range(seconds[0], 0), -1, *range(seconds[-1] + 1)]
    assert all(mark.is_locked for mark in one.host.time_marks)
    epochs = [round(fix.utc_ns / 1e9 - MIDNIGHT, 3) for fix in one.host.fixes]
    steps = {round(later - earlier, 3) for earlier, later in pairwise(epochs)}
    assert steps <= {round(1 / rate_hz, 3), round(1 / rate_hz - 1, 3)}
    last = one.host.time_marks[-1]
    assert (last.leap_seconds, last.leap_event) == (18, None)
    assert one.host.time_marks[0].leap_event == (EVENT - GPS_LEAD, 1)
    counted = [mark.its_s + GPS_LEAD - EVENT for mark in one.host.time_marks]
    assert counted == list(range(seconds[0], seconds[0] + len(seconds)))
    utc = [told_by(one.host.time_marks, mark.its_s) for mark in one.host.time_marks]
    at = counted.index(0)
    assert utc[at - 1 : at + 2] == ["2016-12-31T23:59:59", "2016-12-31T23:59:60", "2017-01-01T00:00:00"]


def told_by(marks, its_s):
    """UTC of a second as the table has it that began in 2016 and heard the marks, one after the other."""
    leaps = Leaps(BUILT_IN.rows[:-1], "a list of 2016", None)
    for mark in marks:
        leaps = leaps.told(mark.leap_seconds, mark.leap_event, mark.its_s)
        assert leaps.unix_ns(mark.its_s * 10**9) == mark.utc_s * 10**9
    return leaps.civil(its_s * 10**9)[:19]


@pytest.mark.parametrize("rate_hz", [1, 5])
def test_a_second_that_is_left_out_is_left_out_of_utc_and_not_of_its_time(make_receiver, loop, rate_hz):
    event = says.gps_of(2027, 6, 30, 23, 59, 59)
    one = make_receiver(Habits(gps_s=event - 9, leap=Leap(18, event, -1), fix_s=1.0, leap_s=1.0), rate_hz=rate_hz).up()
    loop.run_for(1.5)
    del one.host.time_marks[:]
    loop.run_until(lambda: one.gps_s() > event + 3.5)
    assert [mark.its_s + GPS_LEAD - event for mark in one.host.time_marks] == list(range(-4, 5))
    midnight = calendar.timegm((2027, 7, 1, 0, 0, 0))
    assert [mark.utc_s - midnight for mark in one.host.time_marks] == [*range(-5, -1), *range(5)]
    assert all(mark.is_locked for mark in one.host.time_marks)
    assert one.host.time_marks[0].leap_event == (event - GPS_LEAD, -1)
    leaps = BUILT_IN
    for mark in one.host.time_marks:
        leaps = leaps.told(mark.leap_seconds, mark.leap_event, mark.its_s)
        assert leaps.unix_ns(mark.its_s * 10**9) == mark.utc_s * 10**9
    assert leaps.civil((event - GPS_LEAD) * 10**9) == "2027-07-01T00:00:00.000Z"


def test_a_sky_may_say_wrong_seconds_or_leave_words_out(make_receiver, loop):
    one = make_receiver().up()
    loop.run_for(0.5)  # between two epochs
    quiet = one.receiver.sky
    for sky in (replace(quiet, mark_error_s=1), replace(quiet, epoch_error_s=-1), quiet):
        one.receiver.sky = sky
        loop.run_for(1.0)
        mark, fix = one.host.time_marks[-1], one.host.fixes[-1]
        assert mark.its_s + GPS_LEAD == int(one.gps_s()) + 1 + sky.mark_error_s
        assert fix.tow_ms == (int(one.gps_s()) + sky.epoch_error_s) % 604_800 * 1000
        assert round(fix.utc_ns / 1e9) == GPS_EPOCH + int(one.gps_s()) - 18 + sky.epoch_error_s
    one.receiver.sky = replace(quiet, is_locked=False, time_accuracy_ns=3_000_000)
    loop.run_for(1.0)
    assert (one.host.time_marks[-1].is_locked, one.host.time_marks[-1].accuracy_ns) == (False, 3_000_000)
    marks, fixes = len(one.host.time_marks), len(one.host.fixes)
    one.receiver.sky = replace(quiet, has_marks=False)
    loop.run_for(1.0)
    assert (len(one.host.time_marks), len(one.host.fixes)) == (marks, fixes + 1)
    one.receiver.sky = replace(quiet, has_epochs=False)
    loop.run_for(1.0)
    assert (len(one.host.time_marks), len(one.host.fixes)) == (marks + 1, fixes + 1)


def test_across_the_end_of_a_week_seconds_go_on(make_receiver, loop):
    one = make_receiver(Habits(gps_s=2400 * 604_800 - 6)).up()
    loop.run_until(lambda: one.gps_s() > 2400 * 604_800 + 3)
    seconds = [mark.utc_s for mark in one.host.time_marks if mark.is_locked]
    assert seconds == list(range(seconds[0], seconds[0] + len(seconds)))
    assert seconds[-1] > GPS_EPOCH + 2400 * 604_800 - 18


def test_jump_of_100_km_is_logged_and_withheld_until_epochs_agree(make_receiver, loop, caplog):
    one = make_receiver().up()
    before = len(one.host.fixes)
    one.receiver.sky = replace(one.receiver.sky, offset=9_000_000)
    loop.run_until(lambda: one.details()["withheld"] == 4)
    assert len(one.host.fixes) == before
    assert one.host.is_up
    assert "jumped by 100." in caplog.text
    loop.run_for(2.5)
    assert len(one.host.fixes) == before + 2
    assert one.host.fixes[-1].latitude > 496_000_000
    assert one.details()["jumps"] == 1
    assert caplog.text.count("jumped") == 1


def test_one_wrong_epoch_is_not_passed_on_and_the_next_right_one_is(make_receiver, loop):
    one = make_receiver().up()
    one.receiver.sky = replace(one.receiver.sky, offset=9_000_000)
    loop.run_until(lambda: one.details()["withheld"] == 1)
    one.receiver.sky = replace(one.receiver.sky, offset=0)
    before = len(one.host.fixes)
    loop.run_until(lambda: len(one.host.fixes) > before)
    assert all(fix.latitude is None or fix.latitude < 488_000_000 for fix in one.host.fixes)


def test_a_receiver_that_falls_silent_is_down_after_three_seconds_and_back_when_it_speaks(make_receiver, loop):
    one = make_receiver().up()
    since = one.host.fixes[-1].monotonic
    one.receiver.is_mute = True
    loop.run_until(lambda: not one.host.is_up)
    assert 3.0 <= loop.now - since <= 4.1
    assert "no epoch for 3 s" in one.host.links[-1][1]
    one.receiver.is_mute = False
    loop.run_until(lambda: one.host.is_up)
    assert one.details()["bringups"] == 2
    assert one.host.failures == []


def test_a_receiver_that_hangs_is_a_fault_with_a_name(make_receiver, loop):
    one = make_receiver().up()
    one.receiver.is_mute = True
    loop.run_until(lambda: one.host.failures)
    assert isinstance(one.host.failures[0], InterfaceError)
    assert "no u-blox receiver answers" in one.host.failures[0].message
    one.driver.stop()
    one.receiver.is_mute = False
    one.start()
    loop.run_until(lambda: one.host.is_up)


def test_receiver_that_acknowledges_everything_and_sends_no_epochs_is_never_up_and_soon_a_fault(make_receiver, loop):
    one = make_receiver(receiver_port="uart2").start()  # it is at its USB port
    loop.run_until(lambda: one.host.failures, within=20)
    assert not any(is_up for is_up, _ in one.host.links)
    assert tells(one.host.failures[0].message, "configured 3 times", "no epochs")
    assert one.host.failures[0].hint.startswith("set receiver_port to")
    assert "it is uart2 now" in one.host.failures[0].hint
    loop.run_for(20)
    assert len(one.host.failures) == 1


def test_one_that_sends_garbage_alone_is_a_fault_and_the_garbage_is_counted(make_receiver, loop):
    one = make_receiver().up()
    one.receiver.is_mute = True
    for _ in range(12):
        one.receiver.say(bytes(range(128, 256)) * 10)
        loop.run_for(0.5)
    assert one.host.drops[Reason.FRAMING] + one.host.drops[Reason.CHECKSUM] > 8
    loop.run_until(lambda: one.host.failures)
    assert len(one.host.failures) == 1


def test_garbage_between_messages_costs_none_of_them(make_receiver, loop):
    one = make_receiver().up()
    for _ in range(4):
        before = len(one.host.fixes)
        one.receiver.say(b"\xb5b\1\7\0\x20 garbage $ \xd3\0\x40")
        loop.run_until(lambda before=before: len(one.host.fixes) > before, within=2.2)
    assert one.host.is_up
    assert one.host.failures == []


def test_a_port_that_vanishes_is_told_at_once_and_the_receiver_comes_back(make_receiver, loop):
    one = make_receiver().up()
    one.receiver.unplug()
    loop.run_until(lambda: one.host.failures, within=1)
    assert one.host.failures[0].message.startswith(f"{one.options.port} is gone: ")
    one.driver.stop()
    with pytest.raises(InterfaceError):
        one.start()
    one.receiver.power(True)
    loop.run_until(lambda: one.receiver.boots == 2)
    one.again().up()


@pytest.mark.parametrize("kind", ["hot", "warm", "cold"])
def test_a_reset_of_navigation_keeps_the_configuration_and_the_link(make_receiver, loop, kind):
    one = make_receiver().up()
    assert one.operate("reset", kind=kind) == {"reset": kind}
    loop.run_until(lambda: one.host.fixes[-1].latitude is None)
    loop.run_until(one.has_fix)
    assert [is_up for is_up, _ in one.host.links] == [False, True]
    assert one.receiver.boots == 1


def test_a_full_reset_of_a_uart_is_found_out_and_brought_up_anew(make_receiver, loop):
    one = make_receiver(UART).up()
    one.operate("reset", kind="full")
    loop.run_until(lambda: not one.host.is_up)
    assert one.receiver.memory.baud == 38_400
    loop.run_until(lambda: one.host.is_up)
    assert one.receiver.memory.baud == 230_400
    assert one.host.failures == []


def test_a_full_reset_at_usb_is_an_unplugging(make_receiver, loop):
    one = make_receiver().up()
    one.operate("reset", kind="full")
    loop.run_until(lambda: one.host.failures)
    loop.run_until(lambda: one.receiver.boots == 2)
    one.again().up()


def test_what_an_operator_cannot_have_is_explained(make_receiver):
    one = make_receiver()
    one.start()
    answers = [one.operate("reset"), one.operate("reset", kind="lukewarm"), one.operate("dance")]
    assert all(isinstance(answer, RequestError) for answer in answers)
    assert "is not connected" in answers[0].message
    assert "hot, warm, cold, full" in answers[1].hint


def test_details_tell_all_of_it_once_a_second(make_receiver, loop):
    one = make_receiver(UART, antenna_delay_ns=5).up()
    loop.run_for(3.45)  # between two reports
    told = one.host.details[-1]
    assert told["module"] == "ZED-F9P"
    assert told["firmware"] == "HPG 1.32"
    assert told["protocol"] == "27.31"
    assert told["fix"] == "3d"
    assert told["satellites"] == 28
    assert told["antenna_power"] == "on"
    assert told["leap_seconds"] == 18
    assert told["age_s"] < 2
    before = len(one.host.details)
    loop.run_for(3)
    assert len(one.host.details) - before == 3


def test_the_second_of_a_mark_is_that_of_the_simulated_sky(make_receiver, loop):
    one = make_receiver(Habits(gps_s=says.gps_of(2026, 12, 31, 23, 59, 50))).up()
    loop.run_for(4.5)
    mark = one.host.time_marks[-1]
    assert mark.utc_s == GPS_EPOCH + int(one.gps_s()) - 18 + 1
