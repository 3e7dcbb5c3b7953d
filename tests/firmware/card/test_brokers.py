"""Certificates and keys for brokers: looked at as the client will load them."""

from pathlib import Path

import pytest

from drivers.mqtt import profile
from firmware.card.station import files as station_files
from firmware.lab.certificates import Authority
from tests.firmware.card.conftest import KEY, Files, Look, mistakes, noted, refused, remarks

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


PROFILED = """\
[interfaces.cloud]
driver = "mqtt"
url = "mqtt://127.0.0.1"
profile = "mqtt/own.toml"
"""
PASSWORD = """\
[interfaces.c]
driver = "mqtt"
url = "mqtt://127.0.0.1"
username = "me"
password_file = "mqtt/password"
"""
PIN = """\
[interfaces.cell]
driver = "sim8202g"
usb = "1-1.4"
pin_file = "mqtt/pin"
"""
CLOUD = '[interfaces.cloud]\ndriver = "mqtt"\nurl = "mqtts://broker.example:8883"\n'
TEMPLATE = (Path(profile.FOLDER) / "template.toml").read_bytes()
CA, CERTIFICATE, PRIVATE = (
    "captain.toml:4 interfaces.cloud.ca", "captain.toml:5 interfaces.cloud.certificate", "captain.toml:6",
)  # fmt: skip
DAY_S = 86_400
PATHS = ("mqtt/box.pem", "mqtt/ca.pem")


def own(files: Files, **changed: str | bytes | None) -> Files:
    """The sound set; ca, key: others in their places, None for none."""
    names = {"ca": "mqtt/ca.pem", "key": "mqtt/box.key", "config": "captain.toml"}
    given = {name: content for name, content in files.items() if name != "other.pem"}
    for name, content in changed.items():
        del given[names[name]]
        given |= {} if content is None else {names[name]: content}
    return given


def test_sound_set_is_kept_octet_for_octet(look: Look, files: Files):
    found = look(own(files))
    assert [note.text for note in found.notes] == []
    assert found.files["mqtt/box.key"] == files["mqtt/box.key"]


def test_file_for_a_broker_with_a_mistake_is_named_at_its_option(look: Look, files: Files, tmp_path: Path):
    ca = tmp_path / "ca.pem"
    ca.write_bytes(bytes(files["mqtt/ca.pem"]))  # type: ignore[arg-type]
    rows: list[tuple[Files, str, list[str]]] = [
        (own(files, key=files["other.pem"]), PRIVATE, ["interfaces.cloud.key mqtt/box.key", "mqtt/box.pem"]),
        (own(files, ca="hello\n"), "captain.toml:4", ["interfaces.cloud.ca mqtt/ca.pem", "PEM"]),
        (own(files, ca=None), CA, ["not found: mqtt/ca.pem", "mqtt/,"]),
        (own(files, ca=None) | {"mqtt/CA.PEM": files["mqtt/ca.pem"]}, CA, ["the card has mqtt/CA.PEM"]),
        (own(files, ca=None) | {"mqtt/ca.pem.txt": files["mqtt/ca.pem"]}, CA, ["the card has mqtt/ca.pem.txt"]),
        # a file of the computer that checks
        (own(files, config=CONFIG.replace("mqtt/ca.pem", str(ca))), CA, [str(ca), "mqtt/,"]),
        (own(files, config=CONFIG.replace("mqtt/ca.pem", "../ca.pem")), CA, ["../ca.pem", "mqtt/,"]),
        ({"captain.toml": PASSWORD, "mqtt/password": "\n"}, "captain.toml:5", ["interfaces.c.password_file mqtt/password"]),
        ({"captain.toml": PROFILED}, "captain.toml:4 interfaces.cloud.profile", ["mqtt/own.toml", "mqtt/,"]),
        ({"captain.toml": PROFILED, "mqtt/own.toml": b"x = 1\n"}, "captain.toml:4 interfaces.cloud.profile", ["mqtt/own.toml", "x: "]),
        ({"captain.toml": PIN, "mqtt/pin": b"12a4"}, "captain.toml:4", ["interfaces.cell.pin_file mqtt/pin", "4 to 8"]),
        ({"captain.toml": PIN}, "captain.toml:4 interfaces.cell.pin_file", ["mqtt/pin", "mqtt/,"]),
    ]  # fmt: skip
    for given, place, values in rows:
        found = look(given | {"authorized_keys": KEY})
        assert refused(found)[0] == place
        assert [value for value in values if value not in mistakes(found)[0]] == []
        assert not any(name.startswith("mqtt/own.toml") for name in noted(found))


@pytest.mark.parametrize(
    "given",
    [{"captain.toml": PROFILED, "mqtt/own.toml": TEMPLATE}, {"captain.toml": PIN, "mqtt/pin": b"1234\n"}],
)
def test_profile_and_pin_that_are_sound_are_taken_without_a_note(look: Look, given: Files):
    assert look(given | {"authorized_keys": KEY}).notes == []


def test_file_that_no_interface_names_is_told_with_an_example(look: Look, files: Files):
    found = look(own(files) | {"mqtt/old.pem": "x"})
    assert (refused(found), noted(found)) == ([], ["mqtt/old.pem"])
    assert 'ca = "mqtt/old.pem"' in remarks(found)[0]


def test_certificate_of_another_time_is_told_and_refuses_nothing(look: Look, files: Files):
    # box or computer, days from now, the last word of each note; a box whose clock was never set does not say "not yet"
    for is_box, days, word in ((True, 3, "expired"), (False, 3, "expired"), (False, -365, "from"), (True, -365, "")):
        found = look(own(files), is_box=is_box, later_s=days * DAY_S)
        assert (refused(found), noted(found)) == ([], [f"{CERTIFICATE}", CA] if word else [])
        said = remarks(found)
        assert all(
            word in text and f" {path} " in text and " UTC" in text for text, path in zip(said, PATHS, strict=False)
        )


@pytest.mark.parametrize("is_there", [True, False])
def test_authorities_of_the_image_are_one_file_whatever_the_checking_computer_has(
    look: Look, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_there: bool
):
    authorities = tmp_path / "certs/ca-certificates.crt"
    authorities.parent.mkdir()
    (authorities.parent / "one.pem").write_text("x")
    if is_there:
        authorities.write_bytes(Path(Authority(tmp_path).certificate).read_bytes())
    monkeypatch.setattr(station_files, "AUTHORITIES", str(authorities))
    assert refused(look({"captain.toml": f'{CLOUD}ca = "{authorities}"\n'})) == []
    other = authorities.parent / "one.pem"
    found = look({"captain.toml": f'{CLOUD}ca = "{other}"\n'})
    assert refused(found) == [CA]
    assert str(other) in mistakes(found)[0]


def test_authorities_are_where_the_image_puts_them():
    made = (Path(__file__).resolve().parents[3] / "image/parts/root.py").read_text()
    assert f'tree.write("{station_files.AUTHORITIES.lstrip("/")}"' in made
