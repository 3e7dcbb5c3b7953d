"""The system's list of leap seconds: as it is, expired, damaged, denied, and which table is taken."""

import errno
import hashlib
import os
from calendar import timegm
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from board.runtime.errors import ConfigurationError, StationError
from board.time.leap_list import MOST, NTP_EPOCH, day, read_list
from board.time.leaps import BUILT_IN, LIST, Leaps, known, read
from board.time.scales import LEAPS, LEAPS_END
from tests.said import tells

# The list of the IERS of July 2025, as tzdata 2025b of Debian has it; it is in the public domain.
REAL = Path(__file__).parents[2] / "captures/leap-seconds.list"
MADE = timegm((2025, 7, 7, 0, 0, 0))
EXPIRES = LEAPS_END
NOW = timegm((2026, 1, 1, 0, 0, 0))
IN_2029 = timegm((2029, 1, 1, 0, 0, 0))
HISTORY = [(timegm((1999, 1, 1, 0, 0, 0)), 32), *((midnight, 33 + at) for at, midnight in enumerate(LEAPS))]


def listed(rows=HISTORY, updated=MADE, expires=EXPIRES, digest=""):
    """The text of a list, with its hash as NIST's program makes it: of digits alone."""
    stamps = [updated + NTP_EPOCH, expires + NTP_EPOCH]
    lines = [f"{midnight + NTP_EPOCH}\t{tai}\t# {day(midnight)}" for midnight, tai in rows]
    digits = "".join(map(str, stamps)) + "".join(f"{midnight + NTP_EPOCH}{tai}" for midnight, tai in rows)
    made = hashlib.sha1(digits.encode()).hexdigest()
    words = digest or " ".join(made[at : at + 8] for at in range(0, 40, 8))
    return "\n".join(["#\ttext", f"#$\t{stamps[0]}", f"#@\t{stamps[1]}", *lines, f"#h\t{words}", ""])


@pytest.fixture
def path(tmp_path):
    return tmp_path / "leap-seconds.list"


def refusal(path) -> str:
    with pytest.raises(ConfigurationError) as caught:
        read(str(path))
    assert str(path) in caught.value.message
    return caught.value.message


def test_the_list_of_the_iers_has_what_is_built_in():
    leaps = read(str(REAL))
    assert leaps == Leaps(BUILT_IN.rows, str(REAL), EXPIRES)
    assert day(EXPIRES) == "2026-06-28"


def test_the_list_of_this_system_is_read():
    assert Path(LIST).exists(), f"{LIST} is needed, of the package tzdata"
    assert read(LIST).rows[: len(LEAPS)] == BUILT_IN.rows


def test_a_list_may_begin_with_the_seconds_of_2004(path):
    path.write_text(listed())
    assert read(str(path)) == Leaps(BUILT_IN.rows, str(path), EXPIRES)


def test_a_list_tells_of_seconds_to_come_inserted_or_left_out(path):
    rows = [*HISTORY, (timegm((2027, 7, 1, 0, 0, 0)), 38), (timegm((2028, 1, 1, 0, 0, 0)), 37)]
    path.write_text(listed(rows, expires=IN_2029))
    leaps = read(str(path))
    assert [row.change for row in leaps.rows] == [1, 1, 1, 1, 1, 1, -1]
    assert leaps.civil(leaps.rows[5].its_s * 10**9) == "2027-06-30T23:59:60.000Z"
    assert leaps.civil((leaps.rows[6].its_s - 1) * 10**9) == "2027-12-31T23:59:58.000Z"
    assert leaps.civil(leaps.rows[6].its_s * 10**9) == "2028-01-01T00:00:00.000Z"


def test_words_of_the_hash_may_lack_leading_zeros_and_lines_end_as_they_like(path):
    for made in range(1000):
        text = listed(updated=EXPIRES - 1 - made)
        digest = text.split("#h\t")[1].strip()
        if " 00" in digest:
            break
    short = " ".join(word.lstrip("0") for word in digest.split())
    path.write_text(text.replace(digest, short.upper()).replace("\n", "\r\n"))
    assert read(str(path)).rows == BUILT_IN.rows


def test_list_from_before_the_last_leap_seconds_is_no_contradiction(path):
    path.write_text(listed(HISTORY[:4], timegm((2014, 1, 1, 0, 0, 0)), timegm((2014, 6, 28, 0, 0, 0))))
    assert read(str(path)).rows == BUILT_IN.rows[:3]
    leaps = known(str(path), NOW)
    assert leaps.source == "built in"
    assert tells(leaps.doubt, f"{path}: ", "expired on 2014-06-28; ", "built-in table", "used")
    doubt = known(str(path), EXPIRES).doubt
    assert tells(doubt, f"{path}: ", "expired on 2014-06-28", "built-in table", "2026-06-28; ", "tzdata")


# Which table is taken.


def test_a_list_that_holds_is_taken_and_without_one_what_is_built_in(path):
    path.write_text(listed())
    assert known(str(path), NOW) == read(str(path))
    assert known("", NOW) == BUILT_IN
    assert known(str(path), 0.0).source == str(path)  # a clock that is not set says nothing of a list


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("", ()),
        ("/no/such/list", ("/no/such/list: ", f"{os.strerror(errno.ENOENT)}; ")),
    ],
)
def test_built_in_table_is_doubted_once_it_may_lack_leap_seconds(name, why):
    leaps = known(name, EXPIRES)
    assert leaps.rows == BUILT_IN.rows
    assert tells(leaps.doubt, *why, "built-in table", "expired on 2026-06-28")
    assert (";" in leaps.doubt) is bool(why)


