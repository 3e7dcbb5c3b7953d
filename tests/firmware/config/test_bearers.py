"""Configured bearers: unknown interfaces and interfaces without a mobile network are reported."""

from pathlib import Path

import pytest

from board.runtime.errors import ConfigurationError
from firmware.config import captain_toml

TOML = """
[interfaces.v2n]
driver = "mqtt"
url = "mqtts://broker.example:8883"
bearer = "{bearer}"
[interfaces.modem]
driver = "sim8202g"
usb = "1-1.4"
[interfaces.air]
driver = "udp"
listen = "127.0.0.1:0"
"""


@pytest.mark.parametrize(
    ("bearer", "says"),
    [
        ("modm", "interfaces.v2n.bearer: unknown interface 'modm'; did you mean modem?"),
        ("zzz", "interfaces.v2n.bearer: unknown interface 'zzz'; known: modem"),
        ("air", "interfaces.v2n.bearer: 'air' carries no mobile network; known: modem"),
        ("v2n", "interfaces.v2n.bearer: 'v2n' carries no mobile network; known: modem"),
    ],
)
def test_a_bearer_that_is_none_is_a_mistake_of_the_configuration(tmp_path: Path, bearer: str, says: str) -> None:
    path = tmp_path / "captain.toml"
    path.write_text(TOML.format(bearer=bearer))
    with pytest.raises(ConfigurationError) as caught:
        captain_toml.load(str(path))
    assert caught.value.message == f"{path}: {says}"


@pytest.mark.parametrize("bearer", ["modem", ""])
def test_a_bearer_that_is_one_and_none_at_all_are_taken(tmp_path: Path, bearer: str) -> None:
    path = tmp_path / "captain.toml"
    path.write_text(TOML.format(bearer=bearer))
    assert captain_toml.load(str(path))
