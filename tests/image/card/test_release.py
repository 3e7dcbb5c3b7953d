"""Reports of release files and of a build, beside goals."""

import io
import json
import tarfile
from pathlib import Path
from types import SimpleNamespace

import pytest

from image import __main__, description
from image.card import build, figures, release
from image.card.build import CardBuild
from image.card.figures import Figure
from image.errors import ImageError
from image.project import PROJECT
from tests.said import tells


@pytest.mark.parametrize(
    ("took", "seconds", "goal"),
    [({"userland": 400.0, "card": 9.0}, 700.0, 1200), ({"program": 3.0}, 299.0, 300), ({}, 0.1, 300)],
)
def test_a_build_with_a_new_userland_has_the_time_of_a_cold_one(took: dict[str, float], seconds: float, goal: float):
    rows = list(figures.times(took, seconds))
    assert [row.what for row in rows] == [*took, "in all"]
    assert (rows[-1].most, rows[-1].is_ok) == (goal, True)


def test_sizes_are_those_of_what_lies_in_a_builds_folder(tmp_path: Path):
    for name in ("parts", "program/captain", "early"):
        (tmp_path / name).mkdir(parents=True)
    with tarfile.open(tmp_path / "parts/root.tar", "w") as tar:
        for name, size in (("a", 1), ("b", 4097)):
            head = tarfile.TarInfo(name)
            head.size = size
            tar.addfile(head, io.BytesIO(bytes(size)))
    for name, size in (("program/captain/captain", 37_000_000), ("early/initrd", 1_500_000), ("x.img", 2_000_000)):
        with (tmp_path / name).open("wb") as file:
            file.truncate(size)
    (tmp_path / "packages").write_text('[{"name": "a"}, {"name": "b"}]')
    paths = [tmp_path / name for name in ("x.img", "slot", "early/initrd", "packages", "licences", "sums", "manifest")]
    rows = figures.sizes(description.read(PROJECT / "image/image.toml"), tmp_path, CardBuild(*paths, {}))
    found = {row.what: (round(row.value, 3), row.is_ok) for row in rows}
    assert found == {
        "card": (2.0, True),
        "root": (0.012, True),  # in blocks of 4 KiB
        "captain": (37.0, False),
        "early boot": (1.5, True),
        "update": (1.5, True),
        "packages": (2, True),
    }


def test_a_figure_is_shown_beside_its_goal():
    assert str(Figure("captain", 36.12, "MB", 36.0)).split() == [
        "MISSED",
        "captain",
        "36.1",
        "MB",
        "goal:",
        "at",
        "most",
        "36",
    ]


@pytest.mark.parametrize(("is_sound", "status"), [(True, 0), (False, 1)])
@pytest.mark.parametrize("kind", ["development", "release"])
def test_release_is_made_of_a_verified_card_and_warns_of_a_development_key(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    is_sound: bool, status: int, kind: str,
):  # fmt: skip
    made = SimpleNamespace(card=lambda: "card", steps=SimpleNamespace(folder=tmp_path), keys=SimpleNamespace(kind=kind))
    handed_out = []
    monkeypatch.setattr("image.__main__.build.Build", lambda described, to: made)
    monkeypatch.setattr("image.__main__._verified", lambda *_: 0 if is_sound else 1)
    monkeypatch.setattr(release, "make", lambda *arguments: handed_out.append(arguments) or [])
    assert __main__._release(SimpleNamespace(to=tmp_path, key=""), None) == status  # type: ignore[arg-type]
    assert bool(handed_out) is is_sound
    said = capsys.readouterr()
    assert tells(said.err, "any update", "this machine") == (kind == "development" and is_sound)
    assert ("apt: not signed: make release KEY=FINGERPRINT signs it\n" in said.out) is is_sound


def test_release_with_an_unknown_key_is_refused_before_a_build(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("image.__main__.build.Build", lambda described, to: pytest.fail("built"))
    with pytest.raises(ImageError, match="is not a fingerprint"):
        __main__._release(SimpleNamespace(to=tmp_path, key="nobody"), None)  # type: ignore[arg-type]


def test_release_has_a_manifest_of_the_compressed_card_in_its_checksums(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    card = build.planned(description.read(PROJECT / "image/image.toml"), tmp_path / "image")
    packed = tmp_path / f"{card.image.name}.xz"
    for path, octets in ((card.image, b"card"), (card.bundle, b"b"), (card.packages, b"p"), (card.licences, b"l")):
        path.write_bytes(octets)
    packed.write_bytes(b"xz")
    monkeypatch.setattr(release, "_packed", lambda *_: packed)
    monkeypatch.setattr(release.programs, "make", lambda *_: [])
    (to := tmp_path / "release").mkdir()
    made = SimpleNamespace(description=None, steps=SimpleNamespace(folder=tmp_path))
    names = [row.path.name for row in release.make(made, card, to)]  # type: ignore[arg-type]
    assert card.manifest.name in names
    (entry,) = json.loads((to / card.manifest.name).read_text())["os_list"]
    assert (entry["url"], entry["extract_size"]) == ((to / packed.name).as_uri(), 4)
    assert f"  {card.manifest.name}\n" in (to / release.programs.SUMS).read_text()
