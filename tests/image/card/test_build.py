"""Steps that are kept, packages that are listed, modules that are unpacked."""

import hashlib
import lzma
from contextlib import closing
from pathlib import Path

import pytest

from image import packages, project
from image.card import build
from image.description import read
from image.errors import ImageError
from image.packages import Package
from image.parts import initrd
from image.program import freezing, frozen
from image.step import Steps
from image.tool import run


def test_a_step_is_kept_while_its_inputs_stay_the_same_and_made_again_when_a_file_changes(tmp_path: Path):
    source = tmp_path / "source"
    source.write_text("1")
    made: list[str] = []

    def make(folder: Path) -> None:
        made.append(source.read_text())
        (folder / "result").write_text(source.read_text())

    for content in ("1", "1", "2"):
        source.write_text(content)
        with closing(Steps(tmp_path / "built")) as steps:
            place = steps.made("step", ["word", source], make)
    assert made == ["1", "2"]
    assert (place / "result").read_text() == "2"


def test_a_step_that_failed_is_made_again(tmp_path: Path):
    def fail(_: Path) -> None:
        raise ImageError("no")

    with closing(Steps(tmp_path)) as steps:
        with pytest.raises(ImageError):
            steps.made("step", ["a"], fail)
        assert (steps.made("step", ["a"], lambda folder: (folder / "x").touch()) / "x").exists()


def test_a_list_of_packages_is_read_as_it_was_written_and_sorted(tmp_path: Path):
    found = [Package("b", "1:2-3", "arm64", "00", "b_1%3a2-3_arm64.deb"), Package("a", "1", "all", "11", "a_1_all.deb")]
    packages.write_list(tmp_path / "list", found)
    assert packages.read_list(tmp_path / "list") == sorted(found)


def test_the_early_boot_holds_its_modules_unpacked_and_in_their_order(tmp_path: Path):
    (tmp_path / "busybox").write_bytes(b"program")
    for name in ("jbd2", "ext4"):
        (tmp_path / f"{name}.ko.xz").write_bytes(lzma.compress(name.encode()))
    tree = initrd.contents(tmp_path / "busybox", [tmp_path / "jbd2.ko.xz", tmp_path / "ext4.ko.xz"])
    assert tree.read("modules/order") == b"jbd2.ko\next4.ko\n"
    assert tree.read("modules/ext4.ko") == b"ext4"
    assert dict(tree)["init"].head.mode == 0o755


def test_a_program_that_fails_is_quoted_and_one_that_is_missing_is_named():
    with pytest.raises(ImageError, match="ended with 3:\nwhat went wrong"):
        run(["sh", "-c", "echo what went wrong >&2; exit 3"])
    with pytest.raises(ImageError, match="no-such-program: program not found"):
        run(["no-such-program"])


def test_the_date_of_a_build_is_what_is_asked_for(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1750000000")
    assert project.epoch() == 1_750_000_000


@pytest.mark.parametrize("given", ["abc", "-5", "1.5", " 1", "0x10", "4294967296", "9" * 5000, "٣"])
def test_a_date_that_is_none_is_refused_and_not_another_taken(monkeypatch: pytest.MonkeyPatch, given: str):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", given)
    with pytest.raises(ImageError, match=r"SOURCE_DATE_EPOCH: .* is not 0 to 4294967295\n  \(give Unix seconds"):
        project.epoch()


def test_without_a_date_it_is_that_of_the_last_commit(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "")
    monkeypatch.setattr(project, "run", lambda words, folder: "1750000001\n")
    assert project.epoch() == 1_750_000_001


class Listed(packages.Archive):
    """An archive whose apt has a list of one package."""

    def __init__(self, folder: Path, octets: bytes) -> None:
        super().__init__(folder, read(project.PROJECT / "image/image.toml").base)
        self.said = f"'http://x/a_1_arm64.deb' a_1_arm64.deb 3 SHA256:{hashlib.sha256(octets).hexdigest()}\n"
        (folder / "archives").mkdir(parents=True)
        (folder / "archives/a_1_arm64.deb").write_bytes(b"abc")

    def _apt(self, *words: str, folder: Path | None = None) -> str:
        return self.said


def test_a_package_that_is_kept_is_the_one_that_apts_signed_list_names(tmp_path: Path):
    assert Listed(tmp_path / "same", b"abc").closed(["a"])[0].file == "a_1_arm64.deb"
    for ask in (packages.Archive.closed, packages.Archive.alone):
        with pytest.raises(ImageError, match=r"a_1_arm64\.deb: SHA-256 differs from that in apt's list"):
            ask(Listed(tmp_path / ask.__name__, b"abd"), ["a"])
    listed = Listed(tmp_path / "none", b"abc")
    listed.said = "'http://x/a_1_arm64.deb' a_1_arm64.deb 3 \n"
    with pytest.raises(ImageError, match="apt's list lacks its SHA-256"):
        listed.closed(["a"])


def test_a_package_that_has_changed_since_it_was_listed_is_not_installed(tmp_path: Path):
    (tmp_path / "a_1_arm64.deb").write_bytes(b"abc")
    one = Package("a", "1", "arm64", hashlib.sha256(b"abc").hexdigest(), "a_1_arm64.deb")
    assert packages.paths(tmp_path, [one]) == [tmp_path / one.file]
    with pytest.raises(ImageError, match="differs from the listed package"):
        packages.paths(tmp_path, [one._replace(sha256="0" * 64)])
    with pytest.raises(ImageError, match="is no longer in"):
        packages.paths(tmp_path, [one._replace(file="b_1_arm64.deb")])


class Asked:
    """Steps that make nothing. inputs: of each, by its name."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.inputs: dict[str, list[str | Path]] = {}

    def made(self, name: str, inputs: list[str | Path], make: object, forced: bool = False) -> Path:
        self.inputs[name] = inputs
        return self.folder / name


def test_a_step_is_made_again_when_the_code_that_makes_it_has_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    made = build.Build.__new__(build.Build)
    made.description = read(project.PROJECT / "image/image.toml")
    asked = made.steps = Asked(tmp_path)  # type: ignore[assignment]
    monkeypatch.setattr(build, "key", str)
    monkeypatch.setattr(freezing, "key", str)
    monkeypatch.setattr("image.program.frozen.own_python", lambda: tmp_path)
    monkeypatch.setattr("image.program.frozen.imports", lambda folder: [])
    monkeypatch.setattr("image.program.frozen.inputs", list)
    monkeypatch.setattr("image.program.frozen.messages_inputs", list)
    (tmp_path / "messages").mkdir()
    (tmp_path / "messages/x.so").touch()
    made._userland([])
    made._unpacked([])
    chosen = freezing.Chosen([], tmp_path)
    freezing.Freezing(asked, frozen.AARCH64).program(chosen, chosen)  # type: ignore[arg-type]
    assert any("mmdebstrap" in str(words) for words in asked.inputs["userland"])
    assert build.HERE / "parts/kernel.py" in asked.inputs["kernel"]
    for name in ("freezer", "foreign", "messages", "program"):
        assert {build.HERE / "program/freezing.py", build.HERE / "program/frozen.py"} <= set(asked.inputs[name]), name
