"""Imports of users' modules: identifiers are compared by number, versions by their last arc."""

import pytest

from asn1.importer.parser import syntax
from asn1.importer.parser.fault import ImportFault, Place
from asn1.model.types import Module
from asn1.own import identifier
from asn1.own.imports import Candidate, Choice, choose, of_standards
from tests.said import tells

ROOT = "itu-t(0) identified-organization(4) etsi(0) itsDomain(5) wg1(1)"
CDD = f"{{ {ROOT} 102894 cdd(2) major-version-4(4) minor-version-%d(%d) }}"


@pytest.mark.parametrize(
    ("oid", "arcs"),
    [
        ("", ()),
        (CDD % (3, 3), (0, 4, 0, 5, 1, 102894, 2, 4, 3)),
        ("{ 0 4 0 5 1 102894 2 4 3 }", (0, 4, 0, 5, 1, 102894, 2, 4, 3)),
        ("{ itu-t identified-organization etsi itsDomain additions(999) }", (0, 4, 0, 5, 999)),
        ("{ iso standard 14906 application(0) version6(6) }", (1, 0, 14906, 0, 6)),
        ("{ iso identified-organization }", (1, 3)),
        ("{ itu-t(0) mine version2 }", (0, "mine", "version2")),
    ],
)
def test_an_identifier_is_its_numbers_whatever_the_spelling(oid: str, arcs: tuple[identifier.Arc, ...]):
    assert identifier.arcs(oid) == arcs


def standard(key: str, version: str, oid: str, name: str = "CDD") -> Module:
    return Module(key, name, oid, f"ETSI TS 102 894-2 {version}", "cdd.asn", "0")


EDITIONS = of_standards(
    [
        standard("r2_cdd241", "v2.4.1", CDD % (3, 3)),
        standard("r2_cdd221", "v2.2.1", CDD % (1, 1)),
        standard("r1_cdd121", "v1.2.1", f"{{ {ROOT} ts(102894) cdd(2) version(1) }}"),
        standard("r1_bare", "v1", "", "Bare"),
    ]
)


def wanted(oid: str, selection: str = "", name: str = "CDD") -> syntax.Import:
    return syntax.Import(Place("mine.asn", 2), name, oid, ("A",), selection)


def own(oid: str, key: str = "x1_mine") -> Candidate:
    return Candidate(key, "CDD", oid, "mine.asn", ("", ()), True)


@pytest.mark.parametrize("oid", [CDD % (1, 1), f"{{ {ROOT} 102894 2 4 1 }}"])
def test_an_import_means_the_edition_of_its_identifier(oid: str):
    assert choose(wanted(oid), EDITIONS) == Choice("r2_cdd221")
    assert choose(wanted(oid), EDITIONS[::-1]) == Choice("r2_cdd221")


@pytest.mark.parametrize(
    ("selection", "minor", "key"),
    [
        ("SUCCESSORS", 1, "r2_cdd221"),
        ("SUCCESSORS", 2, "r2_cdd241"),
        ("SUCCESSORS", 0, "r2_cdd221"),
        ("DESCENDANTS", 2, "r2_cdd241"),
    ],
)
def test_an_import_with_successors_takes_the_nearest_later_edition(selection: str, minor: int, key: str):
    assert choose(wanted(CDD % (minor, minor), selection), EDITIONS).key == key


def test_an_import_with_successors_takes_no_earlier_edition():
    with pytest.raises(ImportFault, match=r"unknown .*4\(4\) minor-version-4\(4\) of CDD; available: "):
        choose(wanted(CDD % (4, 4), "SUCCESSORS"), EDITIONS)


def test_a_later_edition_is_not_taken_unless_the_import_says_so():
    with pytest.raises(ImportFault) as caught:
        choose(wanted(CDD % (2, 2)), EDITIONS[:2])
    assert str(caught.value) == (
        "mine.asn:2: unknown minor-version-2(2) of CDD; available: minor-version-3(3) (ETSI TS 102 894-2 v2.4.1), "
        "minor-version-1(1) (ETSI TS 102 894-2 v2.2.1)"
    )


def test_import_without_an_identifier_takes_the_newest_edition_and_notes_it():
    choice = choose(wanted(""), EDITIONS)
    assert choice.key == "r2_cdd241"
    assert tells(choice.note, "mine.asn:2: CDD ", "no object identifier", "newest of 3 (ETSI TS 102 894-2 v2.4.1); ")


def test_a_user_s_own_module_comes_before_a_standard_of_the_same_identifier():
    assert choose(wanted(CDD % (1, 1)), [own(CDD % (1, 1)), *EDITIONS]).key == "x1_mine"
    assert choose(wanted(""), [own(CDD % (9, 9)), *EDITIONS]) == Choice("x1_mine")


def test_a_user_s_own_module_of_another_identifier_is_not_taken():
    assert choose(wanted(CDD % (1, 1)), [own(CDD % (3, 3)), *EDITIONS]).key == "r2_cdd221"
    assert choose(wanted(CDD % (1, 1)), [own(""), *EDITIONS]).key == "r2_cdd221"


def test_a_module_without_an_identifier_has_any():
    assert choose(wanted(CDD % (7, 7)), [own(""), *EDITIONS]).key == "x1_mine"
    assert choose(wanted("{ iso(1) 2 }", name="Bare"), EDITIONS).key == "r1_bare"


def test_a_module_of_another_message_is_named_and_not_taken():
    other = Module("x_hello", "Common", "", "experimental: hello", "common.asn", "0")
    assert of_standards([other]) == []
    with pytest.raises(
        ImportFault, match=r"no module Common; Common is in common.asn of hello; add that file to the command"
    ):
        choose(wanted("", name="Common"), EDITIONS, [other])
