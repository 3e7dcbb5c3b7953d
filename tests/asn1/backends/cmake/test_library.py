"""The C library as a user gets it: generated, built, installed, found by CMake and pkg-config, linked and run.

With gcc; `make portable` installs the other compilers and takes them as well.
"""

import json
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

import pytest
import zmq

from asn1 import cli as program
from tests.firmware.captain_client.cpp.double import Double
from tests.firmware.captain_client.cpp.driver import SOURCES as CLIENT
from tests.system.ports import Ports

ROOT = Path(__file__).resolve().parents[4]
PACKAGE = Path(__file__).with_name("package")
VECTORS = json.loads((ROOT / "firmware" / "vectors.json").read_text())
GUIDE = (ROOT / "asn1/guide/cpp.md").read_text()
CAM = "02029b260aa393e6005a6f0da4ae7bfb35a238230a6a3d4290581a90a3f67e02e6928b37fee9fea6103fdf93d980"
PATIENCE_MS = 15_000  # reached only by a test that fails
MESSAGES = ("cam-1.4.1", "denm-1.3.1", "cpm-tr-2.1.1", "cam-2.3.1", "denm-2.3.1", "cpm-2.1.1")


class Toolchain(NamedTuple):
    """cc, cxx: compilers; cmake: options; run: words before a program."""

    cc: str
    cxx: str
    cmake: tuple[str, ...] = ()
    run: tuple[str, ...] = ()

    @property
    def is_there(self) -> bool:
        return all(shutil.which(tool) for tool in (self.cc, self.cxx, *self.run[:1]))


AARCH64 = ("-DCMAKE_SYSTEM_NAME=Linux", "-DCMAKE_SYSTEM_PROCESSOR=aarch64")
TOOLCHAINS = {
    "gcc": Toolchain("gcc", "g++"),
    "clang": Toolchain("clang", "clang++"),
    "aarch64": Toolchain(
        "aarch64-linux-gnu-gcc",
        "aarch64-linux-gnu-g++",
        AARCH64,
        ("qemu-aarch64-static", "-L", "/usr/aarch64-linux-gnu"),
    ),
}

# A vehicle at 47.0581234 N that sees one object, 15 m ahead; made with tests/asn1/reference.py.
CPM_R2 = "020e0000032f025d5c1390028d8b4793a4075370320191c210a9a2900304d212410008050000003bf6205dc01d7fc9007400"
# What asn1tools reads in the same octets (of the last as soon as its constraints are written out: test_truth.py):
# station, then latitude, speed, cause, counts.
DECODED = [
    "cam-1.4.1 3725855973 535626518 1277",
    "denm-1.3.1 3774684471 3 1",
    "cpm-tr-2.1.1 2797621831 535503040 26",
    "cam-2.3.1 0 900000001",
    "denm-2.3.1 0 900000001",
    "cpm-2.1.1 815 470581234 2 1500",
]


def octets_of(module: str) -> str:
    """Hexadecimal octets of the first vector of a module."""
    return next(str(one["hex"]) for one in VECTORS if one["module"] == module)


def sh(*command: object, **options: object) -> str:
    """Return what a command prints. Raises AssertionError with its output if it fails."""
    words = [str(word) for word in command]
    done = subprocess.run(words, capture_output=True, text=True, check=False, **options)  # type: ignore[call-overload]
    assert done.returncode == 0, f"{words}\n{done.stdout}{done.stderr}"
    return str(done.stdout)


class Installed(NamedTuple):
    """sources: as generated; prefix: where it is installed; tools: what it was built with."""

    sources: Path
    prefix: Path
    tools: Toolchain

    def program(self, source: Path, folder: Path) -> Path:
        """The directory with the programs of a CMake project that finds the package."""
        tools = self.tools
        compilers = (f"-DCMAKE_C_COMPILER={tools.cc}", f"-DCMAKE_CXX_COMPILER={tools.cxx}", *tools.cmake)
        sh("cmake", "-S", source, "-B", folder, f"-DCMAKE_PREFIX_PATH={self.prefix}",
           f"-DCMAKE_FIND_ROOT_PATH={self.prefix}", *compilers)  # fmt: skip
        sh("cmake", "--build", folder, "-j2")
        return folder

    def run(self, file: Path, *arguments: str, lines: str = "") -> str:
        return sh(*self.tools.run, file, *arguments, input=lines)


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("library") / "sources"
    assert program.main(["generate", *MESSAGES, "--format", "cmake", "--to", str(folder)]) == 0
    return folder


# `make test` takes the compiler that it needs anyway. `make portable` installs and demands all.
WANTED = [name for name in TOOLCHAINS if name == "gcc" or "CAPTAIN_PORTABLE" in os.environ]


