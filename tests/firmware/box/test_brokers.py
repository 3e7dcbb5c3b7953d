"""Certificates and keys for brokers: looked at as the client will load them."""

from pathlib import Path

import pytest

from drivers import mqtt_profile
from firmware.box import station_files
from firmware.box.verdict import Verdict
from firmware.lab.certificates import Authority
from tests.firmware.box.conftest import KEY, Files, Look, mistakes, remarks

CONFIG = """\
[interfaces.cloud]
driver = "mqtt"
url = "mqtts://broker.example:8883"
ca = "mqtt/ca.pem"
certificate = "mqtt/box.pem"
key = "mqtt/box.key"
"""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    """A sound set."""
    authority = Authority(tmp_path_factory.mktemp("ca"))
    pair = authority.issue("box", "extendedKeyUsage=clientAuth\n", ("-days", "2"))
    return {
        "captain.toml": CONFIG,
        "authorized_keys": KEY,
        "mqtt/ca.pem": Path(authority.certificate).read_bytes(),
        "mqtt/box.pem": pair.certificate.read_bytes(),
        "mqtt/box.key": pair.key.read_bytes(),
        "other.pem": authority.issue("other", "extendedKeyUsage=clientAuth\n", ("-days", "2")).key.read_bytes(),
    }


def own(files: Files) -> Files:
    return {name: content for name, content in files.items() if name != "other.pem"}


def only(found: Verdict) -> str:
    (text,) = mistakes(found)
    return text


def test_a_sound_set_is_kept_octet_for_octet(look: Look, files: Files):
    found = look(own(files))
    assert [note.text for note in found.notes] == []
    assert found.files["mqtt/box.key"] == files["mqtt/box.key"]


def test_a_key_of_another_certificate_is_named(look: Look, files: Files):
    said = only(look(own(files) | {"mqtt/box.key": files["other.pem"]}))
    assert said == (
        "captain.toml:6: interfaces.cloud.key mqtt/box.key: is not the key of certificate mqtt/box.pem; name the key that "
        "the certificate was made for"
    )


def test_a_file_of_the_computer_that_checks_is_not_on_the_card(look: Look, files: Files, tmp_path: Path):
    ca = tmp_path / "ca.pem"
    ca.write_bytes(bytes(files["mqtt/ca.pem"]))  # type: ignore[arg-type]
    for path in (str(ca), f"../{ca.name}"):
        config = CONFIG.replace("mqtt/ca.pem", path)
        assert only(look(own(files) | {"captain.toml": config})) == (
            f"captain.toml:4: interfaces.cloud.ca: {path} is not on the card; put it into mqtt/, beside captain.toml"
        )


DAY_S = 86_400


def test_a_certificate_that_has_expired_is_told_and_refuses_nothing(look: Look, files: Files):
    for is_box in (True, False):
        found = look(own(files), is_box=is_box, later_s=3 * DAY_S)
        assert found.is_accepted
        certificate, ca = remarks(found)
        assert certificate.startswith("captain.toml:5: interfaces.cloud.certificate: mqtt/box.pem has expired: 20")
        assert certificate.endswith(" UTC; renew it: no connection comes about")
        assert ca.startswith("captain.toml:4: interfaces.cloud.ca: mqtt/ca.pem has expired: 20")


def test_one_that_is_not_good_yet_is_told_by_a_computer_and_not_by_a_box_whose_clock_was_never_set(
    look: Look, files: Files
):
    certificate, ca = remarks(look(own(files), is_box=False, later_s=-365 * DAY_S))
    assert certificate.startswith("captain.toml:5: interfaces.cloud.certificate: mqtt/box.pem is good from 20")
    assert certificate.endswith(" UTC; no connection comes about before")
    assert "mqtt/ca.pem is good from" in ca
    assert remarks(look(own(files), later_s=-365 * DAY_S)) == []


def test_what_is_no_certificate_is_named(look: Look, files: Files):
    said = only(look(own(files) | {"mqtt/ca.pem": "hello\n"}))
    assert said.startswith(
        "captain.toml:4: interfaces.cloud.ca mqtt/ca.pem: holds no certificate in PEM form; name a file"
    )


def test_a_file_that_is_not_there_is_named_with_the_one_that_may_be_meant(look: Look, files: Files):
    there = {name: content for name, content in own(files).items() if name != "mqtt/ca.pem"}
    assert only(look(there)) == (
        "captain.toml:4: interfaces.cloud.ca: there is no mqtt/ca.pem; put it into mqtt/, beside captain.toml"
    )
    said = only(look(there | {"mqtt/CA.PEM": files["mqtt/ca.pem"]}))
    assert said.endswith("there is no mqtt/ca.pem; on the card it is written mqtt/CA.PEM")


