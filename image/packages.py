"""Debian packages for the image: fetched by a separate apt, listed, and kept."""

import json
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from image import checksum
from image.description import Base
from image.errors import ImageError
from image.tool import run

LIST = "packages.json"

_CONF = """\
Dir::State "{folder}"; Dir::State::status "{folder}/status"; Dir::State::extended_states "{folder}/extended";
Dir::Cache "{folder}"; Dir::Cache::archives "{folder}/archives"; Dir::Log "{folder}";
Dir::Etc::SourceList "{folder}/sources.list"; Dir::Etc::SourceParts "/dev/null";
Dir::Etc::Preferences "/dev/null"; Dir::Etc::PreferencesParts "/dev/null"; APT::Sandbox::User "";
APT::Architecture "{architecture}"; APT::Architectures {{ "{architecture}"; }};
APT::Install-Recommends "false"; Acquire::Languages "none"; Debug::NoLocking "true";
"""


class Package(NamedTuple):
    """Package file. file: its name in the folder of the archive."""

    name: str
    version: str
    architecture: str
    sha256: str
    file: str


class Archive:
    """Packages of a Debian release for one architecture, which may differ from the build machine's.

    Packages and updates come from the archives that the build machine's apt uses, so no host is named here. Additional
    archives come from the sites in the description.
    """

    def __init__(self, folder: Path, base: Base, architecture: str = "") -> None:
        self._folder = folder.resolve()
        self._base = base
        self._architecture = architecture or base.architecture

    def update(self) -> None:
        """Fetch the lists of packages. Raises ImageError if apt has no list of this release."""
        for name in ("lists/partial", "archives/partial", "none/partial"):
            (self._folder / name).mkdir(parents=True, exist_ok=True)
        (self._folder / "status").touch()
        sites = _sites()
        for mends in self._base.mends:
            if mends not in sites and self._architecture == self._base.architecture:  # reported once per build
                what = f"no updates for {self._base.suite}"
                print(f"image: this machine's apt has no archive {mends}: {what}", file=sys.stderr)
        (self._folder / "sources.list").write_text(sources(self._base, sites))
        (self._folder / "conf").write_text(_CONF.format(folder=self._folder, architecture=self._architecture))
        self._apt("apt-get", "-qq", "update")

    def closed(self, names: Iterable[str]) -> list[Package]:
        """Fetch packages with all their dependencies; a name may be a pattern of apt: ?essential.

        Raises ImageError if apt's list has no SHA-256 of a package, or another one.
        """
        # An empty folder, because apt would not list packages that are in its folder of archives already.
        elsewhere = f"Dir::Cache::archives={self._folder}/none"
        return self._fetched(
            self._apt("apt-get", "-qq", "-y", "-o", elsewhere, "--print-uris", "install", *sorted(names))
        )

    def alone(self, names: Iterable[str]) -> list[Package]:
        """Fetch packages without their dependencies.

        Raises ImageError if apt's list has no SHA-256 of a package, or another one.
        """
        return self._fetched(self._apt("apt-get", "-qq", "--print-uris", "download", *sorted(names)))

    def behind(self, name: str) -> str:
        """Return the kernel that a metapackage depends on: linux-image-6.12... for linux-image-arm64."""
        depends = re.findall(r"^ *Depends: (\S+)", self._apt("apt-cache", "depends", name), re.MULTILINE)
        return next((each for each in depends if re.match(r"linux-image-\d", each)), name)

    def _fetched(self, uris: str) -> list[Package]:
        found = re.findall(r"^'[^']+' (\S+)_(\S+)_(\S+)\.deb \d+ (?:SHA256:([0-9a-f]{64}))?", uris, re.MULTILINE)
        wanted, hashes = [parts[:3] for parts in found], [parts[3] for parts in found]
        names = [f"{name}={version.replace('%3a', ':')}" for name, version, _ in wanted]
        files = self._folder / "archives"
        missing = [
            name for name, parts in zip(names, wanted, strict=True) if not (files / f"{'_'.join(parts)}.deb").exists()
        ]
        if missing:
            self._apt("apt-get", "-qq", "download", *missing, folder=files)
        # Kept files are verified too, because they may be truncated or foreign.
        listed = [_package(files / f"{'_'.join(parts)}.deb") for parts in wanted]
        for package, sha256 in zip(listed, hashes, strict=True):
            if not sha256:
                raise ImageError(f"{package.file}: apt's list lacks its SHA-256", "use apt-get of Debian 12 or newer")
            if package.sha256 != sha256:
                raise ImageError(f"{files / package.file}: SHA-256 differs from that in apt's list", "remove the file")
        return sorted(listed)

    def _apt(self, *words: str, folder: Path | None = None) -> str:
        words = (words[0], "-o", "Acquire::ForceHash=SHA256", *words[1:])  # else `install` prints MD5
        return run(words, folder=folder, environment={"APT_CONFIG": str(self._folder / "conf")})


