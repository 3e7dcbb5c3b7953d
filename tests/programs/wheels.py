"""make wheels-test: both wheels in new Debian roots: installed offline into an empty environment, and used."""

import argparse
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from image.packages import native_architecture
from tests.programs import parts
from tests.programs.debian import APT, PROJECT, Debian
from tests.proof.image.rows import Row

MADE = PROJECT / "build/wheels"
RESULTS = PROJECT / "build/wheels-test/results.json"
PYTHONS = {"bookworm": "3.11", "trixie": "3.13"}  # Debian's own, by suite
DECLARED = ["python3", "python3-venv"]
LOCK = PROJECT / ".ci/locks/run.txt"
# A CAM of a public example (asn1tools).
CAM = "02029b260aa393e6005a6f0da4ae7bfb35a238230a6a3d4290581a90a3f67e02e6928b37fee9fea6103fdf93d980"
_PROGRAM = f"""
import captain_client, captain_messages
from captain_client import Station, UnreachableError
from captain_client.codec import Decoded
assert all("/own/" in one.__file__ for one in (captain_client, captain_messages))
print(Decoded(bytes.fromhex("{CAM}"), "cam").exact()["header"]["stationID"])
try:
    Station(":1", timeout_s=0.1)
except UnreachableError:
    print("unreachable")
"""


def main() -> int:
    parser = argparse.ArgumentParser(prog="make wheels-test", description=__doc__)
    parser.add_argument("--suites", metavar="SUITE", nargs="+", choices=PYTHONS, default=list(PYTHONS))
    suites = parser.parse_args().suites
    wheels = sorted(MADE.glob("*.whl"))
    if len(wheels) != 2:
        print(f"wheels-test: {MADE}: {len(wheels)} wheels; make wheels builds both", file=sys.stderr)
        return 2
    return parts.show(((f"Python {PYTHONS[suite]}", _rows(suite, wheels)) for suite in suites), RESULTS)


def _rows(suite: str, wheels: list[Path]) -> Iterator[Row]:
    with tempfile.TemporaryDirectory(prefix="captain-") as name:
        yield from _in_debian(suite, wheels, Path(name))


def _in_debian(suite: str, wheels: list[Path], folder: Path) -> Iterator[Row]:
    debian = Debian(suite, native_architecture(), DECLARED, folder)
    ended = debian.run("sh", "-c", f"{APT} update && {APT} install {' '.join(DECLARED)}")
    yield _installed("Debian's own packages", ended)
    said = debian.run("python3", "--version").stdout.strip()
    yield Row("interpreter", said, f"Python {PYTHONS[suite]}", said.startswith(f"Python {PYTHONS[suite]}."))
    inside = " ".join(debian.copy(wheel) for wheel in [*wheels, _pyzmq(PYTHONS[suite], folder)])
    ended = debian.run("sh", "-c", f"python3 -m venv /own && /own/bin/pip install -q --no-index {inside}")
    yield _installed("both wheels, offline", ended)
    ended = debian.run("/own/bin/python", "-I", "-c", _PROGRAM)
    goal = "2602961571 unreachable"
    yield Row(
        "a CAM decoded, a missing station",
        " ".join(ended.stdout.split())[-80:],
        goal,
        goal in " ".join(ended.stdout.split()),
    )


def _installed(what: str, ended: "subprocess.CompletedProcess[str]") -> Row:
    is_ok = ended.returncode == 0
    return Row(what, "installed" if is_ok else ended.stdout.strip()[-80:], "installed", is_ok)


def _pyzmq(python: str, folder: Path) -> Path:
    """Return the locked wheel of pyzmq for a Python, the only package that the wheels need. Raises SubprocessError."""
    found = re.search(r"^pyzmq==(?:.*\\\n)*.*\n", LOCK.read_text(), re.MULTILINE)
    assert found is not None
    wanted = folder / "pyzmq.txt"
    wanted.write_text(found[0])
    platform = f"manylinux_2_28_{ {'amd64': 'x86_64', 'arm64': 'aarch64'}[native_architecture()] }"
    which = ["--require-hashes", "--only-binary", ":all:", "--python-version", python, "--platform", platform]
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "download", "-q", "--no-deps"]
    subprocess.run([*pip, *which, "-r", wanted, "--dest", folder], check=True)
    return next(folder.glob("pyzmq-*.whl"))


if __name__ == "__main__":
    sys.exit(main())
