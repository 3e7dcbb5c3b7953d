"""Debian package captain-dev: unpacked, found by CMake and pkg-config, linked and run."""

from contextlib import closing
from pathlib import Path

import pytest

from image.program import developer
from image.project import PROJECT
from image.step import Steps
from image.tool import run
from tests.image.program.conftest import MACHINE

# A CAM of a public example (asn1tools), and what another decoder reads in it.
CAM = "02029b260aa393e6005a6f0da4ae7bfb35a238230a6a3d4290581a90a3f67e02e6928b37fee9fea6103fdf93d980"
STATION = "2602961571"
CLIENT = "#include <captain_client.hpp>\nint main() { captain_client::Station *station = nullptr; return station != nullptr; }\n"


@pytest.fixture(scope="module")
def triple() -> str:
    return run(["gcc", "-print-multiarch"]).strip()


@pytest.fixture(scope="module")
def tree(triple: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    with closing(Steps(tmp_path_factory.mktemp("steps"))) as steps:
        return developer.installed(steps, "developer", triple, ["cam-1.4.1"])


@pytest.fixture(scope="module")
def package(tree: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("package") / "captain-dev.deb"
    developer.make(tree, MACHINE, "1.2.3", 1_750_000_000, target)
    return target


@pytest.fixture(scope="module")
def root(package: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Unpack the package, as if installed."""
    folder = tmp_path_factory.mktemp("root")
    run(["dpkg-deb", "--extract", package, folder])
    return folder


def test_package_depends_on_the_c_library_alone_and_recommends_the_clients_headers(package: Path):
    said = run(["dpkg-deb", "--field", package])
    assert f"Package: captain-dev\nVersion: 1.2.3\nArchitecture: {MACHINE}\n" in said
    assert "Multi-Arch: same\nDepends: libc6 (>= 2." in said
    assert "Recommends: cppzmq-dev, libc6-dev, nlohmann-json3-dev\n" in said
    assert "Section: libdevel\n" in said


def test_package_has_both_libraries_their_descriptions_and_no_script(package: Path, root: Path, triple: str):
    library = root / "usr/lib" / triple
    for name in ("libcaptain_messages.a", "libcaptain_messages.so", "pkgconfig/captain_messages.pc"):
        assert (library / name).exists()
    for name in ("pkgconfig/captain_client.pc", "doc/captain-dev/copyright", "doc/captain-dev/example/tree.c"):
        assert (root / "usr/share" / name).exists()
    names = {
        line.rsplit("./", 1)[-1] for line in run(["dpkg-deb", "--ctrl-tarfile", package]).splitlines() if "./" in line
    }
    assert not names & {"preinst", "postinst", "prerm", "postrm"}


def test_package_with_equal_files_has_equal_octets_and_no_path_of_the_build(tree: Path, package: Path, tmp_path: Path):
    developer.make(tree, MACHINE, "1.2.3", 1_750_000_000, tmp_path / "again.deb")
    assert (tmp_path / "again.deb").read_bytes() == package.read_bytes()
    for path in tree.rglob("*"):
        octets = path.read_bytes() if path.is_file() else b""
        assert str(tree.parent).encode() not in octets, path
        assert str(PROJECT).encode() not in octets, path


def test_program_found_by_cmake_decodes_a_cam(root: Path, tmp_path: Path, triple: str):
    example = root / "usr/share/doc/captain-dev/example"
    run(
        [
            "cmake",
            "-S",
            example,
            "-B",
            tmp_path,
            f"-DCMAKE_PREFIX_PATH={root}/usr",
            f"-DCMAKE_LIBRARY_ARCHITECTURE={triple}",
        ]
    )
    run(["cmake", "--build", tmp_path, "--target", "tree"])
    assert STATION in run([tmp_path / "tree", "cam-1.4.1", CAM])


def test_program_with_pkg_config_decodes_a_cam(root: Path, tmp_path: Path, triple: str):
    places = {"PKG_CONFIG_PATH": f"{root}/usr/lib/{triple}/pkgconfig"}
    flags = run(["pkg-config", "--cflags", "--libs", "captain_messages"], environment=places).split()
    source = root / "usr/share/doc/captain-dev/example/tree.c"
    run(["gcc", source, "-o", tmp_path / "tree", *flags])
    said = run([tmp_path / "tree", "cam-1.4.1", CAM], environment={"LD_LIBRARY_PATH": f"{root}/usr/lib/{triple}"})
    assert STATION in said


def test_client_found_by_pkg_config_compiles(root: Path, tmp_path: Path):
    flags = run(
        ["pkg-config", "--cflags", "--libs", "captain_client"],
        environment={"PKG_CONFIG_PATH": f"{root}/usr/share/pkgconfig"},
    )
    (tmp_path / "program.cpp").write_text(CLIENT)
    run(["g++", "-std=c++17", "-fsyntax-only", tmp_path / "program.cpp", *flags.split()])
