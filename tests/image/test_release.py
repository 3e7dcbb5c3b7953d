"""What is told of things that are handed out and of a build, beside goals."""

import io
import tarfile
from pathlib import Path
from types import SimpleNamespace

import pytest

from image import __main__, description, figures, release
from image.build import Card
from image.figures import Figure
from image.project import PROJECT
from image.release import Artefact


@pytest.mark.parametrize(("octets", "is_ok", "said"), [(9_000_000, True, "ok"), (15_000_000, False, "MISSED")])
def test_a_program_that_is_larger_than_its_goal_is_told(tmp_path: Path, octets: int, is_ok: bool, said: str):
    path = tmp_path / "captain-1.2.3-aarch64"
    with path.open("wb") as file:
        file.truncate(octets)
    row = Artefact(path, 14.0, "captain 1.2.3")
    assert row.is_ok is is_ok
    assert str(row).split() == [
        said, "captain-1.2.3-aarch64", f"{octets / 1e6:.1f}", "MB", "goal:", "at", "most", "14", "MB", "captain", "1.2.3"
    ]  # fmt: skip


def test_what_has_no_goal_is_as_it_comes(tmp_path: Path):
    path = tmp_path / "captain.deb"
    path.write_bytes(bytes(2_000_000))
    assert str(Artefact(path)).split() == ["ok", "captain.deb", "2.0", "MB"]


def test_checksums_are_those_that_sha256sum_reads(tmp_path: Path):
    path = tmp_path / "file"
    path.write_bytes(b"abc")
    release.write_sums([Artefact(path)], tmp_path)
    # FIPS 180-4's example.
    assert (tmp_path / "SHA256SUMS").read_text() == (
        "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad  file\n"
    )


def test_what_an_earlier_version_left_is_not_handed_out(tmp_path: Path):
    for name in ("captain-1.deb", "captain-2.deb", "SHA256SUMS"):
        (tmp_path / name).write_text(name)
    release.write_sums([Artefact(tmp_path / "captain-2.deb")], tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["SHA256SUMS", "captain-2.deb"]


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
    for name, size in (("program/captain/captain", 31_000_000), ("early/initrd", 1_500_000), ("x.img", 2_000_000)):
        with (tmp_path / name).open("wb") as file:
            file.truncate(size)
    (tmp_path / "packages").write_text('[{"name": "a"}, {"name": "b"}]')
    paths = [tmp_path / name for name in ("x.img", "slot", "early/initrd", "packages", "licences", "sums")]
    rows = figures.sizes(description.read(PROJECT / "image/image.toml"), tmp_path, Card(*paths, {}))
    found = {row.what: (round(row.value, 3), row.is_ok) for row in rows}
    assert found == {
        "card": (2.0, True),
        "root": (0.012, True),  # in blocks of 4 KiB
        "captain": (31.0, False),
        "early boot": (1.5, True),
        "update": (1.5, True),
        "packages": (2, True),
    }


def test_a_figure_is_shown_beside_its_goal():
    assert str(Figure("captain", 30.12, "MB", 30.0)).split() == [
        "MISSED",
        "captain",
        "30.1",
        "MB",
        "goal:",
        "at",
        "most",
        "30",
    ]


@pytest.mark.parametrize(("is_sound", "status"), [(True, 0), (False, 1)])
@pytest.mark.parametrize("kind", ["development", "release"])
def test_what_is_handed_out_was_looked_through_and_whose_key_signed_it_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    is_sound: bool, status: int, kind: str,
):  # fmt: skip
    made = SimpleNamespace(card=lambda: "card", steps=SimpleNamespace(folder=tmp_path), keys=SimpleNamespace(kind=kind))
    handed_out = []
    monkeypatch.setattr("image.__main__.build.Build", lambda described, to: made)
    monkeypatch.setattr("image.__main__._verified", lambda *_: 0 if is_sound else 1)
    monkeypatch.setattr(release, "make", lambda *arguments: handed_out.append(arguments) or [])
    assert __main__._release(SimpleNamespace(to=tmp_path), None) == status  # type: ignore[arg-type]
    assert bool(handed_out) is is_sound
    assert ("boxes take any update that is signed by this machine" in capsys.readouterr().err) == (
        kind == "development" and is_sound
    )
