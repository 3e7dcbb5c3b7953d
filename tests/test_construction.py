"""Construction: the counting rules of tests/construction.py, on a small tree."""

from pathlib import Path

import pytest

from tests.construction import Tree, asserts_of_presence, late_attributes, main, many_parameters
from tests.structure import OURS

LATE = """
from dataclasses import dataclass, field
from .base import Base

class Driver(Base):
    size: int
    def __init__(self):
        self.bare: int
        self.set_from_outside: int
        self.set_in_a_branch: int
        if self:
            self.set_in_a_branch = 1
        self._reset()
    def start(self):
        def later():
            self.nested = 1
        self.size = self.bare = self.inherited = 1
        self.first, self.by_setter = 1, 2
        self.first = 3
    def _reset(self):
        self.helper = 1
    @property
    def by_setter(self): ...
    @by_setter.setter
    def by_setter(self, value):
        self.inherited = value

@dataclass
class Record:
    given: int
    empty: int = field(init=False)
    counted: int = field(init=False, default=0)
    def fill(self):
        self.given = self.empty = self.counted = self.derived = 1
    def __post_init__(self):
        self.derived = 0
"""
BASE = "class Base:\n    def __init__(self):\n        self.inherited = 0\n"
MANY = """
class Seven:
    def __init__(self, a, b, c, /, d, *, e, f, g): ...
class Eight:
    def __init__(self, a, b, c, d, *rest, e, f, **more): ...
"""
ASSERTS = "assert a is not None\nassert a and b is not None\nassert a is None\nassert a\n"
OTHER_ASSERTS = """
assert not a is None
assert a != None
assert None is not a
assert not a == None
assert a == None
assert not a is not None or a
assert a is not b
assert a == "is not None"
"""
TWINS = """
class A:
    class Row:
        def set(self): self.first = 1
class B:
    class Row:
        def set(self): self.second = 1
"""


@pytest.fixture
def tree(tmp_path: Path) -> Tree:
    for name in OURS:
        (tmp_path / name).mkdir()
    for name, text in {"late": LATE, "base": BASE, "many": MANY, "asserts": ASSERTS}.items():
        (tmp_path / "board" / f"{name}.py").write_text(text)
    return Tree(tmp_path)


def test_late_attributes_of_methods_are_told_once_and_those_of_constructors_are_not(tree):
    named = [case.split()[1] for case in late_attributes(tree)]
    assert sorted(named) == [
        *("Driver.bare", "Driver.first", "Driver.helper", "Driver.nested"),
        *("Driver.set_from_outside", "Driver.size", "Record.empty"),
    ]


def test_parameters_of_every_kind_but_self_are_counted(tree):
    assert [case.partition(": ")[2] for case in many_parameters(tree)] == ["Eight takes 8 parameters"]


def test_asserts_of_presence_are_counted_as_statements(tree):
    assert len(list(asserts_of_presence(tree))) == 2


def of_one_file(root: Path, text: str) -> Tree:
    for name in OURS:
        (root / name).mkdir(exist_ok=True)
    (root / "board" / "one.py").write_text(text)
    return Tree(root)


def test_asserts_of_presence_are_counted_in_every_form(tmp_path):
    found = [case.partition(": assert ")[2] for case in asserts_of_presence(of_one_file(tmp_path, OTHER_ASSERTS))]
    assert found == ["not a is None", "a != None", "None is not a", "not a == None", "not a is not None or a"]


def test_nested_classes_of_the_same_name_are_all_counted(tmp_path):
    named = [case.split()[1] for case in late_attributes(of_one_file(tmp_path, TWINS))]
    assert sorted(named) == ["Row.first", "Row.second"]


def test_a_tree_without_functions_that_raise_has_all_of_them_documented(tmp_path, monkeypatch, capsys):
    of_one_file(tmp_path, "")
    monkeypatch.setattr("sys.argv", ["construction", str(tmp_path)])
    assert main() == 0
    assert "100 %   100 % of 0" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("octets", "said"),
    [(b"a = 1\ndef f(:\n", "2: invalid syntax"), (b"a\0", "(1:)? source code"), (b"\xff", " 'utf-8'")],
)
def test_a_file_that_is_not_python_ends_the_count_with_its_name(tmp_path, octets, said):
    path = tmp_path / "board" / "one.py"
    of_one_file(tmp_path, "")
    path.write_bytes(octets)
    with pytest.raises(SystemExit, match=f"^{path}:{said}"):
        Tree(tmp_path)
