"""captain run: what its journal looks like."""

import argparse
import io
import logging
import re
import subprocess
import sys
import time

import pytest

from board.runtime.errors import StationError
from firmware.commands import run
from firmware.commands.run import Prefixed


def test_what_a_terminal_would_obey_is_shown_as_its_number():
    record = logging.makeLogRecord({"name": "captain.v2n", "levelname": "WARNING", "msg": "\x1b[31mred\t\r"})
    assert Prefixed().format(record) == r"captain.v2n: WARNING: \x1b[31mred\x09\x0d"


def test_each_line_of_several_mistakes_is_told_as_one_of_the_journal():
    out = io.StringIO()
    journal = logging.StreamHandler(out)
    journal.setFormatter(Prefixed())
    record = logging.makeLogRecord(
        {
            "name": "captain.interface",
            "levelname": "WARNING",
            "msg": "%s: %s",
            "args": ("v2n", "a.toml: foo\nb.toml: bar"),
        }
    )
    journal.emit(record)
    assert out.getvalue() == "captain.interface: WARNING: v2n: a.toml: foo\ncaptain.interface: WARNING: b.toml: bar\n"


def test_a_line_with_times_begins_with_them():
    record = logging.makeLogRecord(
        {"name": "captain.v2n", "levelname": "INFO", "msg": "a\nb", "created": 0.25, "msecs": 250}
    )
    stamp = time.strftime("%H:%M:%S", time.localtime(0.25)) + ".250"
    told = f"{stamp} captain.v2n: INFO: a\n{stamp} captain.v2n: INFO: b"
    assert Prefixed(has_times=True).format(record) == told


@pytest.mark.parametrize("is_terminal", [True, False])
def test_a_log_has_times_on_a_terminal_and_none_elsewhere(monkeypatch, is_terminal):
    class Stream(io.StringIO):
        def isatty(self) -> bool:
            return is_terminal

    def stop(*_: object) -> None:
        logging.getLogger("captain").warning("said")
        raise StationError("that is all")

    stream = Stream()
    monkeypatch.setattr("sys.stderr", stream)
    monkeypatch.setattr(run, "_check_descriptors", stop)
    monkeypatch.setattr(logging.root, "handlers", [])
    with pytest.raises(StationError):
        run.main(argparse.Namespace(log="warning"))
    pattern = r"\d\d:\d\d:\d\d\.\d\d\d captain: WARNING: said\n" if is_terminal else r"captain: WARNING: said\n"
    assert re.fullmatch(pattern, stream.getvalue())


def test_station_that_starts_imports_no_client():
    code = "import sys, firmware.commands.run; print(sys.modules.keys() & {'captain_client', 'firmware.client.client'})"
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "set()\n"
