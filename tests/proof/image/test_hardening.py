"""Rows of a unit, from systemd's measure."""

import pytest

from tests.proof.image.hardening import MOST, _of_unit


@pytest.mark.parametrize("name", MOST)
def test_a_unit_that_is_more_open_than_its_bound_misses_it(name: str):
    most = MOST[name].exposure
    assert [row.is_ok for row in _of_unit(name, most, [])] == [True]
    assert [row.is_ok for row in _of_unit(name, most + 0.1, [])] == [False]


def test_a_unit_that_nobody_has_set_a_bound_for_misses_it():
    assert [row.is_ok for row in _of_unit("captain-new.service", 0.1, [])] == [False]
