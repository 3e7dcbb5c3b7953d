"""The program with and without a message library."""

import sys

import pytest

from tests.firmware.codec.standin import BARE, DOOR, NEW, OLD, SAME, Library


@pytest.fixture
def standin(monkeypatch: pytest.MonkeyPatch) -> Library:
    """The program with the stand-in for its message library."""
    library = Library(OLD, NEW, SAME, DOOR, BARE)
    monkeypatch.setitem(sys.modules, "captain_messages", library)
    return library


@pytest.fixture
def without_library(monkeypatch: pytest.MonkeyPatch) -> None:
    """The program as it is installed without `make codec`."""
    monkeypatch.setitem(sys.modules, "captain_messages", None)
