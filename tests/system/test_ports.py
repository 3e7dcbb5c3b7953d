"""Ports of stations under test: nobody else comes to have one, for TCP or UDP, from the choice to the start."""

from tests.system.ports import GIVEN, Ports


def test_no_port_is_one_that_the_kernel_gives_to_programs() -> None:
    held = Ports()
    taken = {held.take() for _ in range(50)}
    held.release()
    first, last = map(int, GIVEN.read_text().split())
    assert len(taken) == 50
    assert [port for port in taken if first <= port <= last] == []
