"""Construction: counts objects that are incomplete after their constructor, and undocumented errors.

usage: .ci/construction [--names] [FOLDER], or python -m tests.construction

FOLDER   the root of a tree of this project, such as a clone of another commit. Default: this tree.
--names  prints file, line and name of each case.

Exits with 1 if a figure of FIGURES misses its goal. A new figure is one more row there.
"""

import argparse
import ast
import sys
from collections.abc import Callable, Iterator
from functools import cached_property
from pathlib import Path
from types import UnionType
from typing import NamedTuple

from tests.docstrings import Raiser, raisers
from tests.structure import OURS, module_name, parse

HERE = Path(__file__).resolve().parent
MOST_PARAMETERS = 7
# Methods that may create attributes. Methods that __init__ calls are not among them, because a reader of __init__ does
# not see their attributes.
CONSTRUCTORS = frozenset({"__init__", "__new__", "__post_init__"})
# Base classes whose annotations are fields that the constructor sets, like those of a dataclass.
RECORDS = frozenset({"NamedTuple", "TypedDict", "Structure"})

Function = ast.FunctionDef | ast.AsyncFunctionDef


class Class(NamedTuple):
    """Class of the product with its file and module."""

    path: str
    module: str
    node: ast.ClassDef

    @property
    def bases(self) -> list[str]:
        return [ast.unparse(base).partition("[")[0] for base in self.node.bases]

    @property
    def methods(self) -> list[Function]:
        return [node for node in self.node.body if isinstance(node, Function)]

    @property
    def is_record(self) -> bool:
        """True if the constructor sets a field for each annotation."""
        decorators = {_last_name(decorator) for decorator in self.node.decorator_list}
        return "dataclass" in decorators or bool(RECORDS & {base.rpartition(".")[2] for base in self.bases})


class Tree:
    """The product's code below a folder, parsed."""

    def __init__(self, root: Path) -> None:
        paths = sorted(path for name in OURS for path in (root / name).rglob("*.py"))
        self.parsed = {path.relative_to(root).as_posix(): parse(path) for path in paths}

    @cached_property
    def raisers(self) -> list[Raiser]:
        """Public functions that raise an error."""
        return raisers(self.parsed)

    @cached_property
    def classes(self) -> dict[str, Class]:
        """Full name -> class: the first of the name in its module."""
        return {f"{one.module}.{one.node.name}": one for one in reversed(self.every_class)}

    @cached_property
    def every_class(self) -> list[Class]:
        """Classes, nested ones and those of the same name included."""
        return [
            Class(path, module_name(path), node)
            for path, tree in self.parsed.items()
            for node in ast.walk(tree)
            if isinstance(node, ast.ClassDef)
        ]

    @cached_property
    def _imported(self) -> dict[str, dict[str, str]]:
        """Full names of imported names, by module and name."""
        return {
            module_name(path): {
                alias.asname or alias.name: f"{_source(path, node)}.{alias.name}"
                for node in ast.walk(tree)
                if isinstance(node, ast.ImportFrom)
                for alias in node.names
            }
            for path, tree in self.parsed.items()
        }

    def lineage(self, one: Class) -> Iterator[Class]:
        """Yield a class and those of its base classes that are part of the product."""
        yield one
        for base in one.bases:
            first, dot, rest = base.partition(".")
            full = self._imported[one.module].get(first, f"{one.module}.{first}") + dot + rest
            if full in self.classes and self.classes[full] is not one:
                yield from self.lineage(self.classes[full])


def _source(path: str, node: ast.ImportFrom) -> str:
    """Return the module or package from which an import statement of a file imports."""
    above = path.split("/")[: -node.level] if node.level else []
    return ".".join([*above, *([node.module] if node.module else [])])


def _last_name(decorator: ast.expr) -> str:
    called = decorator.func if isinstance(decorator, ast.Call) else decorator
    return ast.unparse(called).rpartition(".")[2]


def many_parameters(tree: Tree) -> Iterator[str]:
    """Constructors that are written out and take too much; keyword-only parameters count, self does not."""
    for one in tree.every_class:
        for method in one.methods:
            given = method.args
            count = len([*given.posonlyargs, *given.args, *given.kwonlyargs]) - 1
            count += (given.vararg is not None) + (given.kwarg is not None)
            if method.name == "__init__" and count > MOST_PARAMETERS:
                yield f"{one.path}:{method.lineno}: {one.node.name} takes {count} parameters"


def late_attributes(tree: Tree) -> Iterator[str]:
    """Yield attributes that a method creates after construction.

    Attributes of constructors, class-level values and fields of the class and its bases are exempt. An annotation
    `self.x: int` without a value creates nothing. If no method of the class assigns x, another class must.
    """
    for one in tree.every_class:
        known = {name for ancestor in tree.lineage(one) for name in _created(ancestor)}
        for method in one.methods:
            for name, line in _stored(method):
                if name not in known:
                    known.add(name)
                    yield f"{one.path}:{line}: {one.node.name}.{name} is created in {method.name}()"
        for method in one.methods:
            for name, line in _announced(method) if method.name in CONSTRUCTORS else ():
                if name not in known:
                    yield f"{one.path}:{line}: {one.node.name}.{name} is left to other classes"