@pytest.fixture(scope="module", params=WANTED)
def installed(request: pytest.FixtureRequest, sources: Path, tmp_path_factory: pytest.TempPathFactory) -> Installed:
    tools = TOOLCHAINS[request.param]
    assert tools.is_there, f"{request.param} is not installed"
    build = tmp_path_factory.mktemp(f"build-{request.param}")
    # -O0: it is compiled to be run once.
    sh("cmake", "-S", sources, "-B", build, "-DCAPTAIN_MESSAGES_WERROR=ON", "-DCMAKE_BUILD_TYPE=Debug",
       f"-DCMAKE_C_COMPILER={tools.cc}", f"-DCMAKE_INSTALL_PREFIX={build / 'installed'}", *tools.cmake)  # fmt: skip
    sh("cmake", "--build", build, "-j2")
    sh("cmake", "--install", build)
    return Installed(sources, build / "installed", tools)


@pytest.fixture(scope="module")
def editions(installed: Installed, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The directory with package/editions.cpp, linked in both forms."""
    return installed.program(PACKAGE, tmp_path_factory.mktemp("editions"))


def test_both_releases_link_together_and_each_message_is_decoded_rightly(installed: Installed, editions: Path):
    lines = [
        f"cam-1.4.1 {octets_of('CAM EN 302 637-2 v1.4.1')}",
        f"denm-1.3.1 {octets_of('DENM EN 302 637-3 v1.3.1')}",
        f"cpm-tr-2.1.1 {octets_of('CPM TR 103 562 v2.1.1')}",
        f"cam-2.3.1 {octets_of('CAM TS 103 900 v2.3.1')}",
        f"denm-2.3.1 {octets_of('DENM TS 103 831 v2.3.1')}",
        f"cpm-2.1.1 {CPM_R2}",
    ]
    for form in ("shared", "static"):
        assert installed.run(editions / f"editions-{form}", lines="\n".join(lines)).splitlines() == DECODED


def test_a_wrong_message_ends_in_an_error_that_says_where(installed: Installed, editions: Path):
    cut = octets_of("CAM EN 302 637-2 v1.4.1")[:40]
    said = installed.run(editions / "editions-static", lines=f"cam-1.4.1 {cut}\n")
    assert re.fullmatch(r"cam-1\.4\.1 error: cam\.[\w.\[\]]+: bit \d+: truncated.*\n", said)


def test_the_installed_examples_build_and_run(installed: Installed, tmp_path: Path):
    examples = installed.prefix / "share" / "doc" / "captain_messages" / "example"
    programs = installed.program(examples, tmp_path)
    octets = octets_of("DENM EN 302 637-3 v1.3.1")
    assert "stationID: " in installed.run(programs / "tree", "denm-1.3.1", octets)
    json_text = installed.run(programs / "json", "denm-1.3.1", octets).strip()
    assert json.loads(json_text)["header"]["messageID"] == 1
    assert installed.run(programs / "json", "denm-1.3.1", json_text).strip() == octets
    assert "station 4711 at 47.0654 degrees north\nspeed 13.9 m/s\n" in installed.run(programs / "cam")


@pytest.mark.parametrize("installed", ["gcc"], indirect=True)  # ZeroMQ is not there for other machines
def test_programs_of_the_guide_read_fields_and_send_a_credible_cam(installed: Installed, tmp_path: Path):
    for fence, name in (
        ("cmake", "# CMakeLists.txt"),
        ("cpp complete", "// send_cam.cpp"),
        ("cpp complete", "// receive_fields.cpp"),
    ):
        (code,) = re.findall(rf"^```{fence}\n({name}\n.*?)^```", GUIDE, re.MULTILINE | re.DOTALL)
        (tmp_path / name.split()[1]).write_text(code)
    programs = installed.program(tmp_path, tmp_path / "build")
    with zmq.Context() as context, context.socket(zmq.SUB) as heard, context.socket(zmq.XPUB) as sent:
        heard.subscribe(b"")
        for socket in (heard, sent):
            socket.rcvtimeo, socket.linger = PATIENCE_MS, 0
        port = heard.bind_to_random_port("tcp://127.0.0.1")
        with subprocess.Popen([programs / "send_cam", f"tcp://127.0.0.1:{port}"]) as child:
            envelope, cam = heard.recv_multipart()
            child.kill()
        port = sent.bind_to_random_port("tcp://127.0.0.1")
        command = [programs / "receive_fields", f"tcp://127.0.0.1:{port}"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
            assert child.stdout is not None
            assert child.stderr is not None
            assert sent.recv() == b"\1v2x.cam."
            for pdu in (cam, b"\1" + cam[1:], bytes.fromhex(CAM)[:30], bytes.fromhex(CAM)):
                sent.send_multipart([b"v2x.cam.", pdu])
            said = [child.stdout.readline(), child.stderr.readline(), child.stdout.readline()]
            child.kill()
    assert envelope == b"v2x.cam."
    assert re.fullmatch(r"station 900002 at 48\.7668 11\.432\d+, 10 m/s\n", said[0])
    assert re.match(r"cam\.camParameters.*: bit \d+: truncated", said[1])
    assert said[2] == "station 2602961571 at 50.0401189 14.4050093, 20.28 m/s\n"


@pytest.mark.parametrize("installed", ["gcc"], indirect=True)
def test_client_sends_and_receives_structs_of_the_library(installed: Installed, tmp_path: Path):
    sh("cmake", "-S", CLIENT, "-B", tmp_path / "client")
    sh("cmake", "--install", tmp_path / "client", "--prefix", tmp_path / "installed")
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.16)\nproject(structs LANGUAGES CXX)\n"
        f"list(APPEND CMAKE_PREFIX_PATH {tmp_path}/installed)\n"
        "find_package(captain_client REQUIRED)\nfind_package(captain_messages REQUIRED)\n"
        f"add_executable(structs {ROOT}/firmware/guide/examples/structs.cpp)\n"
        "target_link_libraries(structs captain_client::captain_client captain_messages::captain_messages)\n"
    )
    programs = installed.program(tmp_path, tmp_path / "build")
    ports = Ports()
    double = Double(ports)
    command = [programs / "structs", double.address, double.address]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child:
        double.welcome()
        double.welcome()
        double.wait_for_subscription("message.cam.")
        _, pdu, options = double.take()
        double.confirm(options["label"], "accepted", interfaces=["g5"])
        double.confirm(options["label"], "sent", interface="g5")
        double.publish("message.cam.", {"run": "run-1", "sequence": 1, "type": "cam", "interface": "g5"}, pdu)
        said = child.communicate(timeout=PATIENCE_MS / 1000)[0]
    double.stop()
    ports.release()
    assert said.startswith("station 1234, interface g5\n")
    assert "speedValue: 2778" in said


def test_pkg_config_gives_what_a_compiler_needs(installed: Installed, tmp_path: Path):
    found = {"env": {**os.environ, "PKG_CONFIG_PATH": str(next(installed.prefix.rglob("pkgconfig")))}}
    flags = sh("pkg-config", "--cflags", "--libs", "captain_messages", **found).split()
    source = installed.prefix / "share" / "doc" / "captain_messages" / "example" / "tree.c"
    sh(installed.tools.cc, "-std=c11", source, *flags, "-o", tmp_path / "tree")


def test_the_shared_library_shows_only_what_the_headers_declare(installed: Installed):
    library = next(installed.prefix.rglob("libcaptain_messages.so"))
    lines = sh("nm", "-D", "--defined-only", library).splitlines()
    names = {line.split()[2] for line in lines}
    headers = "\n".join(path.read_text() for path in (installed.prefix / "include").rglob("*.h"))
    declared = set(re.findall(r"\b\w+\b", headers))
    assert "captain_decode" in names
    assert names <= declared


def test_a_release_has_the_flags_that_were_measured_unless_the_user_gives_others(sources: Path, tmp_path: Path):
    # project() sets what is not set by then: a default behind it had no effect, and a release was made with -O3
    measured, given = tmp_path / "measured", tmp_path / "given"
    sh("cmake", "-S", sources, "-B", measured)
    sh("cmake", "-S", sources, "-B", given, "-DCMAKE_C_FLAGS_RELEASE=-Os")
    assert "CMAKE_C_FLAGS_RELEASE:STRING=-O2 -DNDEBUG " in (measured / "CMakeCache.txt").read_text()
    assert "CMAKE_C_FLAGS_RELEASE:STRING=-Os\n" in (given / "CMakeCache.txt").read_text()


def test_the_library_has_a_version_in_its_name(installed: Installed):
    library = next(installed.prefix.rglob("libcaptain_messages.so"))
    dynamic = sh("readelf", "-d", library)
    assert re.search(r"SONAME.*\[libcaptain_messages\.so\.0\.1\]", dynamic)


def test_the_same_messages_give_the_same_sources(sources: Path, tmp_path: Path):
    assert program.main(["generate", *MESSAGES, "--format", "cmake", "--to", str(tmp_path / "again")]) == 0
    left = {path.relative_to(sources): path.read_bytes() for path in sources.rglob("*") if path.is_file()}
    right = {
        path.relative_to(tmp_path / "again"): path.read_bytes()
        for path in (tmp_path / "again").rglob("*")
        if path.is_file()
    }
    assert left == right
