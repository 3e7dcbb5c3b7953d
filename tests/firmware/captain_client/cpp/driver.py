"""Driver of the C++ client: its program built from the installed package, and a process of it."""

import json
import os
import select
import shutil
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from tests.system.station import PATIENCE, ROOT

SOURCES = ROOT / "firmware/captain_client/cpp"
PROGRAM = Path(__file__).with_name("program")
SANITIZERS = "-fsanitize=address,undefined -fno-sanitize-recover=all"


class Toolchain(NamedTuple):
    """Compiler of C++ and its flags."""

    cxx: str
    flags: str = ""


TOOLCHAINS = {"gcc": Toolchain("g++"), "clang": Toolchain("clang++", SANITIZERS)}


def sh(*command: object, **options: Any) -> str:
    """Return what a command prints. Raises AssertionError with its output if it fails."""
    words = [str(word) for word in command]
    done = subprocess.run(words, capture_output=True, text=True, check=False, **options)
    assert done.returncode == 0, f"{words}\n{done.stdout}{done.stderr}"
    return str(done.stdout)


class Installed(NamedTuple):
    """Installed package with the compiler of its users."""

    prefix: Path
    tools: Toolchain

    def built(self, source: Path, folder: Path) -> Path:
        """Build a CMake project that finds the package; return the folder of its programs."""
        sh("cmake", "-S", source, "-B", folder, f"-DCMAKE_PREFIX_PATH={self.prefix}",
           f"-DCMAKE_CXX_COMPILER={self.tools.cxx}", f"-DCMAKE_CXX_FLAGS={self.tools.flags}")  # fmt: skip
        sh("cmake", "--build", folder)
        return folder

    def compiled(self, source: Path, program: Path) -> Path:
        """Compile a program with the flags of pkg-config; return it."""
        found = {"env": {**os.environ, "PKG_CONFIG_PATH": str(self.prefix / "share/pkgconfig")}}
        flags = sh("pkg-config", "--cflags", "--libs", "captain_client", **found).split()
        warnings = ("-std=c++17", "-Wall", "-Wextra", "-Wconversion", "-Werror")
        sh(self.tools.cxx, *self.tools.flags.split(), *warnings, source, *flags, "-o", program)
        return program


def install(tools: Toolchain, folder: Path) -> Installed:
    """Install the package below a folder."""
    assert shutil.which(tools.cxx), f"{tools.cxx} is not installed"
    sh("cmake", "-S", SOURCES, "-B", folder / "build", f"-DCMAKE_CXX_COMPILER={tools.cxx}")
    sh("cmake", "--install", folder / "build", "--prefix", folder / "installed")
    return Installed(folder / "installed", tools)


class Driver:
    """Running program `driver` with a Station. Each call of ask() is one call of the client."""

    def __init__(self, program: Path, address: str, timeout_ms: int = int(PATIENCE * 1000)) -> None:
        self._child = subprocess.Popen(
            [program, address, str(timeout_ms)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def tell(self, do: str, **question: object) -> None:
        assert self._child.stdin is not None
        self._child.stdin.write(json.dumps({"do": do, **question}) + "\n")
        self._child.stdin.flush()

    def line(self) -> dict[str, Any]:
        """Return the next answer: `said` with the result, or `error` with its kind."""
        assert self._child.stdout is not None
        assert select.select([self._child.stdout], [], [], 2 * PATIENCE)[0], "the driver does not answer"
        answer: dict[str, Any] = json.loads(self._child.stdout.readline())
        return answer

    def ask(self, do: str, **question: object) -> Any:
        """Return the result of a call that must succeed."""
        self.tell(do, **question)
        return self.line()["said"]

    def line_after(self, again: Callable[[], None]) -> dict[str, Any]:
        """Call again() until the next answer, and return it: before the driver waits, a call has no effect."""
        while not select.select([self._child.stdout], [], [], 0.01)[0]:
            again()
        return self.line()

    def interrupted(self) -> dict[str, Any]:
        return self.line_after(lambda: self._child.send_signal(signal.SIGUSR1))

    def close(self) -> None:
        """End the program. Raises AssertionError if it crashes or leaks: sanitizers end it with an exit code."""
        assert self._child.stdin is not None
        self._child.stdin.close()
        try:
            assert self._child.wait(PATIENCE) == 0
        finally:
            self._child.kill()
            self._child.wait()
            assert self._child.stdout is not None
            self._child.stdout.close()
