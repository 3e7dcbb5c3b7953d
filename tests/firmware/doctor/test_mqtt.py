"""captain doctor: files, certificate dates and reachability of a broker."""

import errno
import os
import socket
import sys
import time

import pytest

from drivers.contract import Shared
from drivers.gnss.driver import ZedF9p
from drivers.mqtt.options import MqttOptions
from firmware import cli
from firmware.config.captain_toml import InterfaceConfig
from firmware.config.tables import QueueOptions
from firmware.doctor import mqtt, mqtt_reach
from firmware.doctor.finding import Level
from tests.broker.mute import CONNACK, Mute
from tests.said import tells

STATION = Shared(bytes.fromhex("02000000000b"), types=("cam", "denm", ""))
DAY_S = 86_400.0


def v2n(**options):
    options.setdefault("url", "mqtts://broker.example:8883")
    return InterfaceConfig("v2n", QueueOptions("mqtt"), MqttOptions(**options))


@pytest.fixture
def own(certificates):
    """Options with good files."""
    identity = certificates.client
    return {
        "ca": str(certificates.authority.certificate),
        "certificate": str(identity.certificate),
        "key": str(identity.key),
    }


def said(one, now=None):
    found = mqtt.files(one, STATION, time.time() if now is None else now)
    return [(finding.level, finding.text, finding.remedy) for finding in found]


def test_good_files_are_told_with_the_day_on_which_they_end(own, certificates):
    certificate, key = certificates.authority.issue("long", "extendedKeyUsage=clientAuth\n", ("-days", "60"))
    ((level, told, _), (_, authority, _)) = said(v2n(**own | {"certificate": str(certificate), "key": str(key)}))
    assert level is Level.OK
    assert told.startswith(f"certificate {certificate} is good until 20")
    assert authority.startswith(f"ca {own['ca']} expires in 1 days: 20")


def test_certificate_that_ends_soon_is_a_warning_and_one_that_is_not_valid_a_problem(own):
    (soon, told, remedy), *_ = said(v2n(**own))
    assert (soon, remedy) == (Level.WARNING, "renew it")
    assert "expires in 1 days" in told
    (over, told, remedy), *_ = said(v2n(**own), time.time() + 3 * DAY_S)
    assert over is Level.PROBLEM
    assert tells(remedy, "renew", "clock")
    assert "has expired: 20" in told
    (early, told, remedy), *_ = said(v2n(**own), time.time() - 365 * DAY_S)
    assert early is Level.PROBLEM
    assert tells(remedy, "wait", "clock")
    assert "is good from 20" in told


def test_files_that_are_absent_or_that_others_may_read_are_problems_each_with_its_remedy(own, tmp_path):
    key = tmp_path / "own.key"
    key.write_text("x")
    key.chmod(0o644)
    missing = tmp_path / "no.pem"
    absent, open_to_others = said(v2n(**own | {"key": str(key), "ca": str(missing)}))
    assert absent[:2] == (Level.PROBLEM, f"ca {missing}: {os.strerror(errno.ENOENT)}")
    assert "option ca" in absent[2]
    assert (open_to_others[0], open_to_others[2]) == (Level.PROBLEM, f"chmod 600 {key}")
    assert tells(open_to_others[1], f"key {key}: ", "0644")


def test_key_of_another_certificate_is_a_problem_with_both_paths(own, certificates):
    ((level, told, _),) = said(v2n(**own | {"key": str(certificates.observer.key)}))
    assert level is Level.PROBLEM
    assert tells(told, f"key {certificates.observer.key}: ", "not the key", f"certificate {own['certificate']}")


RECEIVER = InterfaceConfig("gnss", QueueOptions("zed_f9p"), ZedF9p.Options(port="/dev/ttyAMA0"))


