"""make programs-test: captain's programs in new Debian roots and containers: installed, run, measured."""

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from image.packages import native_architecture
from image.program.programs import PROCESSORS, SUMS
from image.project import version
from tests.programs import containers, forms, parts
from tests.programs.debian import APT, PROJECT, SUITES, Debian
from tests.proof.image.rows import Row

MADE = PROJECT / "build/programs"
RESULTS = PROJECT / "build/programs-test/results.json"
SHORT = ("bookworm",)  # the oldest, which has the least of what a program may ask for
DECLARED = ["passwd", "procps"]  # beside the C library, which every root has
# A CAM of a public example (asn1tools), and what another decoder reads in it.
CAM = "02029b260aa393e6005a6f0da4ae7bfb35a238230a6a3d4290581a90a3f67e02e6928b37fee9fea6103fdf93d980"
VALUES = (
    "stationID: 2602961571",
    "latitude: 500401189",
    "longitude: 144050093",
    "speedValue: 2028",
    "yawRateValue: -85",
)
SHOWN_LINES = 40  # of a program that failed: all that the doctor says


def main() -> int:
    arguments = _arguments()
    if not (MADE / SUMS).exists():
        print(f"programs-test: {MADE / SUMS}: is missing; make programs builds what is tested", file=sys.stderr)
        return 2
    return parts.show(_parts(arguments), RESULTS)


def _parts(arguments: argparse.Namespace) -> Iterator[tuple[str, Iterator[Row]]]:
    suites = SHORT if arguments.short else tuple(SUITES)
    for processor in PROCESSORS:
        if processor.debian not in arguments.only:
            continue
        package = MADE / f"captain_{version()}_{processor.debian}.deb"
        program = MADE / f"captain-{version()}-{processor.name}"
        yield processor.debian, _figures(package, program)
        for suite in suites:
            part = f"{processor.debian}, {SUITES[suite]}"
            yield part, _in_debian(suite, processor.debian, package, program)
        if processor.debian == native_architecture() or not arguments.short:
            image = MADE / f"captain-{version()}-{processor.debian}.oci.tar"
            yield f"{processor.debian}, containers", _in_containers(image)


def _in_containers(image: Path) -> Iterator[Row]:
    with tempfile.TemporaryDirectory(prefix="captain-") as name:
        yield from containers.rows(image, Path(name))


def _figures(package: Path, program: Path) -> Iterator[Row]:
    with tempfile.TemporaryDirectory() as name:
        yield from forms.rows(package, program, Path(name))


def _in_debian(suite: str, architecture: str, package: Path, program: Path) -> Iterator[Row]:
    with tempfile.TemporaryDirectory(prefix="captain-") as name:
        began = time.monotonic()
        debian = Debian(suite, architecture, DECLARED, Path(name))
        libraries = debian.run("dpkg-query", "--show", "--showformat=${Version}", "libc6").stdout
        yield Row("new root", f"libc6 {libraries}, {time.monotonic() - began:.0f} s", "", True)
        yield from _installed(debian, debian.copy(package))
        yield from _run("package", debian, "captain", ["--config", "/etc/captain/captain.toml", "--board", "none"])
        yield from _run("one file", debian, debian.copy(program), [])


def _installed(debian: Debian, package: str) -> Iterator[Row]:
    names = "dpkg-query --show --showformat '${Package}\\n'"
    before = set(debian.run("sh", "-c", names).stdout.split())
    ended = debian.run("sh", "-c", f"{APT} update && {APT} install {package}")
    new = sorted(set(debian.run("sh", "-c", names).stdout.split()) - before)
    yield _row("package: apt installs it", ended, ", ".join(new), "captain, with declared packages alone")
    yield _row("package: dpkg --verify", debian.run("dpkg", "--verify", "captain"), "", "no difference", "")


def _run(form: str, debian: Debian, captain: str, doctor: list[str]) -> Iterator[Row]:
    """What it says, and what `captain doctor` finds. doctor: its options; none: the simulated board's station."""
    yield _row(
        f"{form}: --version", debian.run(captain, "--version"), "", f"captain {version()}", f"captain {version()}"
    )
    own = subprocess.run(
        [PROJECT / ".venv/bin/captain", "decode", CAM],
        capture_output=True,
        text=True,
        check=True,
        stdin=subprocess.DEVNULL,
    ).stdout
    ended = debian.run(captain, "decode", CAM)
    is_right = ended.stdout == own and all(value in own for value in VALUES)
    seen = f"{len(ended.stdout.splitlines())} lines, {'the same' if ended.stdout == own else 'others'}"
    yield _row(f"{form}: decode of a CAM", ended, seen, f"the source's text, with {VALUES[0]}", is_ok=is_right)
    ended = debian.run(captain, "doctor", *doctor)
    last = ended.stdout.strip().splitlines()[-1:] or [""]
    yield _row(f"{form}: doctor", ended, last[0], "problems: 0", is_ok=last[0].startswith("problems: 0,"))


def _row(
    what: str,
    ended: "subprocess.CompletedProcess[str]",
    seen: str,
    goal: str,
    said: str | None = None,
    is_ok: bool = True,
) -> Row:
    """Of a program that ended. said: all that it has to say; None: whatever it says."""
    text = ended.stdout.strip()
    is_ok = is_ok and ended.returncode == 0 and said in (None, text)
    if not is_ok:
        print(*text.splitlines()[-SHOWN_LINES:], sep="\n", flush=True)
    return Row(what, seen or text or "nothing said", goal, is_ok)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="make programs-test", description=__doc__)
    names = [processor.debian for processor in PROCESSORS]
    parser.add_argument(
        "--only", metavar="ARCH", nargs="+", choices=names, default=names, help="amd64, arm64: this one"
    )
    parser.add_argument("--short", action="store_true", help="Debian 12 alone, containers of this processor")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
