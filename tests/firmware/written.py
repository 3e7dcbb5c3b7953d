"""A captain.toml that was written, and what is said of it."""

from pathlib import Path

import pytest

from board.runtime.errors import ConfigurationError
from firmware.config import captain_toml
from firmware.config.captain_toml import Config

TWO_UDP = """
[interfaces.g5]
driver = "udp"
listen = "127.0.0.1:0"
[interfaces.mqtt]
driver = "udp"
listen = "127.0.0.1:0"
"""


def loaded(folder: Path, text: str, *overrides: str, board: str = "none") -> Config:
    path = folder / "captain.toml"
    path.write_text(text)
    return captain_toml.load(str(path), overrides, board)


def mistakes(folder: Path, text: str, *overrides: str, board: str = "none") -> list[str]:
    with pytest.raises(ConfigurationError) as caught:
        loaded(folder, text, *overrides, board=board)
    return str(caught.value).splitlines()


def mistake(folder: Path, text: str, *overrides: str) -> str:
    lines = mistakes(folder, text, *overrides)
    assert len(lines) == 1, lines
    assert lines[0].startswith(f"{folder}/captain.toml: ")
    return lines[0].removeprefix(f"{folder}/captain.toml: ")
