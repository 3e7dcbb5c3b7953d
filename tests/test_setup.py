"""Messages of .ci/setup, with doubles of Python and pip."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

SETUP = Path(__file__).resolve().parent.parent / ".ci" / "setup"

# Double of Python: prints its version and its folder, and has every requested module.
PYTHON = """\
#!/bin/sh
case $1 in --version) echo "Python {version}" ;; -c) case $2 in *purelib*) pwd ;; esac ;; esac
"""


def program(path: Path, version: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(PYTHON.format(version=version))
    path.chmod(0o755)


def test_an_environment_that_is_kept_is_told_with_its_own_python(tmp_path: Path):
    (tmp_path / ".ci" / "locks").mkdir(parents=True)
    shutil.copy(SETUP, tmp_path / ".ci" / "setup")
    for name in (*(f".ci/locks/{purpose}.txt" for purpose in ("run", "test", "fuzz")), "pyproject.toml"):
        (tmp_path / name).touch()
    program(tmp_path / ".venv" / "bin" / "python", "3.11.2")
    (tmp_path / ".venv" / "python").write_text("/usr/bin/python3\n")
    (tmp_path / ".venv" / "place").write_text(f"{tmp_path}\n")
    program(tmp_path / "path" / "python3", "3.11.7")
    environment = {key: value for key, value in os.environ.items() if key != "PYTHON"}
    environment["PATH"] = f"{tmp_path}/path:{environment['PATH']}"
    ended = subprocess.run(
        ["sh", str(tmp_path / ".ci" / "setup"), "run"], env=environment, capture_output=True, text=True, check=True
    )
    assert ended.stderr == "setup: .venv for run, Python 3.11.2\n"


@pytest.mark.parametrize(("number", "status"), [("INT", 130), ("TERM", 143), ("HUP", 143)])
def test_an_installation_that_is_interrupted_leaves_no_log_behind(tmp_path: Path, number: str, status: int):
    (tmp_path / ".ci").mkdir()
    shutil.copy(SETUP, tmp_path / ".ci" / "setup")
    (logs := tmp_path / "logs").mkdir()
    (programs := tmp_path / "path").mkdir()
    for name in ("sh", "env", "mktemp", "rm", "cat", "id", "dirname"):  # no compiler: that is to be installed
        (programs / name).symlink_to(str(shutil.which(name)))
    for name, text in (("sudo", '[ "$1" = -n ] && shift\nexec "$@"'), ("apt-get", f"kill -{number} $PPID")):
        (programs / name).write_text(f"#!/bin/sh\n{text}\n")
        (programs / name).chmod(0o755)
    ended = subprocess.run(
        [str(programs / "sh"), str(tmp_path / ".ci" / "setup"), "run"],
        env={"PATH": str(programs), "TMPDIR": str(logs)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "setup: Debian packages: " in ended.stderr
    assert ended.returncode == status
    assert list(logs.iterdir()) == []
