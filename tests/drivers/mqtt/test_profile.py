"""Profile files: those of the project, and a user's own."""

import dataclasses
import sys
import tomllib
from pathlib import Path

import pytest

from board.runtime.errors import BlockedError, ConfigurationError
from drivers.mqtt.profile import FOLDER, TEMPLATE, check_editions, codec, load, names
from drivers.wire.v2n.description import ProfileDescription, PublishRow, Status, SubscribeRow, Tiles, TypeRule
from drivers.wire.v2n.payload.nap import NapReceived
from drivers.wire.v2n.profile import Delivery, Identity, Profile
from image.program.contents import layers
from tests.drivers.wire.v2n.station import HERE, NOW_MS, PDU

ROOT = Path(__file__).resolve().parents[3]
MINIMAL = """
name = "mine"
[[publish]]
topic = "fleet/{type}/{host}"
payload = "binary"
[[subscribe]]
topic = "fleet/{type}/+"
payload = "binary"
"""


def written(folder: Path, text: str) -> str:
    path = folder / "mine.toml"
    path.write_text(text)
    return str(path)


def test_the_profiles_that_ship():
    assert names() == ["nap", "orange", "raw", "vcaptain"]
    assert all(load(name).name == name for name in names())
    assert all(load(name).description for name in names())


def test_a_user_adds_a_profile_in_one_file(tmp_path: Path):
    description = load(written(tmp_path, MINIMAL))
    one, other = (Profile(description, Identity(host, 1, "", "")) for host in ("a", "b"))
    (found,) = one.publications("cam", 2001, PDU, HERE, NOW_MS)
    assert (found.topic, found.payload) == ("fleet/cam/a", PDU)
    assert other.subscriptions(HERE) == {("fleet/+/+", 1)}
    assert other.receive(Delivery(found.topic, found.payload)).pdu == PDU


def test_the_template_is_a_profile_that_works():
    one, other = (Profile(load(str(TEMPLATE)), Identity(host, 1, "", "")) for host in ("a", "b"))
    found = one.publications("denm", 2002, PDU, HERE, NOW_MS)
    assert [publication.topic for publication in found] == [
        "fleet/denm/a/1/2/0/2/3/0/0/0/0/0/3/0/2/0/2/3/0/0/1/0",
        "fleet/alarm/a",
    ]
    assert [publication.qos for publication in found] == [1, 1]
    assert other.receive(Delivery(found[0].topic, found[0].payload)).pdu == PDU
    lost = one.lost()
    assert lost
    assert (lost.topic, lost.payload, lost.retain) == ("fleet/status/a", b"gone", True)


@pytest.mark.parametrize("kind", [ProfileDescription, PublishRow, SubscribeRow, Status, Tiles, TypeRule])
def test_the_template_explains_every_key(kind: type):
    text = TEMPLATE.read_text()
    of_orange = {"schema_version", "standard", "origin"}
    missing = [
        field.name
        for field in dataclasses.fields(kind)
        if f"{field.name} =" not in text and f"[{field.name}]" not in text
    ]
    missing = [name for name in missing if f"[[{name}]]" not in text and f"[{name}." not in text]
    assert set(missing) <= of_orange
    assert all(name in (FOLDER / "orange.toml").read_text() for name in missing)


def test_the_template_names_every_form_and_every_variable():
    text = TEMPLATE.read_text()
    for word in ("binary", "base64", "vcaptain", "orange", "nap", "nap-body"):
        assert f"#   {word} " in text or f"{word}:" in text
    for name in ("host", "station", "uuid", "type", "port", "quadkey", "prefix"):
        assert f"{{{name}}}" in text


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            "{host}",
            "{hosst}",
            r"mine\.toml: publish\[0\]: 'fleet/\{type\}/\{hosst\}': unknown variable of topics: \{hosst\}(?s:.*)did you mean \{host\}",
        ),
        ("{type}/{host}", "+", r"mine\.toml: publish\[0\]: 'fleet/\+': no message can be published there"),
        ('"binary"', '"binry"', r"mine\.toml: publish\[0\]\.payload: .*did you mean \"binary\""),
        ("topic =", "topc =", r"mine\.toml: publish\[0\]\.topc: is not a known key; did you mean topic\?"),
        ('name = "mine"', 'name = "mine"\nqos = 2', r"mine\.toml: qos: unsupported: 2"),
        (
            'name = "mine"',
            'name = "mine"\nretian = true',
            r"mine\.toml: retian: is not a known key; did you mean retain\?",
        ),
        ('name = "mine"', "", r"mine\.toml: name: is missing"),
        ("+", "a+", r"mine\.toml: subscribe\[0\]: .*invalid level of a filter: 'a\+'"),
        (
            'name = "mine"',
            'name = "mine"\n[tiles]\npublish_depth = 40',
            r"mine\.toml: tiles: publish_depth: depth out of range: 40",
        ),
        (
            'name = "mine"',
            'name = "mine"\n[status]\ntopic = "s"\nlost = "{type}"',
            r"status: '\{type\}': \{type\} is not a variable of the station",
        ),
        ('name = "mine"', 'name = "mine"\n[types.cam]\nexpiry_s = 0', r"types\.cam: expiry_s: out of range: 0"),
        ('name = "mine"', 'name = "mine"\n[types.cam]\nstandard = {}', r"types\.cam: standard: empty table"),
        (
            'name = "mine"',
            'name = "mine"\n[types.cam]\nstandard = { 256 = "x" }',
            r"types\.cam: standard: invalid protocolVersion '256'; 0 to 255",
        ),
        ('name = "mine"', 'name = "mine"\n[types.cam]\nstandard = { 01 = "x" }', "invalid protocolVersion '01'"),
        ('payload = "binary"', 'payload = "binary"\ntypes = ["a/b"]', "types: 'a/b' is invalid as a level of a topic"),
    ],
)
def test_a_mistake_is_told_with_its_file_and_key(tmp_path: Path, old: str, new: str, says: str):
    assert old in MINIMAL
    with pytest.raises(ConfigurationError, match=says):
        load(written(tmp_path, MINIMAL.replace(old, new, 1)))