@pytest.mark.parametrize(
    ("profile", "others", "is_placed", "is_told"),
    [
        ("orange", [], False, True),
        ("orange", [RECEIVER], False, False),
        ("orange", [], True, False),
        ("raw", [], False, False),
    ],
)
def test_profile_by_tile_in_a_station_that_cannot_know_its_position_is_a_warning(profile, others, is_placed, is_told):
    one = v2n(url="mqtt://localhost", profile=profile)
    found = list(mqtt.position(one, STATION, [one, *others], is_placed))
    assert [finding.level for finding in found] == [Level.WARNING] * is_told
    for finding in found:
        assert tells(finding.text, "profile orange: ", "no position", "published", "subscribed")
        assert "station.position" in finding.remedy


def test_a_profile_that_cannot_be_read_is_a_problem(tmp_path):
    profile = tmp_path / "mine.toml"
    profile.write_text("nonsense = 1\n")
    ((level, told, _), *_) = said(v2n(profile=str(profile)))
    assert level is Level.PROBLEM
    assert str(profile) in told
    assert list(mqtt.position(v2n(profile=str(profile)), STATION, [], False)) == []


def test_profile_that_decodes_without_the_message_library_is_a_problem(monkeypatch):
    monkeypatch.setitem(sys.modules, "captain_messages", None)
    ((level, told, remedy),) = said(v2n(url="mqtt://localhost", profile="nap"))
    assert (level, remedy) == (Level.PROBLEM, "`make codec` builds it")
    assert "message library" in told


def test_a_name_that_the_topics_of_the_profile_cannot_hold_is_a_problem(tmp_path):
    profile = tmp_path / "mine.toml"
    profile.write_text(
        'name = "mine"\n[[publish]]\ntopic = "{prefix}/{type}"\npayload = "binary"\n'
        '[[subscribe]]\ntopic = "{prefix}/+"\npayload = "binary"\n'
    )
    ((level, told, remedy),) = said(v2n(url="mqtt://localhost", profile=str(profile)))
    assert (level, remedy) == (Level.PROBLEM, "set prefix")
    assert "prefix is empty" in told


def test_profile_with_a_type_that_the_station_does_not_have_is_a_problem(tmp_path):
    profile = tmp_path / "mine.toml"
    profile.write_text('name = "mine"\npublish = []\nsubscribe = []\n[types.dnem]\nqos = 0\n')
    ((level, told, remedy),) = said(v2n(url="mqtt://localhost", profile=str(profile)))
    assert (level, told) == (Level.PROBLEM, "types: unknown type: 'dnem'")
    assert "denm?" in remedy


def test_without_files_there_is_nothing_to_say():
    assert said(v2n(url="mqtt://localhost")) == []


def test_a_broker_that_is_reached_is_well(own, brokers):
    broker = brokers()
    (found,) = mqtt.reach(v2n(url=broker.url, **own), STATION)
    assert (found.level, found.text) == (Level.OK, f"mqtt: {broker.url}: accepts this client, by TLS")


def test_broker_of_another_authority_is_a_problem_of_option_ca(own, brokers, certificates):
    broker = brokers(server=certificates.strange_server)
    (found,) = mqtt.reach(v2n(url=broker.url, **own), STATION)
    assert found.level is Level.PROBLEM
    assert tells(found.text, broker.url, "authority", "not known")
    assert found.remedy.endswith("in ca")


@pytest.mark.parametrize("version", ["tlsv1.2", "tlsv1.3"])
def test_broker_that_asks_for_a_certificate_that_is_absent_is_a_problem(own, brokers, version):
    broker = brokers(version=version)
    (found,) = mqtt.reach(v2n(url=broker.url, ca=own["ca"]), STATION)
    assert found.level is Level.PROBLEM
    assert tells(f"{found.text}; {found.remedy}", broker.url, "asks for", "certificate of this client")


