"""The examples of every --help run: the options that they show exist, and `captain run` can read what they configure."""

import argparse
import re
import shlex

import pytest

from firmware import board_file, cli, config

EXAMPLE = re.compile(r"^  (captain .*?)(?:  .*)?$", re.MULTILINE)
PIECE = re.compile(r" \| | > ?")


def examples(verb: str) -> list[str]:
    command = cli.load(verb)
    return EXAMPLE.findall(command.DESCRIPTION + command.EPILOG)


def parsed(example: str) -> argparse.Namespace:
    verb, *words = shlex.split(example)[1:]
    parser = argparse.ArgumentParser(prog=verb)
    cli.load(verb).arguments(parser)
    return parser.parse_args(words)


EXAMPLES = [piece for verb in cli.VERBS for line in examples(verb) for piece in PIECE.split(line)]


@pytest.mark.parametrize("verb", cli.VERBS)
def test_every_command_shows_examples(verb):
    assert any(example.startswith(f"captain {verb}") for example in examples(verb))


@pytest.mark.parametrize("example", [one for one in EXAMPLES if one.startswith("captain ")])
def test_every_example_has_options_that_exist(example):
    assert parsed(example)


@pytest.mark.parametrize("example", [one for one in EXAMPLES if one.startswith("captain run")])
def test_every_station_that_an_example_starts_is_configured_well(example, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "captain.toml").write_text('[interfaces.air]\ndriver = "udp"\nlisten = "127.0.0.1:0"\n')
    (tmp_path / "crowd.toml").write_bytes((board_file.BOARDS / "sim.toml").read_bytes())
    asked = parsed(example)
    read = config.load(asked.config, asked.overrides, asked.board)
    assert read.interfaces


def test_an_example_that_configures_half_an_interface_would_be_found():
    asked = parsed("captain run --board none --set interfaces.air.driver=nosuch")
    with pytest.raises(config.ConfigurationError):
        config.load(asked.config, asked.overrides, asked.board)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("lab --rate 0", "'0' is no number of messages a second above 0"),
        ("lab --duration x", "'x' is no number of seconds above 0"),
        ("send --rate -1 0202", "'-1' is no number of messages a second from 0 on"),
        ("send --lifetime 86401 0202", "'86401' is no number of seconds above 0, at most 86400"),
        ("listen --count 0", "'0' is not in 1"),
        ("listen --duration nan", "'nan' is no number of seconds"),
        ("demo --duration inf", "'inf' is no number of seconds"),
        ("status --report 0", "'0' is not in 1 ... 65535"),
    ],
)
def test_a_value_that_cannot_be_is_told_with_what_it_counts(command, words, capsys):
    with pytest.raises(SystemExit) as ended:
        cli.main(command.split())
    assert ended.value.code == cli.USAGE_ERROR
    assert words in capsys.readouterr().err
