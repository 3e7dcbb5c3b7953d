"""Effective constraints: what PER sees, what a validator sees, and whose serial constraint is extensible."""

import pytest

from asn1.model.constraints import TABLE, Bounds, alphabet, complement, intersection, size_bounds, union, value_bounds
from asn1.model.types import AllExcept, AllOf, Alphabet, AnyOf, Constraint, Element, Range, Size, Values


def values(*ranges: tuple[int | None, int | None]) -> Values:
    return Values(tuple(Range(*r) for r in ranges))


def limited(*ranges: tuple[int | None, int | None]) -> Constraint:
    return Constraint(values(*ranges))


def open_ended(*ranges: tuple[int | None, int | None]) -> Constraint:
    return Constraint(values(*ranges), is_extensible=True)


EVERY_ELEMENT = Constraint(Element(limited((0, 1))))  # WITH COMPONENT: PER does not see it


def test_without_constraint_there_is_no_bound() -> None:
    assert value_bounds(()) == Bounds(None, None)
    assert size_bounds(()) == Bounds(0, None)


def test_a_union_is_seen_as_one_range_and_its_gaps_by_a_validator_only() -> None:
    # X.691 10.3.21 and 13: GDD unit in IVIM, vehicleSubClass in CPM
    assert value_bounds((limited((0, 10), (20, 30)),)) == Bounds(0, 30, gaps=(Range(11, 19),))


def test_serial_constraints_are_an_intersection() -> None:
    assert value_bounds((limited((0, 10)), limited((2, 20)))) == Bounds(2, 10)


def test_serial_constraints_that_leave_nothing_are_an_error() -> None:
    with pytest.raises(ValueError, match="leave no value"):
        value_bounds((limited((0, 1)), limited((2, 5))))


def test_the_last_serial_constraint_says_what_is_extensible() -> None:
    # X.680 50.11: the parent counts without its marker
    assert value_bounds((open_ended((0, 10)), limited((2, 5)))) == Bounds(2, 5, lost_marker=True)
    assert value_bounds((limited((0, 10)), open_ended((2, 5)))) == Bounds(2, 5, is_extensible=True)


@pytest.mark.parametrize("last", [EVERY_ELEMENT, TABLE])
def test_a_constraint_that_per_does_not_see_takes_the_marker_too(last: Constraint) -> None:
    # X.691 10.3.20: ConstraintWrappedCpmContainers of TS 103 324, and identifiers of object sets
    assert size_bounds((Constraint(Size(open_ended((1, 8)))),)) == Bounds(1, 8, is_extensible=True)
    assert size_bounds((Constraint(Size(open_ended((1, 8)))), last)) == Bounds(1, 8, lost_marker=True)


def test_a_marker_that_comes_back_is_not_lost() -> None:
    assert value_bounds((open_ended((0, 10)), limited((2, 8)), open_ended((3, 5)))) == Bounds(3, 5, is_extensible=True)
    assert not value_bounds((limited((0, 10)), limited((2, 8)))).lost_marker


def test_a_marker_inside_and_outside_of_size_is_the_same() -> None:
    inside = size_bounds((Constraint(Size(open_ended((1, 4)))),))
    assert size_bounds((Constraint(Size(limited((1, 4))), is_extensible=True),)) == inside


def test_extension_additions_do_not_widen_the_root() -> None:
    # SIZE(1..32, ..., 100): asn1c codes it as 1..100
    grown = Constraint(values((1, 32)), is_extensible=True, additions=values((100, 100)))
    assert size_bounds((Constraint(Size(grown)),)) == Bounds(1, 32, is_extensible=True)


def test_what_is_excepted_is_a_gap_that_per_does_not_see() -> None:
    # X.691 10.3.21
    assert value_bounds((limited((1, 16)), Constraint(AllExcept(values((1, 1)))))) == Bounds(1, 16, gaps=(Range(1, 1),))


def test_a_union_with_an_invisible_part_is_invisible() -> None:
    union_ = Constraint(AnyOf((Size(limited((1, 4))), Element(limited((0, 1))))))
    assert size_bounds((union_,)) == Bounds(0, None)


def test_an_intersection_leaves_its_invisible_parts_out() -> None:
    both = Constraint(AllOf((Size(limited((1, 4))), Element(limited((0, 1))))))
    assert size_bounds((both,)) == Bounds(1, 4)


def test_an_alphabet_stands_beside_a_size() -> None:
    # X.691 A.3: VisibleString (FROM("a".."z"|"A".."Z"|"-.") ^ SIZE(1..64, ...)), of which SIZE(1) is fixed
    letters = Alphabet(limited((45, 46), (65, 90), (97, 122)))
    name = Constraint(AllOf((letters, Size(open_ended((1, 64))))))
    assert size_bounds((name,)) == Bounds(1, 64, is_extensible=True)
    initial = (name, Constraint(Size(limited((1, 1)))))
    assert size_bounds(initial) == Bounds(1, 1, lost_marker=True)
    assert alphabet(initial, "VisibleString") == letters.within.root.ranges  # type: ignore[union-attr]


def test_an_extensible_alphabet_is_not_seen() -> None:
    # X.691 30.4, NOTE 2
    letters = (Constraint(Alphabet(open_ended((97, 122)))),)
    assert alphabet(letters, "IA5String") is None
    assert not size_bounds(letters).is_extensible


def test_an_alphabet_is_a_part_of_its_type() -> None:
    assert alphabet((Constraint(Alphabet(limited((0, 57)))),), "NumericString") is None
    assert alphabet((Constraint(Alphabet(limited((49, 127)))),), "NumericString") == (Range(49, 57),)


def test_bits_of_a_bounded_number() -> None:
    # X.691 11.5.6
    assert [Bounds(0, high).width for high in (0, 1, 2, 3, 255, 256)] == [0, 1, 2, 2, 8, 9]
    assert Bounds(0, None).width is None


def test_sets_join_meet_and_turn_over() -> None:
    assert union([Range(5, 9), Range(0, 4), Range(20, None)]) == (Range(0, 9), Range(20, None))
    assert intersection((Range(None, 5), Range(8, 12)), (Range(3, 9),)) == (Range(3, 5), Range(8, 9))
    assert complement((Range(0, 4), Range(8, None))) == (Range(None, -1), Range(5, 7))
    assert complement(()) == (Range(None, None),)
