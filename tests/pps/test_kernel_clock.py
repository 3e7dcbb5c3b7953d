"""Answer of adjtimex, field by field."""

import subprocess
from pathlib import Path

import pytest

from pps.kernel_clock import STA_DEL, STA_INS, STA_UNSYNC, TIMEX, State, kernel_clock, parsed

FIELDS = ("modes", "offset", "freq", "maxerror", "esterror", "status", "constant", "precision", "tolerance", "time.tv_sec",
          "time.tv_usec", "tick", "ppsfreq", "jitter", "shift", "stabil", "jitcnt", "calcnt", "errcnt", "stbcnt", "tai")  # fmt: skip


def timex(**fields: int) -> bytes:
    return TIMEX.pack(*(fields.get(name, 0) for name in FIELDS))


def test_each_field_is_where_the_c_compiler_has_it(tmp_path: Path) -> None:
    lines = "\n".join(f'printf("%lld\\n", (long long)t.{name});' for name in FIELDS)
    (tmp_path / "timex.c").write_text(f"""
        #include <stdio.h>
        #include <sys/timex.h>
        int main(void) {{
            struct timex t;
            if (fread(&t, 1, sizeof t + 1, stdin) != sizeof t) return 1;
            {lines}
        }}""")
    subprocess.run(["gcc", "-o", tmp_path / "timex", tmp_path / "timex.c"], check=True)
    octets = timex(**{name: number for number, name in enumerate(FIELDS, 1)})

    read = subprocess.run([tmp_path / "timex"], input=octets, capture_output=True, check=True).stdout.split()
    assert [int(one) for one in read] == list(range(1, len(FIELDS) + 1))


def test_a_synchronised_clock_has_a_bound() -> None:
    clock = parsed(0, timex(freq=-65536, maxerror=1500, esterror=20, tai=37))

    assert clock.is_synchronised
    assert (clock.frequency_ppb, clock.estimated_error_ns, clock.tai_offset_s) == (-1000.0, 20_000, 37)
    assert clock.uncertainty_ns == clock.maximum_error_ns == 1_500_000


@pytest.mark.parametrize(("state", "status"), [(5, 0), (0, STA_UNSYNC), (5, STA_UNSYNC)])
def test_one_that_nobody_steers_has_none(state: int, status: int) -> None:
    clock = parsed(state, timex(status=status, maxerror=16_000_000))

    assert not clock.is_synchronised
    assert clock.uncertainty_ns is None
    assert clock.tai_offset_s is None


@pytest.mark.parametrize(("status", "state", "leap"), [(STA_INS, 1, 1), (STA_DEL, 2, -1), (0, 4, 0)])
def test_what_the_kernel_will_do_at_the_end_of_the_day(status: int, state: int, leap: int) -> None:
    clock = parsed(state, timex(status=status))

    assert (clock.state, clock.leap) == (State(state), leap)


def test_this_machine_tells_without_rights() -> None:
    clock = kernel_clock()

    assert clock.is_synchronised == (clock.uncertainty_ns is not None)
    assert 0 <= clock.maximum_error_ns <= 16 * 10**9 or not clock.is_synchronised
