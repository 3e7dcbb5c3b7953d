"""captain run: what its journal looks like."""

import io
import logging

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
