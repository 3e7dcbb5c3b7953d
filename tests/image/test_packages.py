"""Sources of packages: Debian's archive, and a second one."""

import dataclasses
import re
import subprocess
from pathlib import Path

import pytest

from image.description import Base, Beside
from image.errors import ImageError
from image.packages import Archive, Package, _sites, sources, write_index

DEBIAN = Base("trixie", "arm64", ("main", "non-free-firmware"), __file__)
OTHER = Beside("file:/srv/others", "trixie", ("main",), __file__)


def test_the_base_has_one_archive_and_the_description_may_name_more():
    own = f"deb [signed-by={__file__}] file:/srv/debian trixie main non-free-firmware\n"
    assert sources(DEBIAN, {"": "file:/srv/debian", "-security": "file:/srv/mends"}) == own
    other = f"deb [arch=arm64 signed-by={__file__}] file:/srv/others trixie main\n"
    assert sources(dataclasses.replace(DEBIAN, beside=(OTHER,)), {"": "file:/srv/debian"}) == own + other


def test_mends_are_taken_from_where_this_machine_has_its_own():
    sites = {"": "file:/srv/debian", "-security": "file:/srv/mends", "-backports": "file:/srv/debian"}
    both = dataclasses.replace(DEBIAN, mends=("-security", "-updates"))
    assert sources(both, sites).splitlines() == [
        f"deb [signed-by={__file__}] file:/srv/debian trixie main non-free-firmware",
        f"deb [signed-by={__file__}] file:/srv/mends trixie-security main non-free-firmware",
    ]


def test_sites_are_told_apart_by_their_suites(monkeypatch: pytest.MonkeyPatch):
    own = re.search(r"^VERSION_CODENAME=(\S+)", Path("/etc/os-release").read_text(), re.MULTILINE)
    assert own is not None
    said = [
        f"file:/first {own[1]}",
        f"file:/second {own[1]}",
        f"file:/mends {own[1]}-security",
        "file:/x other",
        "file:/flat ",
    ]
    monkeypatch.setattr("image.packages.run", lambda words: "\n".join(said) + "\n")
    assert _sites() == {"": "file:/first", "-security": "file:/mends"}
    said[:2] = []
    with pytest.raises(ImageError, match=r"^apt has no list of this release's packages"):
        _sites()


def test_keys_that_are_missing_are_named():
    with pytest.raises(ImageError, match=r"^base.keyring: /no/keys: not found"):
        sources(dataclasses.replace(DEBIAN, keyring="/no/keys"), {})
    missing = dataclasses.replace(DEBIAN, beside=(OTHER, dataclasses.replace(OTHER, keyring="/no/keys")))
    with pytest.raises(ImageError, match=r"^base.beside\[1\].keyring: /no/keys: not found"):
        sources(missing, {})


@pytest.mark.parametrize(
    ("name", "kernel"),
    [
        ("linux-image-arm64", "linux-image-6.12.48+deb13-arm64"),
        ("linux-image-rpi-v8", "linux-image-6.12.47+rpt-rpi-v8"),
        ("linux-image-6.12.47+rpt-rpi-v8", "linux-image-6.12.47+rpt-rpi-v8"),
    ],
)
def test_the_kernel_behind_a_name_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, kernel: str):
    monkeypatch.setattr("image.packages._sites", dict)
    monkeypatch.setattr("image.packages.sources", lambda base, sites: f"deb [trusted=yes] file:{tmp_path} ./\n")
    files = []
    for package, depends in ((kernel, "kmod"), (name, kernel), ("kmod", "")):
        if package not in {one.name for one in files}:
            files.append(_made(tmp_path, package, depends))
    write_index(tmp_path, files)
    archive = Archive(tmp_path / "state", DEBIAN)
    archive.update()
    assert archive.behind(name) == kernel


def _made(folder: Path, name: str, depends: str) -> Package:
    control = folder / name / "DEBIAN/control"
    control.parent.mkdir(parents=True)
    lines = [f"Package: {name}", "Version: 1", "Architecture: arm64", "Maintainer: nobody", "Description: none"]
    control.write_text("\n".join([*lines, *([f"Depends: {depends}"] if depends else [])]) + "\n")
    subprocess.run(["dpkg-deb", "-b", "-Znone", folder / name, folder / f"{name}_1_arm64.deb"], check=True, stdout=-3)
    return Package(name, "1", "arm64", "0" * 64, f"{name}_1_arm64.deb")
