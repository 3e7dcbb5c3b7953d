"""Ports of stations under test: the kernel gives them to no other program."""

from pathlib import Path

import pytest

from board.runtime import free_udp
from tests.system.ports import Ports, is_free


@pytest.mark.parametrize(("given", "lowest"), [("32768\t60999\n", 10_000), ("1024\t65535\n", 1024)])
def test_ports_are_below_those_that_the_kernel_gives_where_there_are_any(
    given: str, lowest: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(free_udp, "GIVEN", tmp_path / "range")
    free_udp.GIVEN.write_text(given)
    held = Ports()
    taken = {held.take() for _ in range(50)}
    held.release()
    assert len(taken) == 50
    assert min(taken) >= lowest
    assert lowest == 1024 or max(taken) < 32_768


def test_a_port_that_is_held_is_not_free() -> None:
    held = Ports()
    port = held.take()
    assert not is_free(port)
    held.release()
    assert is_free(port)


def test_a_row_of_ports_is_consecutive_and_held() -> None:
    held = Ports()
    row = held.take_row(4)
    assert row == list(range(row[0], row[0] + 4))
    assert not any(map(is_free, row))
    held.release()
    assert all(map(is_free, row))
