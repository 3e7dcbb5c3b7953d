"""Samples for chronyd, octet by octet; errors of its socket."""

import errno
import logging
import os
import socket
import struct
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import ConfigurationError
from board.runtime.journal import Journal
from board.time.scales import LeapEvent
from pps.chrony.configuration import SOCKET, access, configuration, refclock
from pps.chrony.feed import MEANING, Fate, Refclock, leap_bits, sample
from pps.pulse import Clocks, Pulse
from tests.said import tells

UNIX_S = 1_900_000_000
ITS_S = 827_084_805
PULSE = Pulse(1, UNIX_S * 10**9 - 250_123, 5_000 * 10**9, 5_000.0)
NOW = Clocks(PULSE.system_ns + 10**8, PULSE.raw_ns + 10**8, 5_000.1)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "pps.sock"


@pytest.fixture
def clock(path: Path) -> Iterator[Refclock]:
    made = Refclock(str(path), Journal(logging.getLogger("test"), "chrony", lambda: 0.0))
    yield made
    made.close()


@pytest.fixture
def far(path: Path) -> Iterator[socket.socket]:
    """chronyd's end."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as end:
        end.setblocking(False)
        end.bind(str(path))
        yield end


def give(clock: Refclock, **other: object) -> bool:
    how = {"pulse": PULSE, "its_s": ITS_S, "unix_ns": UNIX_S * 10**9, "leap": None, "now": NOW, **other}
    return clock.sample(**how)  # type: ignore[arg-type]


def test_a_sample_is_the_struct_that_chronyd_was_compiled_with(tmp_path: Path) -> None:
    (tmp_path / "sample.c").write_text(r"""
        #include <stdio.h>
        #include <stdint.h>
        #include <sys/time.h>
        /* refclock_sock.c */
        struct sock_sample { struct timeval tv; double offset; int pulse; int leap; int _pad; int magic; };
        int main(void) {
            struct sock_sample s;
            if (fread(&s, 1, sizeof s + 1, stdin) != sizeof s) return 1;
            printf("%lld %lld %.9f %d %d %x\n", (long long)s.tv.tv_sec, (long long)s.tv.tv_usec, s.offset, s.pulse,
                   s.leap, (unsigned)s.magic);
        }""")
    subprocess.run(["gcc", "-o", tmp_path / "sample", tmp_path / "sample.c"], check=True)

    def read(octets: bytes) -> str:
        return subprocess.run([tmp_path / "sample"], input=octets, capture_output=True, check=True).stdout.decode()

    assert read(sample(1_900_000_000_123_456_789, 1_900_000_000_000_000_000, 2)) == (
        "1900000000 123456 -0.123456789 0 2 534f434b\n"
    )
    assert read(sample(1_899_999_999_999_999_999, 1_900_000_000_000_000_000)) == (
        "1899999999 999999 0.000000001 0 0 534f434b\n"
    )


@given(system_ns=st.integers(0, 2**62), offset_ns=st.integers(-(10**12), 10**12))
def test_the_offset_is_that_of_the_stamp_to_the_nanosecond(system_ns: int, offset_ns: int) -> None:
    second, micro, offset, *_ = struct.unpack("@qqdiiii", sample(system_ns, system_ns + offset_ns))

    assert second * 10**6 + micro == system_ns // 1000
    assert round(offset * 1e9) == offset_ns


def test_a_second_is_told_to_chronyd(clock: Refclock, far: socket.socket) -> None:
    assert give(clock)

    assert far.recv(100) == sample(PULSE.system_ns, UNIX_S * 10**9, 0)
    assert clock.status() == {"path": clock.path, "feeds": True, "why": "", "samples": {"sent": 1}}


@pytest.mark.parametrize(
    ("ahead_s", "change", "bits"),
    [
        (86_401, 1, 0),
        (86_400, 1, 1),
        (86_400, -1, 2),
        (6, 1, 1),
        (-6, 1, 0),  # it is over
        (200 * 86_400, 1, 0),
    ],
)
def test_a_leap_second_is_told_in_the_day_before_it(
    clock: Refclock, far: socket.socket, ahead_s: int, change: int, bits: int
) -> None:
    assert give(clock, leap=LeapEvent(ITS_S + ahead_s, change))

    assert far.recv(100) == sample(PULSE.system_ns, UNIX_S * 10**9, bits)


def test_no_leap_second_is_none() -> None:
    assert leap_bits(None, ITS_S) == 0


@pytest.mark.parametrize("ahead_s", [-5, -1, 0, 1, 5])
def test_nothing_is_told_near_a_leap_second(clock: Refclock, far: socket.socket, ahead_s: int) -> None:
    assert not give(clock, leap=LeapEvent(ITS_S + ahead_s, 1))

    assert clock.counts == {Fate.LEAP: 1}
    with pytest.raises(BlockingIOError):
        far.recv(100)


def test_a_leap_second_that_is_announced_no_more_is_near_all_the_same(clock: Refclock, far: socket.socket) -> None:
    give(clock, leap=LeapEvent(ITS_S + 1, 1))

    assert not give(clock, its_s=ITS_S + 2)
    assert give(clock, its_s=ITS_S + 7)


@pytest.mark.parametrize("step_ns", [-(10**9), -100_000_000, -500_000, 20_000, 500_000, 20_000_000, 3_700_000_000])
def test_a_clock_stepped_since_the_pulse_makes_its_stamp_void(
    clock: Refclock, far: socket.socket, step_ns: int
) -> None:
    assert not give(clock, now=NOW._replace(system_ns=NOW.system_ns + step_ns))

    assert clock.counts == {Fate.STEPPED: 1}


@pytest.mark.parametrize("slew", [-0.084, 0.084])  # as far as the kernel goes
def test_a_clock_slewed_since_the_pulse_does_not(clock: Refclock, far: socket.socket, slew: float) -> None:
    gone_ns = int((1 + slew) * 10**8)  # of both clocks that are slewed
    now = NOW._replace(system_ns=PULSE.system_ns + gone_ns, monotonic=PULSE.monotonic + gone_ns / 1e9)
    assert give(clock, now=now)


def test_a_second_confirmed_too_late_is_left_out(clock: Refclock, far: socket.socket) -> None:
    assert not give(clock, now=Clocks(PULSE.system_ns + 3 * 10**9, PULSE.raw_ns + 3 * 10**9, 5_003.0))

    assert clock.counts == {Fate.OLD: 1}


def test_chronyd_that_is_absent_is_logged_once_and_tried_at_each_pulse(
    clock: Refclock, path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    for _ in range(5):
        assert not give(clock)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as far:
        far.bind(str(path))
        assert give(clock)
        assert give(clock)
    assert not give(clock)  # the socket is still there, and nobody behind it

    assert clock.counts == {Fate.ABSENT: 5, Fate.SENT: 2, Fate.REFUSED: 1}
    assert [record.levelname for record in caplog.records] == ["WARNING", "INFO", "WARNING"]
    assert tells(caplog.text, "chronyd ", "not running", "configuration")
    assert clock.status()["feeds"] is False
    assert clock.status()["why"] == MEANING[Fate.REFUSED]


def test_a_chronyd_that_hangs_is_not_waited_for(clock: Refclock, far: socket.socket) -> None:
    while give(clock):
        pass

    assert clock.counts[Fate.FULL] == 1
    far.recv(100)
    assert give(clock)


@pytest.mark.parametrize(
    ("number", "fate"),
    [
        (errno.EACCES, Fate.FORBIDDEN),
        (errno.EPERM, Fate.FORBIDDEN),
        (errno.ENOBUFS, Fate.FULL),
        (errno.ENOTDIR, Fate.ABSENT),
        (errno.EPROTOTYPE, Fate.REFUSED),
        (errno.ENOMEM, Fate.OTHER),
    ],
)
def test_what_the_system_refuses_has_a_name(
    clock: Refclock, caplog: pytest.LogCaptureFixture, number: int, fate: Fate
) -> None:
    class Refusing:
        def sendto(self, *_: object) -> None:
            raise OSError(number, os.strerror(number))

        def close(self) -> None: ...

    clock._socket.close()
    clock._socket = Refusing()  # type: ignore[assignment]

    assert not give(clock)
    assert clock.counts == {fate: 1}
    assert MEANING[fate] in caplog.text


def test_a_file_that_is_no_socket_is_refused(clock: Refclock, path: Path) -> None:
    path.write_text("")

    assert not give(clock)
    assert clock.counts == {Fate.REFUSED: 1}


def test_every_fate_has_a_meaning() -> None:
    assert set(MEANING) == set(Fate)


@pytest.mark.parametrize("path", ["", "relative.sock", "/run/with blank", "/run/a:b"])
def test_a_path_where_chronyd_cannot_make_a_socket_is_a_mistake_of_the_configuration(path: str) -> None:
    with pytest.raises(ConfigurationError, match="cannot make a socket there"):
        refclock(path)
    with pytest.raises(ConfigurationError, match="cannot make a socket there"):
        Refclock(path, Journal(logging.getLogger("test"), "chrony", lambda: 0.0))


def test_a_path_of_chronyds_socket_that_is_too_long_is_a_mistake_with_its_length() -> None:
    with pytest.raises(ConfigurationError, match=r"^time\.chrony: socket path too long: 108 octets"):
        refclock("/" + "x" * 107)


def test_what_no_pulse_shows_of_its_lateness_is_half_of_the_delay() -> None:
    assert " delay 8.0e-06 " in refclock(latency_ns=10_000)  # 2 to 10 us, of which 6 are taken off each sample
    assert f"refclock SOCK {SOCKET} refid PPS " in configuration()


def test_the_list_of_leap_seconds_is_a_file_or_a_timezone() -> None:
    assert "\nleapseclist /x/leap-seconds.list\n" in configuration(leaps="/x/leap-seconds.list")
    assert "\nleapsectz right/UTC\n" in configuration(leaps="right/UTC")


def test_the_station_s_group_alone_may_write_to_the_socket() -> None:
    assert access("v2x", "/run/chrony.x.sock").splitlines()[-2:] == [
        "ExecStartPost=+/bin/chgrp v2x /run/chrony.x.sock",
        "ExecStartPost=+/bin/chmod 0620 /run/chrony.x.sock",
    ]


def test_guide_chronyd_configuration_is_that_of_the_image() -> None:
    told = [line.strip() for line in (Path(__file__).parents[3] / "pps/guide/time.md").read_text().splitlines()]

    for line in (refclock() + access("captain")).splitlines():
        assert line.startswith("#") or line in told
