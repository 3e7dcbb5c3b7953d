"""Programs for other machines: Debian release, processor, report of files."""

import subprocess
from pathlib import Path
from types import SimpleNamespace

import pytest

from image import __main__, description
from image.card import release
from image.errors import ImageError
from image.packages import Package
from image.program import deb, frozen, programs
from image.program.contents import layers
from image.program.programs import Artefact
from image.project import PROJECT

OWN = description.read(PROJECT / "image/image.toml")


@pytest.mark.parametrize(("octets", "is_ok", "said"), [(9_000_000, True, "ok"), (17_000_000, False, "MISSED")])
def test_a_program_that_is_larger_than_its_goal_is_told(tmp_path: Path, octets: int, is_ok: bool, said: str):
    path = tmp_path / "captain-1.2.3-aarch64"
    with path.open("wb") as file:
        file.truncate(octets)
    row = Artefact(path, 16.0, "captain 1.2.3")
    assert row.is_ok is is_ok
    assert str(row).split() == [
        said, "captain-1.2.3-aarch64", f"{octets / 1e6:.1f}", "MB", "goal:", "at", "most", "16", "MB", "captain", "1.2.3"
    ]  # fmt: skip


def test_what_has_no_goal_is_as_it_comes(tmp_path: Path):
    path = tmp_path / "captain.deb"
    path.write_bytes(bytes(2_000_000))
    assert str(Artefact(path)).split() == ["ok", "captain.deb", "2.0", "MB"]


@pytest.mark.parametrize(("octets", "is_ok", "said"), [(36_000_000, True, "ok"), (36_100_000, False, "MISSED")])
def test_a_package_with_a_directory_that_is_larger_than_its_goal_is_told(
    tmp_path: Path, octets: int, is_ok: bool, said: str
):
    package, inside = tmp_path / "captain.deb", tmp_path / "captain/_internal"
    package.write_bytes(bytes(2_000_000))
    inside.mkdir(parents=True)
    for path, size in ((inside / "libpython.so", octets - 1), (inside.parent / "captain", 1)):
        with path.open("wb") as file:
            file.truncate(size)
    row = programs.of_directory(package, inside.parent, "captain 1.2.3")
    assert row.is_ok is is_ok
    assert str(row).split() == [
        said, "captain.deb", "2.0", "MB", "unpacked", f"{octets / 1e6:.1f}", "MB,", "goal:", "at", "most", "36", "MB",
        "captain", "1.2.3",
    ]  # fmt: skip


@pytest.mark.parametrize(("octets", "status"), [(layers.MOST_MB * 1e6, 0), (layers.MOST_MB * 1e6 + 1, 1)])
def test_the_verb_programs_writes_checksums_and_fails_for_a_missed_goal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, octets: float, status: int
):
    def made(described: object, card: Path, to: Path, upgrade: bool) -> list[Artefact]:
        to.mkdir()
        (to / "captain.deb").touch()
        return [Artefact(to / "captain.deb", layers.MOST_MB, "", int(octets))]

    monkeypatch.setattr(programs, "make", made)
    assert __main__._programs(SimpleNamespace(to=tmp_path / "image", upgrade=False), OWN) == status  # type: ignore[arg-type]
    assert (tmp_path / "programs/SHA256SUMS").read_text().endswith("  captain.deb\n")


def test_a_release_has_one_list_of_checksums_with_programs_and_card(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    to, card = tmp_path / "release", tmp_path / "card"
    to.mkdir()
    card.mkdir()
    for path in (to / "captain.deb", card / "card.img.xz", card / "bundle", card / "packages", card / "licences"):
        path.touch()
    written = []
    monkeypatch.setattr(programs, "make", lambda *_: [Artefact(to / "captain.deb")])
    monkeypatch.setattr(
        programs, "write_sums", lambda artefacts, _: written.append([row.path.name for row in artefacts])
    )
    monkeypatch.setattr(release, "_packed", lambda made, card: card.image)
    monkeypatch.setattr(release.manifest, "text", lambda *_: "{}")
    paths = {name: card / name for name in ("bundle", "packages", "licences", "manifest")}
    signed = []
    monkeypatch.setattr(release.repository, "make", lambda *words: signed.append(words))
    made = SimpleNamespace(description=OWN, steps=SimpleNamespace(folder=tmp_path))
    release.make(made, SimpleNamespace(image=card / "card.img.xz", **paths), to, "key")  # type: ignore[arg-type]
    assert written == [["bundle", "captain.deb", "card.img.xz", "licences", "manifest", "packages"]]
    assert [(words[0], words[3:]) for words in signed] == [([to / "captain.deb"], (to / "apt", "key"))]


def test_checksums_are_those_that_sha256sum_reads(tmp_path: Path):
    path = tmp_path / "file"
    path.write_bytes(b"abc")
    programs.write_sums([Artefact(path)], tmp_path)
    # FIPS 180-4's example.
    assert (tmp_path / "SHA256SUMS").read_text() == (
        "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad  file\n"
    )


def test_what_an_earlier_version_left_is_not_handed_out(tmp_path: Path):
    (tmp_path / "apt").mkdir()
    for name in ("captain-1.deb", "captain-2.deb", "SHA256SUMS"):
        (tmp_path / name).write_text(name)
    programs.write_sums([Artefact(tmp_path / "captain-2.deb")], tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["SHA256SUMS", "apt", "captain-2.deb"]


def test_programs_are_frozen_by_the_oldest_debians_python_and_the_card_by_its_own():
    assert (OWN.base.suite, OWN.released.suite) == ("trixie", "bookworm")
    assert "python3.13" in OWN.packages.freeze
    assert "python3.11" in OWN.release.packages
    assert (OWN.released.keyring, OWN.released.mends) == (OWN.base.keyring, OWN.base.mends)


def test_the_card_and_programs_are_frozen_with_the_same_tools():
    of_card, of_programs = (
        {name for name in names if "python" not in name} for names in (OWN.packages.freeze, OWN.release.packages)
    )
    assert of_card == of_programs


def test_both_processors_have_their_debian_name_compiler_and_start():
    named = {processor.debian: (processor.triple, processor.loader) for processor in programs.PROCESSORS}
    assert named == {
        "amd64": ("x86_64-linux-gnu", "PyInstaller/bootloader/Linux-64bit-intel/run"),
        "arm64": ("aarch64-linux-gnu", "PyInstaller/bootloader/Linux-64bit-arm/run"),
    }
    assert frozen.AARCH64.tools.strip == "aarch64-linux-gnu-strip"


@pytest.mark.parametrize(("own", "is_refused"), [("2.36-9+deb12u14", False), ("2.41-12", False), ("2.4-1", True)])
def test_a_program_that_needs_a_later_c_library_than_its_release_is_refused(tmp_path: Path, own: str, is_refused: bool):
    (tmp_path / "main.c").write_text('#include <stdio.h>\nint main(void) { return puts("x") < 0; }\n')
    subprocess.run(["gcc", "-o", tmp_path / "captain", tmp_path / "main.c"], check=True)
    packages = [Package("libc6", own, "amd64", "", "")]
    if is_refused:
        with pytest.raises(ImageError, match=rf"needs C library {deb.c_library(tmp_path)}; its release has 2\.4\n"):
            programs.check_c_library(tmp_path, packages)
    else:
        programs.check_c_library(tmp_path, packages)