def test_a_file_that_nobody_names_is_told(look: Look, files: Files):
    found = look(own(files) | {"mqtt/old.pem": "x"})
    assert found.is_accepted
    assert remarks(found) == [
        'mqtt/old.pem: is named by no interface of captain.toml; for example: ca = "mqtt/old.pem"'
    ]


def test_an_empty_password_file_is_named(look: Look):
    text = (
        '[interfaces.c]\ndriver = "mqtt"\nurl = "mqtt://127.0.0.1"\nusername = "me"\npassword_file = "mqtt/password"\n'
    )
    said = only(look({"captain.toml": text, "mqtt/password": "\n", "authorized_keys": KEY}))
    assert said.startswith("captain.toml:5: interfaces.c.password_file mqtt/password: its first line is no password")


PROFILED = """\
[interfaces.cloud]
driver = "mqtt"
url = "mqtt://127.0.0.1"
profile = "mqtt/own.toml"
"""


def test_a_profile_of_the_card_is_read_as_the_client_will(look: Look):
    sound = (Path(mqtt_profile.FOLDER) / "template.toml").read_bytes()
    found = look({"captain.toml": PROFILED, "authorized_keys": KEY, "mqtt/own.toml": sound})
    assert [note.text for note in found.notes] == []
    found = look({"captain.toml": PROFILED, "authorized_keys": KEY, "mqtt/own.toml": b"x = 1\n"})
    assert "captain.toml:4: interfaces.cloud.profile: mqtt/own.toml: x: is not a known key" in mistakes(found)[0]
    assert not any(text.startswith("mqtt/own.toml: is named by no interface") for text in remarks(found))
    said = only(look({"captain.toml": PROFILED, "authorized_keys": KEY}))
    assert said.startswith("captain.toml:4: interfaces.cloud.profile: there is no mqtt/own.toml; put it into mqtt/")


PIN = """\
[interfaces.cell]
driver = "sim8202g"
usb = "1-1.4"
pin_file = "mqtt/pin"
"""


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"1234\n", ""),
        (b"12a4", "interfaces.cell.pin_file mqtt/pin: holds no PIN; 4 to 8 digits, and nothing else"),
        (None, "interfaces.cell.pin_file: there is no mqtt/pin; put it into mqtt/, beside captain.toml"),
    ],
)
def test_a_pin_is_read_as_the_modem_will_have_it(look: Look, content: bytes | None, said: str):
    files: Files = {"captain.toml": PIN, "authorized_keys": KEY}
    found = look(files if content is None else files | {"mqtt/pin": content})
    assert mistakes(found) == ([f"captain.toml:4: {said}"] if said else [])
    assert remarks(found) == []


def test_an_end_that_windows_does_not_show_is_told(look: Look, files: Files):
    given = own(files)
    given["mqtt/ca.pem.txt"] = given.pop("mqtt/ca.pem")
    assert "there is no mqtt/ca.pem; on the card it is written mqtt/ca.pem.txt" in only(look(given))


@pytest.mark.parametrize("is_there", [True, False])
def test_of_the_images_authorities_one_file_holds_all_whatever_the_computer_has_that_checks(
    look: Look, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_there: bool
):
    authorities = tmp_path / "certs/ca-certificates.crt"
    authorities.parent.mkdir()
    (authorities.parent / "one.pem").write_text("x")
    if is_there:
        authorities.write_bytes(Path(Authority(tmp_path).certificate).read_bytes())
    monkeypatch.setattr(station_files, "AUTHORITIES", str(authorities))
    cloud = '[interfaces.cloud]\ndriver = "mqtt"\nurl = "mqtts://broker.example:8883"\n'
    assert mistakes(look({"captain.toml": f'{cloud}ca = "{authorities}"\n'})) == []
    other = authorities.parent / "one.pem"
    said = only(look({"captain.toml": f'{cloud}ca = "{other}"\n'}))
    assert f"interfaces.cloud.ca: {other} is not on the card; put it into mqtt/" in said


def test_the_images_authorities_are_where_its_packages_put_them():
    made = (Path(__file__).resolve().parents[3] / "image/root.py").read_text()
    assert f'tree.write("{station_files.AUTHORITIES.lstrip("/")}"' in made
