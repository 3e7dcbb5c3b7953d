"""captain run: what its journal looks like."""

import io
import logging

from firmware.commands.run import Prefixed


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
