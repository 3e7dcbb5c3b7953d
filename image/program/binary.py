"""Freezes captain for this machine: a directory and one file (make binary)."""

import shutil
import sys
from contextlib import closing
from pathlib import Path

from image.errors import ImageError
from image.program import foreign, frozen
from image.program.contents import bytecode, layers
from image.project import PROJECT
from image.step import Steps, key
from image.tool import run

BUILT = PROJECT / "build/binary"
FREEZER = PROJECT / "build/freeze/bin/python"  # environment with PyInstaller and captain's dependencies only


def make(to: Path = BUILT, python: Path = FREEZER) -> tuple[Path, Path]:
    """Make the directory and the single file, if an input has changed; return their paths.

    Raises ImageError if the messages have not been built.
    """
    with closing(Steps(to)) as steps:
        libraries = [Path(line) for line in run([python, "-c", _LIBRARIES]).splitlines()]
        names = foreign.imports(PROJECT, libraries)

        def freeze(folder: Path) -> None:
            shutil.copy(frozen.SPEC, folder)
            (folder / "__main__.py").write_text(foreign.script(names))
            words: list[str | Path] = [python, "-m", "PyInstaller", *frozen.OPTIONS, "--workpath", folder / "work"]
            run(
                [*words, "--distpath", folder, folder / frozen.SPEC.name],
                environment={"PYTHONHASHSEED": "0", "PYINSTALLER_CONFIG_DIR": str(folder / "work")},
            )
            run([folder / "captain-dir/captain"])  # check: the program imports all modules

        kept = steps.made("foreign", [str(python), *names, frozen.SPEC, PROJECT / frozen.LOCK], freeze)
        parts = {path.name: path for path in sorted((PROJECT / "build/codec/python").glob(f"{foreign.MESSAGES}*.so"))}
        if not parts:
            raise ImageError(f"build/codec/python: has no {foreign.MESSAGES}", "make codec comes first")
        beside = layers.files(PROJECT, {**parts, frozen.RADIO: PROJECT / frozen.BUILT_RADIO})

        directory, file = to / "captain-dir", to / "captain"

        def join(folder: Path) -> None:
            shutil.rmtree(directory, ignore_errors=True)
            run([python, bytecode.__file__, PROJECT, folder / "ours"], environment={"PYTHONHASHSEED": "0"})
            tools = layers.Tools()
            layers.directory(kept / "captain-dir", bytecode.read(folder / "ours"), beside, tools, directory)
            layers.one_file(directory, tools, file)

        is_there = directory.exists() and file.exists()
        steps.made("program", [key(kept), *frozen.inputs(), *beside.values()], join, forced=not is_there)
        return directory, file


_LIBRARIES = "import sysconfig; print(*(sysconfig.get_path(name) for name in ('stdlib', 'purelib')), sep='\\n')"

if __name__ == "__main__":
    try:
        make()
    except ImageError as error:
        sys.exit(f"binary: {error}")
