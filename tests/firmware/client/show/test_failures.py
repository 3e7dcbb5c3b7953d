"""Failures of a list's items: three of a kind, then their count."""

import subprocess
import sys

import pytest

from board.runtime.errors import RequestError
from firmware import cli
from firmware.client.show.failures import Failures
from tests.said import tells


def said(capsys, *errors: RequestError) -> list[str]:
    with Failures() as failures:
        for error in errors:
            failures.report(error)
    return capsys.readouterr().err.splitlines()


def invalid(line: int, letter: str = "z") -> RequestError:
    return RequestError(
        f"x.hex: line {line}: character {line % 7}, {letter!r}, is not a hexadecimal digit", "take others"
    )


def test_a_failure_is_told_with_its_hint(capsys):
    assert said(capsys, invalid(4)) == [
        "captain: x.hex: line 4: character 4, 'z', is not a hexadecimal digit",
        "  (take others)",
    ]


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_few_failures_are_all_told_with_one_hint(capsys, count):
    lines = said(capsys, *map(invalid, range(count)))
    assert len(lines) == count + 1
    assert lines[-1].startswith(f"captain: x.hex: line {count - 1}: " if count > 1 else "  (take")


def test_failures_of_one_kind_are_three_and_their_count_whatever_values_they_name(capsys):
    lines = said(capsys, *(invalid(line, "xyz"[line % 3]) for line in range(2003)))
    assert len(lines) == 5
    assert tells(lines[-1], "captain: 2000 more ", "last: x.hex: line 2002: character 0, 'y'")


def test_failures_of_one_kind_at_many_fields_are_three_and_their_count(capsys):
    fields = [f"cam.camParameters.{'ab' * number}" for number in range(1, 9)]
    lines = said(capsys, *(RequestError(f"x: line 1: cam-1.4.1: {field}: bit 7: truncated") for field in fields))
    assert len(lines) == 4


def test_failures_of_another_kind_are_told_beside_them(capsys):
    other = RequestError("x.hex: line 5: it has no octets")
    assert f"captain: {other.message}" in said(capsys, *map(invalid, range(100)), other, *map(invalid, range(100)))


def test_a_hint_that_changes_is_told_again(capsys):
    lines = said(capsys, RequestError("a: cut", "one"), RequestError("b: cut", "two"), RequestError("c: cut", "two"))
    assert lines == ["captain: a: cut", "  (one)", "captain: b: cut", "  (two)", "captain: c: cut"]


def test_failures_of_endless_kinds_are_told_in_bounded_lines(capsys):
    words = ["".join(chr(ord("a") + int(digit)) for digit in str(number)) for number in range(5000)]
    lines = said(capsys, *(RequestError(f"x: {word}") for word in words))
    assert len(lines) < 50
    assert tells(lines[-1], f"captain: {5000 - 12 - 3} more ", f"last: x: {words[-1]}")


def test_failures_are_counted_where_ctrl_c_ends_them(capsys):
    def interrupted() -> None:
        with Failures() as failures:
            for line in range(9):
                failures.report(invalid(line))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert "captain: 6 more " in capsys.readouterr().err


def test_what_a_peer_put_into_a_failure_is_not_obeyed_by_a_terminal(capsys):
    assert said(capsys, RequestError("x: \x1b[2J", "\x07")) == ["captain: x: \\x1b[2J", "  (\\x07)"]


@pytest.mark.parametrize("command", ["decode", "explain", "convert", "encode", "replay"])
def test_list_of_2003_invalid_lines_gives_three_failures_and_their_count(tmp_path, capsys, command):
    (tmp_path / "bad.hex").write_text("zz is not hexadecimal\n" * 2003)
    options = ["--udp", "127.0.0.1:9"] if command == "replay" else []
    assert cli.main([command, *options, str(tmp_path / "bad.hex")]) == 1
    lines = capsys.readouterr().err.splitlines()
    assert len([line for line in lines if "line " in line]) == 4
    assert len(lines) <= 7
    assert any(tells(line, "2000 more ", "last: ", "line 2003") for line in lines)


@pytest.mark.parametrize("command", ["decode", "convert"])
def test_list_with_invalid_lines_has_its_valid_ones_used(command):
    cam = "020200000539" + "00" * 35
    given = "\n".join(["zz", cam, *["zz"] * 9, cam]).encode()
    command_line = [sys.executable, "-m", "firmware", command, "-", *(["--to", "hex"] if command == "convert" else [])]
    done = subprocess.run(command_line, input=given, capture_output=True, check=False)
    assert done.returncode == 1
    assert "captain: 7 more " in done.stderr.decode()
    if command == "convert":
        assert done.stdout.decode().split() == [cam, cam]


def test_warnings_of_one_kind_are_three_and_their_count(tmp_path, capsys):
    message = '{"edition": "cam-1.4.1", "message": {"header": {"protocolVersion": 9, "messageID": 9, "stationID": %d}}}'
    with Failures() as failures:
        for number in range(50):
            failures.warn(f"x.json: line {number}: {message % number} has the header of another edition")
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 4
    assert lines[0].startswith("captain: warning: x.json: line 0: ")
    assert tells(lines[-1], "47 more ", "last: warning: x.json: line 49")
