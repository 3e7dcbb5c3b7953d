"""Settings: first message to the MQTT process; address of the broker."""

import pytest

from board.runtime.errors import ConfigurationError
from drivers.mqtt.broker import broker
from drivers.mqtt.client.settings import settings_in
from tests.drivers.mqtt.model import Bench


def test_settings_are_read_as_they_were_written():
    given = Bench(qos=0, version="3.1.1", depths=(14, 18), urgent=(1, 4), device="wwan0").settings
    assert settings_in(given.message()) == given


def test_a_url_without_a_port_has_the_one_that_is_registered():
    assert [broker(url).port for url in ("mqtts://a", "mqtt://a", "mqtt://[::1]:1884")] == [8883, 1883, 1884]
    assert str(broker("mqtt://[::1]:1884")) == "mqtt://[::1]:1884"


@pytest.mark.parametrize(
    ("url", "is_loopback"),
    [
        ("mqtt://localhost", True),
        ("mqtt://127.9.9.9", True),
        ("mqtt://[::1]", True),
        ("mqtt://[::ffff:127.0.0.1]", True),
        ("mqtt://0.0.0.0", True),
        ("mqtt://[::]", True),
        ("mqtt://192.0.2.1", False),
        ("mqtt://[::ffff:192.0.2.1]", False),
        ("mqtt://ip6-localhost", False),
        ("mqtt://localhost.example", False),
    ],
)
def test_only_this_machine_is_loopback(url, is_loopback):
    assert broker(url).is_loopback is is_loopback


@pytest.mark.parametrize(
    "host",
    ["127.0.0.2", "[::1]", "[::ffff:127.0.0.1]", "0.0.0.0", "[::]", "ip6-localhost", "ip6-loopback", "LOCALHOST."],
)
def test_names_and_addresses_of_this_machine_have_one_place(host):
    assert broker(f"mqtt://{host}").place == broker("mqtt://localhost").place
    assert broker(f"mqtt://{host}:1884").place != broker("mqtt://localhost").place


def test_place_of_an_ipv4_mapped_address_is_that_of_ipv4():
    assert broker("mqtt://[::ffff:10.0.0.1]").place == broker("mqtt://10.0.0.1").place


@pytest.mark.parametrize(
    "url", ["", "http://a", "mqtts://", "mqtts://:1", "mqtts://a:0", "mqtts://a:65536", "mqtts://a/b", "mqtts://a b",
            "mqtts://a?b", "mqtts://a\n"],
)  # fmt: skip
def test_a_url_that_names_no_broker_is_refused(url):
    with pytest.raises(ConfigurationError):
        broker(url)


def test_a_password_in_a_url_is_refused_and_not_shown():
    with pytest.raises(ConfigurationError) as refused:
        broker("mqtts://me:secret@a:99999")
    assert "secret" not in str(refused.value)
