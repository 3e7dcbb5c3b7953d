"""captain for this machine, in both forms: a directory, and one file. `python -m image.binary`, by make binary."""

import shutil
import sys
from contextlib import closing
from pathlib import Path

from image import bytecode, foreign, frozen, layers
from image.errors import ImageError
from image.program import run
from image.project import PROJECT
from image.step import Steps, key

BUILT = PROJECT / "build/binary"
FREEZER = PROJECT / "build/freeze/bin/python"  # with PyInstaller and what captain needs, and nothing else


def make(to: Path = BUILT, python: Path = FREEZER) -> tuple[Path, Path]:
    """The directory and the file, made again where something has changed. Raises ImageError."""
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
            run([folder / "captain-dir/captain"])  # imports it all

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
