"""The message library as a machine with ROS gets it: a wheel, installed into clean environments of each of its Pythons."""

import json
import shutil
import subprocess
import zipfile
from collections.abc import Iterator
from pathlib import Path

from asn1.backends.ros2.model import RosPackage
from tests.proof.ros2 import codec, ros
from tests.proof.ros2.rows import Row

# Humble, Jazzy's wheels of this bench, Jazzy. One wheel serves all of them.
VERSIONS = ("3.10", "3.11", "3.12")


def install(packages: list[RosPackage]) -> list[Row]:
    """A row for the wheel, and one for each Python that is here."""
    [wheel] = codec.made(packages).glob("*.whl")
    editions = [edition for package in packages for edition in package.tops]
    return [_looked_at(wheel), *(_row(version, wheel, editions) for version in VERSIONS)]


def _looked_at(wheel: Path) -> Row:
    """Its tag, and that its shared object asks for nothing beside Python and libc."""
    with zipfile.ZipFile(wheel) as archive:
        [name] = [one for one in archive.namelist() if one.endswith(".so")]
        archive.extract(name, ros.MADE)
    needed = _said("readelf", "-d", ros.MADE / name)
    libraries = [line.partition("[")[2].rstrip("]") for line in needed.splitlines() if "(NEEDED)" in line]
    is_abi3 = "-cp310-abi3-" in wheel.name and name.endswith(".abi3.so")
    trouble = "" if is_abi3 and set(libraries) <= {"libc.so.6"} else "not for the limited API alone"
    return Row(wheel.name, f"{wheel.stat().st_size / 1e6:.1f} MB, {name} needs {', '.join(libraries)}", trouble)


def _row(version: str, wheel: Path, editions: list[str]) -> Row:
    found = next(_found(version), None)
    if found is None:
        return Row(f"Python {version}", "not here")
    folder = ros.MADE / f"clean-{version}"
    shutil.rmtree(folder, ignore_errors=True)
    try:
        _said(found, "-m", "venv", folder)
        _said(folder / "bin" / "pip", "install", "--no-index", "--no-deps", wheel)
        # Every symbol is looked for at once; nothing of here is on its path.
        said = json.loads(
            _said("env", "LD_BIND_NOW=1", folder / "bin" / "python", "-I", ros.INSIDE / "wheel.py", *editions)
        )
    except ros.RosError as error:
        return Row(f"Python {version}", "ended early", str(error))
    shutil.rmtree(folder)
    what = f"{said['python']}: pip install, then {said['same']} of {said['messages']} messages to CDR and back, every profile"
    return Row(f"Python {version}", what, "" if said["same"] == said["messages"] > 0 else "not the same")


def _found(version: str) -> Iterator[str]:
    for name in (str(ros.ENV / "bin" / "python"), shutil.which(f"python{version}")):
        if (
            name is not None
            and version in subprocess.run([name, "-V"], capture_output=True, text=True, check=False).stdout
        ):
            yield name


def _said(*words: str | Path) -> str:
    ended = subprocess.run([str(word) for word in words], text=True, capture_output=True, check=False, cwd=ros.MADE)
    if ended.returncode:
        raise ros.RosError(f"{words[0]}: {(ended.stdout + ended.stderr)[-2000:]}")
    return ended.stdout
