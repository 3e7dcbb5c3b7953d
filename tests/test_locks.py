"""Lock files: .ci/lock writes them, and .ci/setup installs from them."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
LOCKS = sorted((ROOT / ".ci" / "locks").glob("*.txt"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def versions(lock: Path) -> dict[str, str]:
    return dict(re.findall(r"^([a-z0-9-]+)==([^ ]+)", lock.read_text(), re.MULTILINE))


def wanted(purpose: str) -> list[str]:
    """Return the packages that pyproject.toml names for a purpose, without versions."""
    extras = PROJECT["optional-dependencies"]
    names = [*PROJECT["dependencies"], *extras["build"], *extras.get(purpose, [])]
    return [re.split(r"[=<>~!\[; ]", name)[0].lower() for name in names]


@pytest.mark.parametrize("lock", LOCKS, ids=lambda lock: lock.stem)
def test_a_lock_holds_every_package_that_its_purpose_names(lock: Path):
    assert set(wanted(lock.stem)) <= set(versions(lock))


@pytest.mark.parametrize("lock", LOCKS, ids=lambda lock: lock.stem)
def test_every_package_of_a_lock_has_hashes_and_no_address(lock: Path):
    text = lock.read_text()
    entries = re.split(r"\n(?=[a-z])", text)
    assert all("--hash=sha256:" in entry for entry in entries)
    assert "://" not in text
    assert "index-url" not in text


def test_a_package_has_the_same_version_in_all_locks():
    # The tests must run with the same versions as the program, from source and in the binary.
    found: dict[str, set[str]] = {}
    for lock in LOCKS:
        for name, version in versions(lock).items():
            found.setdefault(name, set()).add(version)
    assert {name: each for name, each in found.items() if len(each) > 1} == {}
