"""Bundles, the web servers that they come from, and the service that installs them."""

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from board.runtime.boot_counters import State
from firmware.update import bundle as update_bundle
from firmware.update import counters as update_counters
from firmware.update import slots, update
from firmware.update.bundle import Box, Bundle
from firmware.update.folder import Folder
from firmware.update.verity import Tree
from tests.broker.certificates import Authority
from tests.firmware.update.rauc_service import Service
from tests.firmware.update.web_site import Site

OVERLAY = Path(__file__).resolve().parents[3] / "image/overlay"

Said = Callable[[], tuple[str, str]]  # what was written to both streams since it was asked last
BUNDLE = Bundle("x", 5000, "1.2.4", "captain trixie quad", "b", "O=captain", Tree(1, "", ""), 4_000_000)


@pytest.fixture
def site() -> Iterator[Site]:
    with Site().open() as found:
        yield found


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> Authority:
    return Authority(tmp_path_factory.mktemp("authority"))


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    """Of updates, as the lock makes it."""
    (tmp_path / "fetched").mkdir(exist_ok=True)
    return Folder(tmp_path, reserve=0)


@pytest.fixture
def service(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Service:
    """In a box whose bundles are all well signed."""
    (tmp_path / "bin").mkdir()
    made = Service(tmp_path / "bin")
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:{os.environ['PATH']}")
    counters = State(("B", "A"), 2, 3, "B")
    monkeypatch.setattr(update_counters, "read", lambda: counters)
    (tmp_path / "judged").write_text("well\n")
    monkeypatch.setattr(update._judged, "__defaults__", (tmp_path / "judged",))
    monkeypatch.setattr(slots, "largest", lambda slot: 1 << 20)
    monkeypatch.setattr(update_bundle, "box", lambda: Box("captain trixie quad", "a release image"))
    monkeypatch.setattr(update_bundle, "read", lambda path, name: BUNDLE)
    monkeypatch.setattr("firmware.update.verity.check", lambda path, name, tree, seen: seen(1.0))
    monkeypatch.setattr("firmware.commands.update.signal.signal", lambda number, action: None)
    (tmp_path / "update").mkdir()
    monkeypatch.setattr(update, "Folder", lambda: Folder(tmp_path / "update"))
    monkeypatch.setattr("firmware.commands.update.Folder", lambda: Folder(tmp_path / "update"))
    return made


@pytest.fixture
def bundle(tmp_path: Path) -> str:
    path = tmp_path / "update.raucb"
    path.write_bytes(b"x" * 5000)
    return str(path)


@pytest.fixture
def said(capsys: pytest.CaptureFixture[str]) -> Said:
    def said() -> tuple[str, str]:
        found = capsys.readouterr()
        return found.out, found.err

    return said