@pytest.mark.parametrize("version", ["tlsv1.2", "tlsv1.3"])
def test_broker_that_refuses_an_expired_certificate_is_a_problem(own, brokers, certificates, version):
    broker = brokers(version=version)
    expired = certificates.expired_client
    options = own | {"certificate": str(expired.certificate), "key": str(expired.key)}
    (found,) = mqtt.reach(v2n(url=broker.url, **options), STATION)
    assert found.level is Level.PROBLEM
    assert tells(found.text, broker.url, "refuses", "certificate of this client", "expired")


@pytest.mark.parametrize("version", [5, "3.1.1"])
def test_a_wrong_password_is_told(brokers, tmp_path, version):
    broker = brokers(passwords={"vm": "right"})
    (tmp_path / "password").write_text("wrong\n")
    (tmp_path / "password").chmod(0o600)
    options = {"username": "vm", "password_file": str(tmp_path / "password"), "version": version}
    (found,) = mqtt.reach(v2n(url=broker.plain_url, **options), STATION)
    assert found.level is Level.PROBLEM
    assert "refuses the connection: Not authorized" in found.text


def test_a_broker_that_does_not_answer_is_told_in_the_time_there_is(brokers, monkeypatch):
    monkeypatch.setattr(mqtt_reach, "REACH_S", 0.2)
    broker = brokers.keep(Mute(frozenset({CONNACK})))
    (found,) = mqtt.reach(v2n(url=f"mqtt://127.0.0.1:{broker.port}"), STATION)
    assert (found.level, found.text.partition(": no CONNACK")[2]) == (Level.WARNING, " within 0.2 s")


def test_a_station_that_is_connected_stays_so(brokers):
    broker = brokers()
    station = brokers.client(broker, "vm")
    (found,) = mqtt.reach(v2n(url=broker.plain_url, client_id="vm"), STATION)
    assert found.level is Level.OK
    station.publish("t", b"still here", qos=1)
    broker.says("Client captain-doctor-.* disconnected")
    assert not [line for line in broker.log if "Client vm" in line]


def test_broker_that_is_absent_is_a_warning_and_an_unknown_host_a_problem(monkeypatch):
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        (found,) = mqtt.reach(v2n(url=f"mqtt://127.0.0.1:{holder.getsockname()[1]}"), STATION)
    assert found.level is Level.WARNING
    assert "tries again" in found.remedy
    assert "refuses the connection" in found.text

    def unknown(*_, **__):
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", unknown)
    (found,) = mqtt.reach(v2n(), STATION)
    assert (found.level, found.subject) == (Level.PROBLEM, "interface v2n")
    assert tells(found.text, "mqtt: mqtts://broker.example:8883: ", "host name")
    assert found.remedy.endswith("in url")


def test_the_doctor_tells_all_of_it(own, brokers, capsys, monkeypatch, tmp_path, standin):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    broker = brokers()
    options = [f"interfaces.v2n.{key}={value}" for key, value in (own | {"url": broker.url, "driver": "mqtt"}).items()]
    options += [f"endpoint.{key}=0" for key in ("from_users", "to_users", "pull", "report")]
    assert cli.main(["doctor", "--board", "none", *(word for text in options for word in ("--set", text))]) == 0
    told = capsys.readouterr().out
    assert "interface v2n: certificate" in told
    assert "accepts this client, by TLS" in " ".join(told.split())


def test_a_fault_of_a_file_is_told_once(own, capsys, monkeypatch, tmp_path, standin):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    given = own | {"ca": str(tmp_path / "no.pem"), "url": "mqtts://127.0.0.1:1", "driver": "mqtt"}
    options = [f"interfaces.v2n.{key}={value}" for key, value in given.items()]
    options += [f"endpoint.{key}=0" for key in ("from_users", "to_users", "pull", "report")]
    assert cli.main(["doctor", "--board", "none", *(word for text in options for word in ("--set", text))]) == 1
    told = " ".join(capsys.readouterr().out.split())
    assert told.count("no.pem") == 1
    assert "problems: 1," in told
