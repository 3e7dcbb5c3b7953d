"""Frozen directory of one processor as another's, with this machine's libraries."""

import marshal
import zipfile
from pathlib import Path

import pytest

from image.errors import ImageError
from image.program import translated
from image.program.contents import archives, layers
from image.program.contents.layers import Tools
from image.program.translated import Libraries
from image.tool import run

ELF = "\x7fELF"


def compiled(path: Path, *linked: Path) -> Path:
    """A shared library that needs others, and the C library."""
    path.parent.mkdir(parents=True, exist_ok=True)
    source = path.with_name(f"{path.name}.c")
    source.write_text('#include <stdio.h>\nvoid f(void);\nvoid f(void) { puts("x"); }\n')
    needed = [f"-l:{each.name}" for each in linked]
    run(["gcc", "-shared", "-fPIC", "-Wl,--no-as-needed", "-o", path, source, f"-L{path.parent}", *needed])
    source.unlink()
    return path


def frozen(folder: Path, *modules: str) -> Path:
    """What the freezer made here: a program, a module of this processor, a library, data."""
    rows = [(name, (0, 17, 0)) for name in modules]
    archive = b"PYZ\0magi" + (17).to_bytes(4, "big") + bytes(5) + marshal.dumps(rows)
    package = archives.Package([archives.stored(archives.MODULES, b"z", archive)], 313, b"libpython3.13.so.1.0")
    inside = folder / layers.INSIDE
    for name in ("python3.13/lib-dynload/_ssl.cpython-313-x86_64-linux-gnu.so", "zmq/_zmq.abi3.so", "libssl.so.3"):
        (inside / name).parent.mkdir(parents=True, exist_ok=True)
        (inside / name).write_text(ELF + "of this processor")
    (inside / "wheel.libs").mkdir()
    (inside / "wheel.libs/libzmq-12.so.5").write_text(ELF)
    (inside / "pygal.css").write_text("looks")
    with zipfile.ZipFile(inside / translated.LIBRARY, "w") as file:
        file.writestr("os.pyc", b"os" * 5000)
    (folder / layers.NAME).write_bytes(ELF.encode() + archives.written(package))
    return folder


@pytest.fixture
def other(tmp_path: Path) -> Path:
    """The other processor's files: python3.13, a wheel, libraries."""
    folder = tmp_path / "other"
    library = compiled(folder / "lib/libcrypto.so.3")
    ssl = compiled(folder / "lib/libssl.so.3", library)
    compiled(folder / "lib/libpython3.13.so.1.0")
    module = compiled(folder / "lib/module.so", ssl)
    (folder / "python3.13/lib-dynload").mkdir(parents=True)
    module.rename(folder / "python3.13/lib-dynload/_ssl.cpython-313-aarch64-linux-gnu.so")
    compiled(folder / "zmq/_zmq.abi3.so")
    (folder / "main.c").write_text("int main(void) { return 0; }\n")
    run(["gcc", "-o", folder / "run", folder / "main.c"])
    return folder


def libraries(other: Path) -> Libraries:
    return Libraries([other / "lib"], "libc6: ./usr/lib/libc.so.6\nlibssl3: ./usr/lib/libssl.so.3\n")


def test_modules_are_exchanged_libraries_found_anew_and_the_rest_copied(tmp_path: Path, other: Path):
    made, target = frozen(tmp_path / "made", "rich"), tmp_path / "target"
    translated.translate(made, [other], libraries(other), other / "run", Tools(), target)
    files = sorted(path.relative_to(target).as_posix() for path in target.rglob("*") if path.is_file())
    assert files == [
        "_internal/base_library.zip",
        "_internal/libcrypto.so.3",
        "_internal/libpython3.13.so.1.0",
        "_internal/libssl.so.3",
        "_internal/pygal.css",
        "_internal/python3.13/lib-dynload/_ssl.cpython-313-aarch64-linux-gnu.so",
        "_internal/zmq/_zmq.abi3.so",
        "captain",
    ]
    assert "of this processor" not in (target / "_internal/zmq/_zmq.abi3.so").read_text(errors="replace")
    assert archives.read((target / "captain").read_bytes()) == archives.read((made / "captain").read_bytes())
    run([target / "captain"])  # the loader, with the package in it


def test_what_the_interpreter_begins_with_is_packed_and_says_the_same(tmp_path: Path, other: Path):
    made = frozen(tmp_path / "made")
    for target in (tmp_path / "one", tmp_path / "two"):
        translated.translate(made, [other], libraries(other), other / "run", Tools(), target)
    one, two = ((tmp_path / name / "_internal/base_library.zip") for name in ("one", "two"))
    assert one.read_bytes() == two.read_bytes()
    assert one.stat().st_size < 500
    with zipfile.ZipFile(one) as file:
        assert file.read("os.pyc") == b"os" * 5000


def test_it_is_the_same_in_whatever_order_the_freezer_has_written_it(tmp_path: Path):
    kept = []
    for names in (("os.pyc", "re/_parser.pyc", "locale.pyc"), ("locale.pyc", "os.pyc", "re/_parser.pyc")):
        library = tmp_path / "base_library.zip"
        with zipfile.ZipFile(library, "w") as file:
            for name in names:
                file.writestr(name, name * 100)
        translated.pack(library)
        kept.append(library.read_bytes())
    assert kept[0] == kept[1]


def test_it_stays_unpacked_where_the_interpreter_would_have_to_load_what_unpacks_it(tmp_path: Path, other: Path):
    made = frozen(tmp_path / "made")
    (made / "_internal/zlib.cpython-313-x86_64-linux-gnu.so").write_text(ELF)
    compiled(other / "zlib.cpython-313-aarch64-linux-gnu.so")
    translated.translate(made, [other], libraries(other), other / "run", Tools(), tmp_path / "target")
    assert (tmp_path / "target/_internal/base_library.zip").stat().st_size > 10_000


def test_a_module_that_the_other_processor_has_not_is_told(tmp_path: Path, other: Path):
    (other / "zmq/_zmq.abi3.so").unlink()
    with pytest.raises(ImageError, match=r"zmq/_zmq\.abi3\.so: not found for the other processor"):
        translated.translate(
            frozen(tmp_path / "made"), [other], libraries(other), other / "run", Tools(), tmp_path / "target"
        )


def test_a_library_that_no_package_has_is_told(other: Path):
    (other / "lib/libcrypto.so.3").unlink()
    with pytest.raises(ImageError, match=r"libcrypto\.so\.3: is in none of the packages"):
        libraries(other).needed([other / "lib/libssl.so.3"])


def test_bytecode_of_one_processor_is_told(tmp_path: Path, other: Path):
    made = frozen(tmp_path / "made", "_sysconfigdata__x86_64-linux-gnu")
    with pytest.raises(ImageError, match="works on one processor only"):
        translated.translate(made, [other], libraries(other), other / "run", Tools(), tmp_path / "target")


@pytest.mark.parametrize(
    ("place", "is_one"),
    [
        ("libssl.so.3", True),
        ("pyzmq.libs/libzmq-1.so.5", True),
        ("zmq/_zmq.abi3.so", False),
        ("lib-dynload/_ssl.so", False),
    ],
)
def test_libraries_are_told_from_modules(place: str, is_one: bool):
    assert translated.is_library(Path(place)) is is_one