@pytest.mark.parametrize(
    ("standard", "said"),
    [
        ('"x"', ["x", "x", "x"]),
        ('{ others = "z", 1 = "x" }', ["x", "z", "z"]),
        ('{ 2 = "y", 1 = "x" }', ["x", "y", "unknown"]),
    ],
)
def test_the_standard_of_a_pdu_is_that_of_its_protocol_version_or_of_the_row_of_others(
    tmp_path: Path, standard: str, said: list[str]
):
    text = MINIMAL.replace("\n[[", f"\n[types.cam]\nstandard = {standard}\n[[", 1)
    rule = load(written(tmp_path, text)).types["cam"]
    assert [rule.standard_of(version) for version in (1, 2, 3)] == said


def test_profile_of_an_unknown_name_is_refused_with_the_nearest_one():
    with pytest.raises(ConfigurationError, match="unknown profile 'vcaptian'") as error:
        load("vcaptian")
    assert all(word in error.value.hint for word in ("vcaptain?", ".toml"))


def test_a_file_that_is_not_there_is_told(tmp_path: Path):
    with pytest.raises(ConfigurationError, match="cannot be read"):
        load(str(tmp_path / "none.toml"))


@pytest.mark.parametrize(
    ("name", "is_used", "is_needed"),
    [("vcaptain", False, False), ("raw", False, False), ("orange", True, False), ("nap", True, True)],
)
def test_only_a_profile_that_decodes_wants_the_message_library(
    name: str, is_used: bool, is_needed: bool, monkeypatch: pytest.MonkeyPatch
):
    assert (codec(load(name)) is not None) is is_used
    monkeypatch.setitem(sys.modules, "captain_messages", None)
    if not is_needed:
        assert codec(load(name)) is None
        return
    with pytest.raises(BlockedError, match="the message library cannot be imported") as error:
        codec(load(name))
    assert "make codec" in error.value.hint


def test_editions_that_a_station_encodes_come_first_and_other_forms_only_if_they_are_among_them():
    usual, chosen = codec(load("nap")), codec(load("nap"), ["cpm-tr-2.1.1", "cpm-2.1.1-ext"])
    assert usual is not None
    assert chosen is not None
    assert [one.name for one in usual.editions("cpm")] == ["cpm-2.1.1", "cpm-tr-2.1.1"]
    assert [one.name for one in chosen.editions("cpm")] == ["cpm-tr-2.1.1", "cpm-2.1.1-ext", "cpm-2.1.1"]


# VAM of a made value, that vam-2.1.1 and vam-2.3.1 read with different values.
VAM = bytes.fromhex("031000001267ce004137480ef6c6b49d2000004dd1c2148d5b0006ea6afffb98031010")


@pytest.mark.parametrize("chosen", [["vam-2.1.1"], ["vam-2.3.1"], ["cam-1.4.1", "vam-2.1.1", "vam-2.3.1"]])
def test_an_edition_of_captain_toml_decides_between_those_that_read_different_values(chosen: list[str]):
    library = codec(load("nap"), chosen)
    assert library is not None
    name = next(one for one in chosen if one.startswith("vam"))
    assert [one.name for one, _ in library.decodings(VAM)] == [name]
    profile = Profile(load("nap"), Identity("a", 1, "", ""), library)
    found = next(one for one in profile.publications("vam", 2018, VAM, HERE, NOW_MS) if one.topic == "vanetza/out/vam")
    assert NapReceived(2, library).read("vam", found.payload) == (VAM, "")


def test_an_edition_of_captain_toml_that_does_not_fit_decides_nothing():
    library = codec(load("nap"), ["vam-1", "cam-1.4.1"])
    assert library is not None
    with pytest.raises(
        ValueError, match=r"ambiguous edition: vam-2\.3\.1 and vam-2\.1\.1 decode it to different values"
    ):
        list(library.decodings(VAM))


@pytest.mark.parametrize(
    ("profile", "edition", "what", "hint"),
    [
        ("nap", "cpm-2.1.1-x", "editions: unknown edition 'cpm-2.1.1-x'", "one of cpm-2.1.1, cpm-2.1.1-ext"),
        ("nap", "hello-1", "editions: unknown edition 'hello-1'", "one of cam-1.3.2"),
        ("raw", "cpm-2.1.1", "editions: option without effect: profile raw never encodes messages", "remove the key"),
    ],
)
def test_editions_that_a_profile_cannot_encode_are_refused(profile: str, edition: str, what: str, hint: str):
    with pytest.raises(ConfigurationError) as error:
        check_editions(profile, [edition])
    assert what in error.value.message
    assert hint in error.value.hint


def test_installed_and_frozen_programs_have_the_profiles():
    patterns = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]["drivers"]
    carried = {path for pattern in patterns for path in (ROOT / "drivers").glob(pattern)}
    assert {FOLDER / f"{name}.toml" for name in names()} | {TEMPLATE} <= carried
    assert {FOLDER / f"{name}.toml" for name in names()} | {TEMPLATE} <= set(layers.files(ROOT, {}).values())
