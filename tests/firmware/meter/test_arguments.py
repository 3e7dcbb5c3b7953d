"""Options of `captain meter`: units."""

import argparse

import pytest

from firmware.meter.arguments import add_options


@pytest.fixture
def parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser()
    add_options(parser)
    return parser


@pytest.mark.parametrize(("text", "interval_s"), [("0.01", 0.01), ("1", 1.0), ("60", 60.0)])
def test_interval_within_its_range_is_in_seconds(parser: argparse.ArgumentParser, text: str, interval_s: float) -> None:
    assert parser.parse_args(["--interval", text]).interval == interval_s


def test_interval_without_option_is_one_second(parser: argparse.ArgumentParser) -> None:
    assert parser.parse_args([]).interval == 1.0


@pytest.mark.parametrize("text", ["0", "-1", "0.009", "61", "nan", "1s", ""])
def test_interval_outside_its_range_is_refused(
    parser: argparse.ArgumentParser, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        parser.parse_args([f"--interval={text}"])
    assert "seconds" in capsys.readouterr().err


def test_interval_in_milliseconds_is_refused_with_its_value_in_seconds(
    parser: argparse.ArgumentParser, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        parser.parse_args(["--interval", "500"])
    assert "500: out of range, 0.01 to 60 seconds; for 500 ms write 0.5" in capsys.readouterr().err