def _created(one: Class) -> Iterator[str]:
    """Yield names of attributes that exist once an object is created, and of properties with a setter."""
    for node in one.node.body:
        if isinstance(node, ast.Assign):
            yield from (target.id for target in node.targets if isinstance(target, ast.Name))
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            if _is_field(one, node):
                yield node.target.id
        elif isinstance(node, Function) and node.name in CONSTRUCTORS:
            yield from (name for name, _ in _stored(node))
        elif isinstance(node, Function) and any(_last_name(each) == "setter" for each in node.decorator_list):
            yield node.name


def _is_field(one: Class, node: ast.AnnAssign) -> bool:
    """Return True if an annotation at class level gives the attribute a value.

    `x: int` alone does not, nor does a field with init=False and without a default.
    """
    if isinstance(node.value, ast.Call) and _last_name(node.value) == "field":
        given = {keyword.arg for keyword in node.value.keywords}
        return "init" not in given or bool(given & {"default", "default_factory"})
    return node.value is not None or one.is_record


def _stored(method: Function) -> Iterator[tuple[str, int]]:
    """Yield attributes of self that a method assigns, with their line."""
    bare = _bare(method)
    yield from ((node.attr, node.lineno) for node in _targets(method) if id(node) not in bare)


def _announced(method: Function) -> Iterator[tuple[str, int]]:
    """Yield attributes of self that a method annotates without a value, with their line."""
    bare = _bare(method)
    yield from ((node.attr, node.lineno) for node in _targets(method) if id(node) in bare)


def _bare(method: Function) -> set[int]:
    return {id(node.target) for node in ast.walk(method) if isinstance(node, ast.AnnAssign) and node.value is None}


def _targets(method: Function) -> Iterator[ast.Attribute]:
    """Attributes of self on the left of `=` or of an annotation."""
    first = [*method.args.posonlyargs, *method.args.args][:1]
    if not first or {_last_name(each) for each in method.decorator_list} & {"staticmethod", "classmethod"}:
        return
    for node in ast.walk(method):
        if not isinstance(node, ast.Attribute) or not isinstance(node.ctx, ast.Store):
            continue
        if isinstance(node.value, ast.Name) and node.value.id == first[0].arg:
            yield node


def asserts_of_presence(tree: Tree) -> Iterator[str]:
    """Statements that assert `... is not None`, in any form: each tells of a value that may be absent where it is used."""
    for path, parsed in tree.parsed.items():
        for node in ast.walk(parsed):
            if isinstance(node, ast.Assert) and any(map(_is_presence, ast.walk(node.test))):
                yield f"{path}:{node.lineno}: assert {ast.unparse(node.test)}"


def _is_presence(node: ast.AST) -> bool:
    """Is it `x is not None`, `x != None` or `not x is None`?"""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        return _compares_with_none(node.operand, ast.Is | ast.Eq)
    return _compares_with_none(node, ast.IsNot | ast.NotEq)


def _compares_with_none(node: ast.AST, operators: UnionType) -> bool:
    if not isinstance(node, ast.Compare):
        return False
    sides = zip([node.left, *node.comparators], node.ops, node.comparators, strict=False)
    return any(
        isinstance(operator, operators)
        and any(isinstance(side, ast.Constant) and side.value is None for side in (left, right))
        for left, operator, right in sides
    )


def raised_without_a_word(tree: Tree) -> Iterator[str]:
    """Yield public functions whose docstrings do not name an error that they raise."""
    for one in tree.raisers:
        if one.missing:
            yield f"{one.path}:{one.line}: {one.name} raises {', '.join(one.missing)}"


class Figure(NamedTuple):
    """Row of the table: its text, the function that finds its cases, and the permitted number of cases."""

    text: str
    find: Callable[[Tree], Iterator[str]]
    most: int


FIGURES = (
    Figure(f"constructors of more than {MOST_PARAMETERS} parameters", many_parameters, 0),
    Figure("attributes created outside __init__", late_attributes, 0),
    Figure("statements `assert ... is not None`", asserts_of_presence, 58),
    Figure("functions whose docstring lacks an error", raised_without_a_word, 0),
)


def _root(word: str) -> Path:
    if not all((Path(word) / name).is_dir() for name in OURS):
        raise argparse.ArgumentTypeError(f"{word} is no tree of this project; give a folder with {', '.join(OURS)}")
    return Path(word)


def main() -> int:
    """Print the figures. Return 1 if one misses its goal, else 0."""
    parser = argparse.ArgumentParser(
        prog=".ci/construction", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--names", action="store_true")
    parser.add_argument("folder", nargs="?", type=_root, default=HERE.parent)
    options = parser.parse_args()
    tree = Tree(options.folder)
    cases = {figure: sorted(figure.find(tree)) for figure in FIGURES}
    print(f"{'':47}{'now':>10}   goal")
    for figure, found in cases.items():
        goal = f"at most {figure.most}" if figure.most else "0"
        missed = len(found) > figure.most
        print(f"{figure.text:47}{len(found):>10}   {goal}{'  MISSED: --names tells which' if missed else ''}")
    count, lacking = len(tree.raisers), len(cases[FIGURES[-1]])
    share = 100 * (count - lacking) // count if count else 100
    print(f"{'docstrings of functions that raise':47}{share:>8} %   100 % of {count}")
    if options.names:
        print("\n".join(case for found in cases.values() for case in found))
    return int(any(len(found) > figure.most for figure, found in cases.items()))


if __name__ == "__main__":
    sys.exit(main())