def test_a_list_that_expired_with_what_is_built_in_is_told_once(path):
    path.write_text(listed())
    assert known(str(path), EXPIRES).doubt == f"{path}: expired on 2026-06-28, like the built-in table; update tzdata"


def test_list_that_expired_is_used_only_if_it_has_more_leap_seconds(path):
    path.write_text(listed())
    assert known(str(path), EXPIRES - 1).doubt == ""
    assert known(str(path), EXPIRES).source == "built in"
    more = [*HISTORY, (timegm((2027, 7, 1, 0, 0, 0)), 38)]
    path.write_text(listed(more, expires=timegm((2027, 12, 28, 0, 0, 0))))
    leaps = known(str(path), IN_2029)
    assert leaps.source == str(path)
    assert tells(leaps.doubt, f"{path}: ", "expired on 2027-12-28", "used: ", "more", "built-in table")


def test_list_that_is_absent_is_named_with_its_reason_and_the_built_in_table_used(path):
    leaps = known(str(path), NOW)
    assert leaps.rows == BUILT_IN.rows
    assert tells(leaps.doubt, f"{path}: ", f"{os.strerror(errno.ENOENT)}; ", "built-in table", "used")


# What is refused.


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "no line that begins with #$"),
        (listed().replace("#@", "# "), "no line that begins with #@"),
        (listed().replace("#h", "# "), "no line that begins with #h"),
        (listed() + "#@\t1\n", "line 11: a second line that begins with #@"),
        (listed().replace("2005", "2006").replace("37\t", "36\t"), "SHA-1 mismatch"),
        (listed(digest="1 2 3 4 5"), "SHA-1 mismatch"),
        (listed(digest="1 2 3 4"), "#h '1 2 3 4' is not five hexadecimal words"),
        (listed(digest="g 2 3 4 5"), "is not five hexadecimal words"),
        (listed().replace("#@\t", "#@\tsoon"), "is not seconds since 1900"),
        (listed().replace("#@\t", "#@\t９"), "is not seconds since 1900"),
        (listed() + "3692217601 38 39\n", "neither a comment nor a leap second"),
        (listed() + "-3692217600 38\n", "neither a comment nor a leap second"),
        (listed() + "3692217600 three\n", "neither a comment nor a leap second"),
        (listed(expires=timegm((2025, 1, 1, 0, 0, 0))), "the list's date of expiry is before its date of update"),
        (listed([*HISTORY, (LEAPS_END + 86_400, 38)]), "the list expires before its own last leap second"),
        (listed([*HISTORY, (LEAPS_END + 1, 38)]), "is not midnight"),
        (listed(HISTORY[::-1]), "cannot follow"),
        (listed([*HISTORY, HISTORY[-1]]), "cannot follow"),
        (listed([*HISTORY, (HISTORY[-1][0] + 86_400, 39)]), "39 s on 2017-01-02 cannot follow 37 s"),
        (listed(HISTORY[1:]), "TAI - UTC in 2004 is not 32 s"),
        (listed([(midnight, tai + 1) for midnight, tai in HISTORY]), "TAI - UTC in 2004 is not 32 s"),
        (listed([]), "TAI - UTC in 2004 is not 32 s"),
        (listed(HISTORY[:-1]), "it lacks the leap second before 2017-01-01"),
        (listed([*HISTORY, (timegm((2020, 1, 1, 0, 0, 0)), 38)]), "it has an additional leap second before 2020-01-01"),
        (listed([*HISTORY[:-1], (LEAPS[-1], 35)]), "it lacks the leap second before 2017-01-01"),
    ],
)
def test_a_list_that_cannot_be_right_is_refused_by_name(path, text, why):
    path.write_text(text)
    assert why in refusal(path)


def test_octets_that_are_no_text_are_refused(path):
    path.write_bytes(listed().encode() + b"#\xff\xfe\n")
    assert "not UTF-8" in refusal(path)


def test_a_list_that_is_too_long_is_refused(path):
    path.write_text(listed() + "#" * MOST)
    assert f"more than {MOST} octets" in refusal(path)
    path.write_text(listed().ljust(MOST, "\n"))
    assert read(str(path)).rows == BUILT_IN.rows


def test_what_is_no_file_is_refused_and_nothing_waits_for_it(path):
    assert "is not a file" in refusal("/dev/zero")
    assert "Is a directory" in refusal(path.parent)
    os.mkfifo(path)
    assert "is not a file" in refusal(path)
    assert "cannot be read: Not a directory" in refusal("/dev/null/list")
    assert "cannot be read: " in refusal("/tmp/\0")
    assert "embedded null" in refusal("/tmp/\0")


@given(
    at=st.integers(0, len(REAL.read_bytes()) - 1),
    cut=st.integers(0, 3),
    put=st.binary(max_size=3),
)
@settings(deadline=None, max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_list_that_was_changed_anywhere_says_the_same_or_is_refused(path, at, cut, put):
    octets = REAL.read_bytes()
    path.write_bytes(octets[:at] + put + octets[at + cut :])
    try:
        found = read_list(str(path))
    except StationError:
        return
    assert found == read_list(str(REAL))


@given(octets=st.binary(max_size=300) | st.text(alphabet="#$@h 0123456789\n\t", max_size=300).map(str.encode))
@settings(deadline=None, max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_random_octets_are_refused(path, octets):
    path.write_bytes(octets)
    refusal(path)
