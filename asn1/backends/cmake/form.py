"""Output format cmake: the C sources as a CMake package."""

import shutil
from pathlib import Path

from asn1.backends.backend import VERSION, Job, OwnOption, Progress
from asn1.backends.c.form import Sources
from asn1.backends.output import FileBackend

TEMPLATE = Path(__file__).parent / "template"


class CMakePackage(FileBackend):
    """The C sources with CMake and pkg-config files."""

    name = "cmake"
    summary = "C library with CMake package, pkg-config file, C++ headers and examples"
    next_step = (
        "cmake -S {folder} -B {folder}/build && cmake --build {folder}/build -j && "
        "cmake --install {folder}/build --prefix DIR"
    )
    options: tuple[OwnOption, ...] = ("ros2",)

    def fill(self, job: Job, folder: Path, progress: Progress) -> None:
        Sources().fill(job, folder, progress)
        shutil.copytree(TEMPLATE, folder, copy_function=shutil.copy, dirs_exist_ok=True)
        if not (folder / "include" / "captain" / "r1_cam.hpp").exists():
            (folder / "example" / "cam.cpp").unlink()
        (folder / "sources.cmake").write_text(_sources(folder), encoding="utf-8")


def _sources(folder: Path) -> str:
    """Return the text of sources.cmake: version and names of the sources."""
    names = sorted(path.relative_to(folder).as_posix() for path in (folder / "src").glob("*.c"))
    lines = [
        f"set(CAPTAIN_MESSAGES_VERSION {VERSION})",
        f"set(CAPTAIN_MESSAGES_SOVERSION {VERSION.rpartition('.')[0]})",
        "set(CAPTAIN_MESSAGES_SOURCES",
        *(f"  {name}" for name in names),
        ")",
    ]
    return "\n".join(lines) + "\n"
