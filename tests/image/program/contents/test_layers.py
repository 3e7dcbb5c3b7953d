"""captain's two layers: what our modules import is in the one, and all that is ours in the other."""

import marshal
import sys
from pathlib import Path

import pytest

from image.program import foreign
from image.program.contents import archives, bytecode, layers
from image.tool import run

PROJECT = Path(__file__).resolve().parents[4]


def tree(root: Path, **texts: str) -> Path:
    """A project. firmware__cli="..." is firmware/cli.py."""
    for folder in bytecode.FOLDERS:
        (root / folder).mkdir(parents=True)
        (root / folder / "__init__.py").write_text("")
    for name, text in {"firmware____main__": "print('hello')", **texts}.items():
        path = root / f"{name.replace('__', '/', 1)}.py"
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    return root


def test_every_module_of_ours_is_compiled_and_nothing_else():
    names = [module.name for module in bytecode.compiled(PROJECT).modules]
    files = {path for folder in bytecode.FOLDERS for path in (PROJECT / folder).rglob("*.py")}
    apart = {PROJECT / place for place in bytecode.APART}
    assert [place for place in apart if not place.exists()] == []
    elsewhere = {path for path in files if apart & {path, *path.parents}}
    assert len(elsewhere) > 20, "what is for where ROS is has moved"
    assert len(names) == len(set(names)) == len(files - elsewhere)
    assert {
        "firmware",
        "firmware.cli",
        "board.runtime.worker",
        "drivers.mqtt.client.process",
        "pps.chrony.configuration",
        "captain_client",
        "captain_client.control",
    } <= set(names)


def test_a_module_is_named_as_it_is_imported_and_told_of_by_its_place_below_the_project(tmp_path: Path):
    root = tree(tmp_path, firmware__cli="def f(): 'said of it'; assert False")
    found = {module.name: module for module in bytecode.compiled(root).modules}
    assert (found["firmware"].is_package, found["firmware.cli"].is_package) == (True, False)
    code = marshal.loads(found["firmware.cli"].code)
    assert code.co_filename == "firmware/cli.py"
    function = next(each for each in code.co_consts if hasattr(each, "co_code"))
    assert function.co_consts == (None,)  # neither docstring nor assertion
    assert str(tmp_path).encode() not in found["firmware.cli"].code


def test_what_a_python_compiled_in_its_own_process_is_read_here(tmp_path: Path):
    root = tree(tmp_path / "project")
    run([sys.executable, "-I", bytecode.__file__, root, tmp_path / "ours"])
    ours = bytecode.read(tmp_path / "ours")
    assert [module.name for module in ours.modules] == sorted([*bytecode.FOLDERS, "firmware.__main__"])
    assert marshal.loads(ours.script).co_filename == "__main__.py"


def test_the_same_sources_give_the_same_octets(tmp_path: Path):
    for name in ("one", "two"):
        run([sys.executable, "-I", bytecode.__file__, PROJECT, tmp_path / name], environment={"PYTHONHASHSEED": "0"})
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("import zmq", ["zmq"]),
        ("def f():\n    import os.path as p, ssl", ["os.path", "ssl"]),
        ("try:\n    import bz2\nexcept ImportError:\n    import zlib", ["bz2", "zlib"]),
        ("from rich import text, nothing", ["rich", "rich.text"]),
        ("from collections import abc, Counter", ["collections", "collections.abc"]),
        ("from board.runtime.loop import Loop\nfrom . import x\nfrom .. import y\nimport captain_messages", []),
        ("from captain_client import sockets\nimport captain_client.address", []),
        (
            "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import secret\nelse:\n    import cmd",
            ["cmd", "typing"],
        ),
    ],
)
def test_imports_that_are_not_ours_are_found_wherever_they_stand(tmp_path: Path, text: str, found: list[str]):
    libraries = tmp_path / "lib"
    (libraries / "collections").mkdir(parents=True)
    (libraries / "collections/abc.py").touch()
    (libraries / "rich/text").mkdir(parents=True)
    assert foreign.imports(tree(tmp_path / "project", firmware__x=text), [libraries]) == found


def test_a_change_that_imports_nothing_new_leaves_what_is_frozen_alone(tmp_path: Path):
    one = tree(tmp_path / "one", firmware__x="import zmq\nA = 1")
    two = tree(tmp_path / "two", firmware__x="A = 2", board__y="import zmq\n")
    assert foreign.imports(one, []) == foreign.imports(two, [])


def test_what_is_to_be_frozen_can_be_imported():
    """Run by the freezer's program as its check; here by this Python."""
    run([sys.executable, "-c", foreign.script(foreign.imports(PROJECT, []))])


@pytest.fixture
def frozen(tmp_path: Path) -> Path:
    """A directory as the freezer leaves it: a program that carries a package, and files."""
    folder = tmp_path / "foreign"
    (folder / layers.INSIDE).mkdir(parents=True)
    (folder / layers.INSIDE / "libx.so.1").write_bytes(b"library")
    (folder / layers.INSIDE / "libx.so").symlink_to("libx.so.1")
    modules = b"PYZ\0magi" + (17).to_bytes(4, "big") + bytes(5) + marshal.dumps([])
    package = archives.Package(
        [archives.stored("__main__", b"s", b"imports"), archives.stored("PYZ.pyz", b"z", modules)], 313, b"libpython.so"
    )
    (tmp_path / "package").write_bytes(archives.written(package))
    (tmp_path / "main.c").write_text("int main(void) { return 0; }\n")
    program = folder / layers.NAME
    run(["gcc", "-o", program, tmp_path / "main.c"])
    run(["objcopy", "--add-section", f"{archives.SECTION}={tmp_path}/package", program])
    return folder


def test_a_directory_has_our_modules_our_script_and_our_files_beside_what_was_frozen(frozen: Path, tmp_path: Path):
    root = tree(tmp_path / "project")
    (root / "board/boards").mkdir()
    (root / "board/boards/x.toml").write_text("a = 1\n")
    ours, made = bytecode.compiled(root), tmp_path / "made"
    layers.directory(frozen, ours, layers.files(root, {}), layers.Tools(), made)
    package = archives.read((made / layers.NAME).read_bytes())
    assert archives.module_names(package.entry("PYZ.pyz").octets) == [module.name for module in ours.modules]
    assert package.entry("__main__").octets == ours.script
    assert (made / layers.INSIDE / "board/boards/x.toml").read_text() == "a = 1\n"
    run([made / layers.NAME])  # still a program


def test_one_file_carries_all_of_the_directory_and_its_modules_last(frozen: Path, tmp_path: Path):
    made = tmp_path / "made"
    layers.directory(frozen, bytecode.compiled(tree(tmp_path / "project")), {}, layers.Tools(), made)
    layers.one_file(made, layers.Tools(), tmp_path / "file")
    found = [(entry.name, entry.kind) for entry in archives.read((tmp_path / "file").read_bytes()).entries]
    assert found == [("__main__", b"s"), ("libx.so", b"n"), ("libx.so.1", b"b"), ("PYZ.pyz", b"z")]
    assert (tmp_path / "file").stat().st_mode & 0o111


def test_files_beside_our_modules_are_those_that_an_installed_station_has():
    files = layers.files(PROJECT, {})
    assert {"firmware/vectors.json", "board/boards/quad.toml", "drivers/mqtt/profiles/template.toml"} <= set(files)
