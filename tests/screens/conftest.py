import time

import pytest

from tests.screens.terminal import Terminal


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    """A terminal of 80 columns and 24 lines, in UTC."""
    for name, value in (("TERM", "xterm"), ("LINES", "24"), ("COLUMNS", "80"), ("TZ", "UTC")):
        monkeypatch.setenv(name, value)
    monkeypatch.delenv("NO_COLOR", raising=False)
    time.tzset()
    return Terminal()