def sources(base: Base, sites: Mapping[str, str]) -> str:
    """Return apt's list of sources for a base. Raises ImageError if keys are missing.

    sites  URL by suffix of the suite; "" is the suite itself.
    """
    keys, components = _keys("base", base.keyring), " ".join(base.components)
    lines = [
        f"deb [signed-by={keys}] {sites[mends]} {base.suite}{mends} {components}"
        for mends in ("", *base.mends)
        if mends in sites
    ]
    for index, one in enumerate(base.beside):
        how = f"arch={base.architecture} signed-by={_keys(f'base.beside[{index}]', one.keyring)}"
        lines.append(f"deb [{how}] {one.site} {one.suite} {' '.join(one.components)}")
    return "\n".join(lines) + "\n"


def _keys(table: str, path: str) -> str:
    if not Path(path).exists():
        raise ImageError(f"{table}.keyring: {path}: not found", "`.ci/setup image` installs Debian's")
    return path


def paths(folder: Path, packages: Iterable[Package]) -> list[Path]:
    """Return the paths of listed packages, after verification. Raises ImageError if one is absent or different."""
    found = []
    for package in packages:
        path = folder / package.file
        if not path.exists():
            raise ImageError(f"{path.name} is no longer in {folder}", "python -m image build --upgrade")
        if _package(path).sha256 != package.sha256:
            raise ImageError(f"{path}: differs from the listed package", "remove it; python -m image build --upgrade")
        found.append(path)
    return found


def native_architecture() -> str:
    """Return this machine's architecture by Debian's name: amd64."""
    return run(["dpkg", "--print-architecture"]).strip()


def write_list(path: Path, packages: Sequence[Package]) -> None:
    path.write_text(json.dumps([package._asdict() for package in sorted(packages)], indent=1) + "\n")


def read_list(path: Path) -> list[Package]:
    """Read a list of packages. Raises ImageError if it is invalid, OSError if it cannot be read."""
    try:
        return [Package(**row) for row in json.loads(path.read_text())]
    except (TypeError, ValueError) as error:
        raise ImageError(f"{path}: not a list of packages: {error}", "python -m image build --upgrade") from error


def write_index(folder: Path, packages: Iterable[Package]) -> None:
    """Write the file `Packages`, which makes the folder a repository for apt with exactly these packages."""
    entries = []
    for package in packages:
        path = folder / package.file
        control = run(["dpkg-deb", "-f", path]).rstrip("\n")
        entries.append(
            f"{control}\nFilename: ./{package.file}\nSize: {path.stat().st_size}\nSHA256: {package.sha256}\n"
        )
    (folder / "Packages").write_text("\n".join(entries))


def _package(path: Path) -> Package:
    name, version, architecture = path.stem.replace("%3a", ":").split("_")
    return Package(name, version, architecture, checksum.sha256(path), path.name)


def _sites() -> dict[str, str]:
    """Return this machine's archives by suffix of the suite. Raises ImageError if apt has no lists."""
    release = re.search(r"^VERSION_CODENAME=(\S+)", Path("/etc/os-release").read_text(), re.MULTILINE)
    own = release[1] if release else ""
    lines = run(["apt-get", "indextargets", "--format", "$(SITE) $(CODENAME)", "Created-By: Packages"]).splitlines()
    found = [line.split()[:2] for line in lines if own and f" {own}" in line]
    sites = {suite.removeprefix(own): site for site, suite in reversed(found) if suite.startswith(own)}
    if "" not in sites:
        raise ImageError("apt has no list of this release's packages", "as root: apt-get update")
    return sites
