"""Repository of a release: apt installs from it by its key, and refuses it without a signature or after a change."""

import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from image.errors import ImageError
from image.program import deb, repository
from image.tool import run
from tests.image.program.conftest import MACHINE

EPOCH = 1_750_000_000
ARCHITECTURES = ("amd64", "arm64")
# As image.packages has it: apt of a folder, without the machine's own sources and packages.
CONF = """\
Dir::State "{folder}"; Dir::State::status "{folder}/status"; Dir::Cache "{folder}"; Dir::Log "{folder}";
Dir::Etc::SourceList "{folder}/sources.list"; Dir::Etc::SourceParts "/dev/null"; APT::Sandbox::User "";
Dir::Etc::Trusted "/dev/null"; Dir::Etc::TrustedParts "/dev/null"; APT::Architecture "{architecture}";
APT::Architectures {{ "{architecture}"; }}; Debug::NoLocking "true"; Acquire::Languages "none";
"""


@pytest.fixture(scope="module")
def key() -> Iterator[str]:
    """Fingerprint of a throwaway key. The folder's path is short, because gpg's agent has a socket in it."""
    with tempfile.TemporaryDirectory(prefix="gpg-") as name, pytest.MonkeyPatch.context() as patch:
        patch.setenv("GNUPGHOME", name)
        made = ["--batch", "--passphrase", "", "--quick-generate-key", "captain test", "ed25519", "sign", "1d"]
        said = run(["gpg", "--status-fd", "1", *made])
        yield said.split("KEY_CREATED")[1].split()[1]
        run(["gpgconf", "--kill", "all"])


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("packages")
    made = []
    for name, architecture in (("captain", "amd64"), ("captain", "arm64"), ("captain-box", "all")):
        root = folder / f"{name}-{architecture}"
        deb.write(root / "usr/share" / name, architecture.encode())
        about = deb.About(name, "1.2.3", architecture, "Depends: passwd", "synopsis", " description\n")
        made.append(folder / f"{name}_1.2.3_{architecture}.deb")
        deb.build(root, about, None, EPOCH, made[-1])
    return made


@pytest.fixture
def signed(packages: list[Path], key: str, tmp_path: Path) -> Path:
    repository.make(packages, ARCHITECTURES, EPOCH, tmp_path / "apt", key)
    return tmp_path / "apt"


def apt(tree: Path, folder: Path, *words: str, architecture: str = MACHINE) -> str:
    """Update the lists of a tree in an apt of its own, then run apt-get. Raises ImageError if apt refuses."""
    shutil.rmtree(folder, ignore_errors=True)
    for name in ("lists/partial", "archives/partial"):
        (folder / name).mkdir(parents=True)
    (folder / "status").touch()
    rows = f"deb [signed-by={tree / repository.KEY}] file:{tree} {repository.SUITE} {repository.COMPONENT}\n"
    (folder / "sources.list").write_text(rows)
    (folder / "conf").write_text(CONF.format(folder=folder, architecture=architecture))
    environment = {"APT_CONFIG": str(folder / "conf")}
    run(["apt-get", "-qq", "update", "-o", "APT::Update::Error-Mode=any"], environment=environment)
    return run(["apt-get", "-qq", *words], folder=folder, environment=environment)


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_apt_fetches_the_packages_of_its_processor_by_the_key(signed: Path, tmp_path: Path, architecture: str):
    apt(signed, tmp_path / "own", "download", "captain", "captain-box", architecture=architecture)
    names = {path.name for path in (tmp_path / "own").glob("*.deb")}
    assert names == {f"captain_1.2.3_{architecture}.deb", "captain-box_1.2.3_all.deb"}


def test_apt_refuses_a_tree_without_signature(packages: list[Path], signed: Path, tmp_path: Path):
    shutil.copy(signed / repository.KEY, tmp_path)
    repository.make(packages, ARCHITECTURES, EPOCH, signed)
    assert not (signed / repository.KEY).exists()
    shutil.copy(tmp_path / repository.KEY, signed)
    with pytest.raises(ImageError, match="is not signed"):
        apt(signed, tmp_path / "own", "download", "captain")


def test_apt_refuses_a_changed_list_and_a_changed_package(signed: Path, tmp_path: Path):
    package = signed / f"pool/captain_1.2.3_{MACHINE}.deb"
    package.write_bytes(package.read_bytes()[:-1] + b"x")
    with pytest.raises(ImageError, match=r"(?i)hash sum mismatch|unexpected size"):
        apt(signed, tmp_path / "own", "download", "captain")
    release = signed / "dists/stable/InRelease"
    release.write_text(release.read_text().replace("Origin: captain", "Origin: another"))
    with pytest.raises(ImageError, match="BADSIG"):
        apt(signed, tmp_path / "own", "download", "captain")


def test_lists_of_equal_packages_are_equal(packages: list[Path], tmp_path: Path):
    for name in ("one", "two"):
        repository.make(packages, ARCHITECTURES, EPOCH, tmp_path / name)
    files = sorted(path.relative_to(tmp_path / "one") for path in (tmp_path / "one").rglob("*") if path.is_file())
    assert len(files) == 6
    for file in files:
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes(), file


def test_key_without_secret_part_or_not_a_fingerprint_is_refused(key: str):
    repository.check(key)
    with pytest.raises(ImageError, match="cannot sign"):
        repository.check("0" * 40)
    with pytest.raises(ImageError, match="is not a fingerprint"):
        repository.check("captain@example.org")
