"""Debian packages for this machine's processor, made without root (make deb)."""

import shutil
import sys
from contextlib import closing
from pathlib import Path

from image.errors import ImageError
from image.packages import native_architecture
from image.program import binary, deb, developer, licences, programs
from image.program.contents import layers
from image.program.programs import Artefact
from image.project import PROJECT, epoch, version
from image.step import Steps
from image.tool import run

BUILT = PROJECT / "build/deb"
WHEELS = PROJECT / "build/wheels"  # made by .ci/wheels
STEPS = PROJECT / "build/developer"
_PYTHON = """
import sysconfig
print(sysconfig.get_path("purelib"), sysconfig.get_path("stdlib"), sysconfig.get_config_var("MULTIARCH"), sep="\\n")
"""


def make(directory: Path, python: Path, tree: Path, to: Path = BUILT) -> list[Artefact]:
    """Make the packages in an empty folder, with the wheels and checksums.

    directory  captain as a directory, of this machine's interpreter and C library.
    python     interpreter of the environment that it was frozen from.
    tree       files of captain-dev, a result of developer.installed().

    Raises ImageError if a step fails.
    """
    shutil.rmtree(to, ignore_errors=True)
    to.mkdir(parents=True)
    processor = native_architecture()
    package = to / f"captain_{version()}_{processor}.deb"
    deb.make(directory, processor, version(), documents(directory, python), epoch(), package)
    said = run([directory / "captain", "--version"]).strip()
    made = [
        programs.of_directory(package, directory, said),
        programs.of_box(to),
        programs.of_developer(tree, processor, to),
        *(Artefact(Path(shutil.copy(path, to))) for path in sorted(WHEELS.glob("*.whl"))),
    ]
    programs.write_sums(made, to)
    return made


def documents(directory: Path, python: Path) -> dict[str, bytes]:
    """Return the documents of the package, by path below /usr/share/doc/captain.

    The licences are those of its modules, of the Debian packages of its libraries, and of the interpreter.

    Raises ImageError if Python or dpkg does not run.
    """
    site, library, processor = run([python, "-c", _PYTHON]).splitlines()
    names = sorted(path.name for path in (directory / layers.INSIDE).glob("lib*.so*"))
    # dpkg fails if a library is of no package, such as that of an interpreter in /usr/local.
    owners = run(["sh", "-c", 'dpkg --search "$@" || :', "sh", *(f"*/lib/{processor}/{name}" for name in names)])
    notices = [Path(f"/usr/share/doc/{name}/copyright") for name in licences.of_libraries(directory, owners)]
    notices.append(Path(library) / "LICENSE.txt")
    return licences.documents(directory, Path(site), [path for path in notices if path.exists()])


def main() -> int:
    try:
        with closing(Steps(STEPS)) as steps:
            tree = developer.installed(steps, "installed", run(["gcc", "-print-multiarch"]).strip())
            made = make(binary.make()[0], binary.FREEZER, tree)
    except ImageError as error:
        print(f"deb: {error}", file=sys.stderr)
        return 1
    print(*made, BUILT / programs.SUMS, sep="\n")
    return 0 if all(row.is_ok for row in made) else 1


if __name__ == "__main__":
    sys.exit(main())
