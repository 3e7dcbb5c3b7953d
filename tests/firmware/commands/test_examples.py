"""The examples of every --help run: the options that they show exist, and `captain run` can read what they configure."""

import argparse
import re
import shlex

import pytest

from firmware import cli
from firmware.config import board_file, captain_toml

EXAMPLE = re.compile(r"^  (captain .*?)(?:  .*)?$", re.MULTILINE)
PIECE = re.compile(r" \| | > ?")


def examples(verb: str) -> list[str]:
    command = cli.load(verb)
    missing = {"DESCRIPTION", "EPILOG", "arguments", "main"} - set(dir(command))
    assert not missing, f"{command.__name__} lacks {', '.join(sorted(missing))}; EPILOG shows examples, as in slot.py"
    return EXAMPLE.findall(command.DESCRIPTION + command.EPILOG)


def parsed(example: str) -> argparse.Namespace:
    verb, *words = shlex.split(example)[1:]
    parser = argparse.ArgumentParser(prog=verb)
    cli.load(verb).arguments(parser)
    return parser.parse_args(words)


EXAMPLES = [piece for verb in cli.VERBS for line in examples(verb) for piece in PIECE.split(line)]


@pytest.mark.parametrize("verb", cli.VERBS)
def test_every_command_shows_examples(verb):
    assert any(example.startswith(f"captain {verb}") for example in examples(verb)), "add examples to its EPILOG"


@pytest.mark.parametrize("example", [one for one in EXAMPLES if one.startswith("captain ")])
def test_every_example_has_options_that_exist(example):
    assert parsed(example)


@pytest.mark.parametrize("example", [one for one in EXAMPLES if one.startswith("captain run")])
def test_every_station_that_an_example_starts_is_configured_well(example, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "captain.toml").write_text('[interfaces.air]\ndriver = "udp"\nlisten = "127.0.0.1:0"\n')
    (tmp_path / "crowd.toml").write_bytes((board_file.BOARDS / "sim.toml").read_bytes())
    asked = parsed(example)
    read = captain_toml.load(asked.config, asked.overrides, asked.board)
    assert read.interfaces


def test_an_example_that_configures_half_an_interface_would_be_found():
    asked = parsed("captain run --board none --set interfaces.air.driver=nosuch")
    with pytest.raises(captain_toml.ConfigurationError):
        captain_toml.load(asked.config, asked.overrides, asked.board)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("lab --rate 0", "'0': out of range; above 0, at most 1,000,000 messages per second"),
        ("lab --duration x", "'x': out of range; above 0, at most 1,000,000,000 seconds"),
        ("send --rate -1 0202", "'-1': out of range; 0 to 1,000,000 messages per second"),
        ("send --lifetime 86401 0202", "'86401': out of range; above 0, at most 86,400 seconds"),
        ("listen --count 0", "'0': out of range; 1 to"),
        ("listen --duration nan", "'nan': out of range; above 0"),
        ("demo --duration inf", "'inf': out of range; above 0"),
        ("status --report 0", "'0': out of range; 1 to 65535"),
    ],
)
def test_value_out_of_range_is_reported_with_its_range_and_unit(command, words, capsys):
    with pytest.raises(SystemExit) as ended:
        cli.main(command.split())
    assert ended.value.code == cli.USAGE_ERROR
    assert words in capsys.readouterr().err
