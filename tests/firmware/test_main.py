"""The program as a shell starts it: closed and full outputs, and an early Ctrl-C."""

import subprocess
import sys

import pytest

from firmware import __main__ as program


def run(command: str) -> "subprocess.CompletedProcess[str]":
    words = ["/bin/sh", "-c", command, sys.executable]
    return subprocess.run(words, capture_output=True, text=True, timeout=20, check=False)


@pytest.mark.parametrize("redirection", [">&-", "2>&-", ">&- 2>&-", "<&-"])
def test_a_closed_stream_is_no_bug(redirection: str) -> None:
    done = run(f'"$0" -m firmware --help {redirection}')
    assert (done.returncode, "Traceback" in done.stderr) == (0, False)


def test_a_full_disk_is_said_in_one_line() -> None:
    done = run('"$0" -m firmware --help >/dev/full')
    assert (done.returncode, done.stderr) == (1, "captain: cannot write: No space left on device\n")


def test_ctrl_c_while_it_still_starts_is_quiet(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted() -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(program, "_main", interrupted)
    assert program.main() == 130
