"""Errors of a profile: rules, status, unknown types."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from board.runtime.errors import ConfigurationError
from drivers.mqtt.client.process import profile_of
from drivers.mqtt.client.settings import MqttSettings
from drivers.wire.v2n.description import ProfileDescription, PublishRow, Status, SubscribeRow, TypeRule
from tests.drivers.wire.v2n.station import profile


@pytest.mark.parametrize("wrong", [{"qos": 2}, {"expiry_s": 0}, {"expiry_s": 1 << 32}, {"topic": "a/b"}])
def test_rules_that_cannot_be_are_a_mistake(wrong: dict[str, object]):
    with pytest.raises(ConfigurationError):
        TypeRule(**wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "wrong",
    [
        {"publish": (PublishRow("t/{type}", "binary", ("cam", "cma")),)},
        {"subscribe": (SubscribeRow("t/{type}", "binary", ("cma",)),)},
        {"types": {"cma": TypeRule(qos=1)}},
    ],
)
def test_type_that_the_station_does_not_have_is_a_mistake_with_the_nearest_one(wrong: dict[str, Any]):
    rows: dict[str, Any] = {"publish": (), "subscribe": ()}
    with pytest.raises(ConfigurationError, match="types: unknown type: 'cma'") as refused:
        ProfileDescription("mine", **rows | wrong).check_types(("denm", "cam", ""))
    assert "cam?" in refused.value.hint


def test_a_type_without_a_name_is_called_by_its_message_id():
    description = ProfileDescription("mine", (PublishRow("t", "binary", ("15", "cam")),), (), types={"255": TypeRule()})
    description.check_types(("denm", "cam", ""))
    with pytest.raises(ConfigurationError, match="unknown type: '256'"):
        ProfileDescription("mine", (), (), types={"256": TypeRule()}).check_types(("cam",))


def test_a_status_names_the_station_only():
    with pytest.raises(ConfigurationError, match=r"\{type\} is not a variable of the station"):
        Status("v2x/status", connected="{type}")
    assert profile(ProfileDescription("s", (), (), status=Status("s", connected="{host} + {station}"))).connected()


MISSPELT = """
name = "mine"
[[publish]]
topic = "v2x/{type}"
payload = "binary"
types = ["cma"]
[[subscribe]]
topic = "v2x/+"
payload = "binary"
"""


def test_the_process_checks_the_types_of_a_profile_that_does_not_ship(tmp_path: Path):
    file = tmp_path / "mine.toml"
    file.write_text(MISSPELT)
    wanted = MqttSettings(url="mqtt://localhost", profile=str(file), types=("denm", "cam", ""))
    with pytest.raises(ConfigurationError, match="unknown type: 'cma'"):
        profile_of(wanted)
    assert profile_of(replace(wanted, profile="raw", types=("own",)))
