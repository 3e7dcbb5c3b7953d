"""Screens of captain-asn1: help, wrong usage, the list of messages, a generated folder."""

from contextlib import redirect_stderr, redirect_stdout, suppress
from pathlib import Path

import pytest

from asn1 import cli
from tests.screens.terminal import Terminal, compare


@pytest.mark.parametrize(
    ("name", "argv"),
    [
        ("help", ["--help"]),
        ("unknown-command", ["generat"]),
        ("unknown-option", ["list", "--jsn"]),
        ("unknown-message", ["generate", "cm", "--to", "out"]),
        ("list", ["list"]),
        ("generate", ["generate", "cam", "--format", "docs", "--to", "out"]),
    ],
)
def test_screen_of_captain_asn1_fits_80_columns(
    name: str, argv: list[str], terminal: Terminal, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with redirect_stdout(terminal), redirect_stderr(terminal), suppress(SystemExit):
        cli.main(argv)
    compare(f"asn1-{name}", terminal.lines())
