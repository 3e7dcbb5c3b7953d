"""Structure of the code: figures of each folder, with goals.

usage: .ci/structure [--names | --json] [FOLDER ...], or python -m tests.structure

FOLDER   the root of a tree of this project, such as a clone of another commit: a column each. Default: this tree, beside
         the figures of the last commit before the code lay in packages (structure_before.json).
--names  lists files, packages, names and imports of the first tree.
--json   prints the first tree's figures as such a file.

Exits with 1 if the first tree misses a goal; --json exits with 0.

A package names its face in the docstring of its __init__.py: `Face: name, name.` Imports from outside are of these
modules. Modules of firmware/commands that put its parts together count as inside: `Commands: name, name.` A module
without importers is one that no other names; commands are started by their names.
"""

import argparse
import ast
import json
import re
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

AS_WRITTEN = argparse.RawDescriptionHelpFormatter
HERE = Path(__file__).resolve().parent
BEFORE = HERE / "structure_before.json"
OURS = ("asn1", "board", "drivers", "firmware", "image", "pps")
MOST_FILES, MOST_OF_A_NAME, MOST_OF_A_FACE, LEAST_WITH_A_FACE = 20, 3, 6, 3
# Folders that are parallel lists: a file for each protocol, command, message or service for other code. C code has one
# folder for each linked library, because its headers are found there.
LISTS = frozenset(
    {"board/runtime", "drivers/wire", "firmware/commands", "asn1/backends/c/runtime/src", "asn1/backends/cpython"}
)
CODE = ("*.py", "*.c", "*.h", "*.hpp")
# Packages that need no face: the six top folders, and lists.
OPEN = frozenset({*OURS, "pps.sim", "drivers.sim", *(name.replace("/", ".") for name in LISTS)})
COMMANDS = "firmware/commands/"  # started by their names, so no module imports them
# Folders that are not part of this tree: ROS packages, the client, which has its own root of imports, and its examples.
APART = ("firmware/gateway/", "firmware/captain_client/", "firmware/guide/examples/")
FACE = re.compile(r"^Face: ([a-z0-9_, ]+)\.$", re.MULTILINE)
INSIDERS = re.compile(r"^Commands: ([a-z0-9_, ]+)\.$", re.MULTILINE)


class Import(NamedTuple):
    """Import of module `of` in module `by`; lazy if it is inside a function."""

    by: str
    of: str
    is_lazy: bool


class Tree:
    """The product's code below a folder."""

    def __init__(self, root: Path) -> None:
        self._root = root
        paths = sorted(path for name in OURS for path in (root / name).rglob("*.py"))
        self.paths = {path.relative_to(root).as_posix(): path for path in paths}
        self.paths = {name: path for name, path in self.paths.items() if not name.startswith(APART)}
        self.modules = {module_name(name): name for name in self.paths}
        self._parsed = {name: parse(path) for name, path in self.paths.items()}

    def lines_below(self, *folders: str) -> int:
        """Return the number of lines of the Python files in folders of the tree."""
        files = (path for folder in folders for path in (self._root / folder).rglob("*.py"))
        return sum(len(path.read_text().splitlines()) for path in files)

    @cached_property
    def files(self) -> Counter[str]:
        """Folder -> files of code in it, without __init__.py."""
        return Counter(path.parent.as_posix() for path in self._code)

    @cached_property
    def too_full(self) -> dict[str, list[str]]:
        """Folder -> its files, where they are too many."""
        return {
            folder: sorted(path.name for path in self._code if path.parent.as_posix() == folder)
            for folder, count in sorted(self.files.items())
            if count > MOST_FILES and folder not in LISTS
        }

    @cached_property
    def _code(self) -> list[Path]:
        paths = (
            path.relative_to(self._root) for name in OURS for kind in CODE for path in (self._root / name).rglob(kind)
        )
        return [path for path in paths if path.name != "__init__.py" and not path.as_posix().startswith(APART)]

    @cached_property
    def imports(self) -> set[Import]:
        return {one for module in self.modules for one in self._imports_of(module) if one.of != module}

    @cached_property
    def faces(self) -> dict[str, frozenset[str]]:
        """Modules of the face, by package, for packages with a line `Face:` or `Commands:`."""
        faces = self._listed(FACE)
        return {
            package: frozenset(f"{package}.{name}" for name in faces.get(package, ()))
            for package in faces.keys() | self._commands.keys()
        }

    @cached_property
    def _inward(self) -> list[tuple[Import, str]]:
        """Imports from outside a package of a module that is not part of its face, with the package."""
        return sorted(
            (one, package)
            for one in self.imports
            for package, face in self.faces.items()
            if _is_below(one.of, package) and one.of != package and not _is_below(one.by, package)
            if not any(_is_below(one.of, module) for module in face)
        )

    @property
    def past_a_face(self) -> list[Import]:
        """Imports past a face by modules that are not commands of the package."""
        return [one for one, package in self._inward if not self._is_command(one.by, package)]

    @property
    def by_commands(self) -> list[Import]:
        """Imports past a face by commands of the package, which `Commands:` permits."""
        return [one for one, package in self._inward if self._is_command(one.by, package)]

    @cached_property
    def without_a_face(self) -> list[str]:
        """Packages without a face that need one: three modules or more, and not a list."""
        return sorted(
            module
            for module, name in self.modules.items()
            if name.endswith("__init__.py") and module not in self.faces and module not in OPEN
            if self.files[Path(name).parent.as_posix()] >= LEAST_WITH_A_FACE
        )

    @cached_property
    def not_understood(self) -> list[str]:
        """Packages whose line `Face:` or `Commands:` has an invalid form."""
        return sorted(
            module
            for module, name in self.modules.items()
            for line in (ast.get_docstring(self._parsed[name]) or "").splitlines()
            if re.match(r"\W*(faces?|commands?)\b\W", line, re.IGNORECASE) and name.endswith("__init__.py")
            if not FACE.match(line) and not INSIDERS.match(line)
        )

    @cached_property
    def idle_commands(self) -> list[str]:
        """Superfluous commands in a line `Commands:`: they import no inner module of the package."""
        needed = {(one.by, package) for one, package in self._inward}
        return sorted(
            f"{package}: {name}"
            for package, names in self._commands.items()
            for name in names
            if (f"firmware.commands.{name}", package) not in needed
        )

    @cached_property
    def not_empty(self) -> list[str]:
        """Packages whose __init__ imports a module, except drivers, whose __init__ is the registry of drivers."""
        return sorted({one.by for one in self.imports if self.modules[one.by].endswith("__init__.py")} - {"drivers"})

    @cached_property
    def _commands(self) -> dict[str, list[str]]:
        return self._listed(INSIDERS)

    def _is_command(self, module: str, package: str) -> bool:
        return module in (f"firmware.commands.{name}" for name in self._commands.get(package, ()))

    def _listed(self, line: re.Pattern[str]) -> dict[str, list[str]]:
        """Return the names in a line of the docstring, by package."""
        packages = {module: name for module, name in self.modules.items() if name.endswith("__init__.py")}
        found = {module: line.search(ast.get_docstring(self._parsed[name]) or "") for module, name in packages.items()}
        return {module: told[1].split(", ") for module, told in found.items() if told}

    def cycles(self, is_lazy: bool) -> list[list[str]]:
        """Return groups of modules that import each other. is_lazy includes imports inside functions."""
        needs: dict[str, list[str]] = {module: [] for module in self.modules}
        for one in self.imports:
            if is_lazy or not one.is_lazy:
                needs[one.by].append(one.of)
        return [group for group in _components(needs) if len(group) > 1]

    @cached_property
    def cycles_of_folders(self) -> list[list[str]]:
        """Groups of folders that import each other, by all imports including those inside functions."""
        needs: dict[str, set[str]] = {folder: set() for folder in self.files}
        for one in self.imports:
            by, of = (Path(self.modules[module]).parent.as_posix() for module in (one.by, one.of))
            if of in needs and by in needs:
                needs[by].add(of)
        return [group for group in _components(needs) if len(group) > 1]

    @cached_property
    def names(self) -> dict[str, list[str]]:
        """Names of public classes that more than MOST_OF_A_NAME modules define, with these modules."""
        found: dict[str, list[str]] = {}
        for module, name in self.modules.items():
            for node in self._parsed[name].body:
                if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                    found.setdefault(node.name, []).append(module)
        return {name: modules for name, modules in sorted(found.items()) if len(modules) > MOST_OF_A_NAME}

    @cached_property
    def without_importers(self) -> list[str]:
        named = {one.of for one in self.imports}
        return sorted(
            module
            for module, name in self.modules.items()
            if module not in named and Path(name).name not in ("__init__.py", "__main__.py")
            if not name.startswith(COMMANDS)
        )

    def _imports_of(self, module: str) -> Iterator[Import]:
        name = self.modules[module]
        package = module if name.endswith("__init__.py") else module.rpartition(".")[0]
        for node, is_lazy in _statements(self._parsed[name]):
            for full in _imported(node, package):
                if (of := self._nearest(full)) is not None:
                    yield Import(module, of, is_lazy)

    def _nearest(self, name: str) -> str | None:
        """Return the module that a full name means or that contains it; None if it is not in the tree."""
        while name and name not in self.modules:
            name = name.rpartition(".")[0]
        return name or None


def parse(path: Path) -> ast.Module:
    """The syntax tree of a file. Ends the program with the file's name where it is not Python."""
    try:
        return ast.parse(path.read_text())
    except SyntaxError as error:
        sys.exit(f"{path}:{error.lineno or 1}: {error.msg}")
    except ValueError as error:  # not UTF-8
        sys.exit(f"{path}: {error}")


def module_name(name: str) -> str:
    return name.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def _is_below(module: str, package: str) -> bool:
    return module == package or module.startswith(package + ".")


def _statements(tree: ast.AST, is_lazy: bool = False) -> Iterator[tuple[ast.AST, bool]]:
    """Yield all nodes below a node, each with True if it is inside a function. Blocks for type checkers are skipped."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        yield node, is_lazy
        yield from _statements(node, is_lazy or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda))


def _imported(node: ast.AST, package: str) -> list[str]:
    """Return the full names that a statement imports; `from a import b` gives `a.b`."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if not isinstance(node, ast.ImportFrom):
        return []
    above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
    base = ".".join([*above, *([node.module] if node.module else [])])
    return [f"{base}.{alias.name}" for alias in node.names]


def _components(needs: Mapping[str, Iterable[str]]) -> list[list[str]]:
    """Return the strongly connected components of a graph (Tarjan, 1972). needs: successors of each node."""
    number: dict[str, int] = {}
    lowest: dict[str, int] = {}
    path: list[str] = []
    found: list[list[str]] = []

    def visit(one: str) -> None:
        number[one] = lowest[one] = len(number)
        path.append(one)
        for other in needs[one]:
            if other not in number:
                visit(other)
                lowest[one] = min(lowest[one], lowest[other])
            elif other in path:
                lowest[one] = min(lowest[one], number[other])
        if lowest[one] == number[one]:
            at = path.index(one)
            found.append(sorted(path[at:]))
            del path[at:]

    sys.setrecursionlimit(10_000)
    for one in needs:
        if one not in number:
            visit(one)
    return found


def _root(word: str) -> Path:
    """Parse an argument that names the root of a tree of this project. Raises ArgumentTypeError for other folders."""
    if not all((Path(word) / name).is_dir() for name in OURS):
        raise argparse.ArgumentTypeError(f"{word} is no tree of this project; give a folder with {', '.join(OURS)}")
    return Path(word)


def figures(tree: Tree) -> dict[str, int]:
    """Return the figures of a tree by the text of their row."""
    return {
        **{f"files in {folder}/": count for folder, count in sorted(tree.files.items())},
        "folders": len(tree.files),
        "files": tree.files.total(),
        "lines of the product, Python": tree.lines_below(*OURS),
        "lines of the tests, Python": tree.lines_below("tests"),
        "packages that tell a face": len(tree.faces),
        **(_of_faces(tree) if tree.faces else {}),
        "cycles of imports at load": len(tree.cycles(is_lazy=False)),
        "cycles with imports in functions": len(tree.cycles(is_lazy=True)),
        "cycles of folders": len(tree.cycles_of_folders),
        f"class names used more than {MOST_OF_A_NAME} times": len(tree.names),
        "modules that no other imports": len(tree.without_importers),
    }


def _of_faces(tree: Tree) -> dict[str, int]:
    return {
        "modules of the largest face": max(map(len, tree.faces.values())),
        "imports past a face": len(tree.past_a_face),
        "imports of a package's inside by its commands": len(tree.by_commands),
    }


# The most that a figure may be; of folders, see _most.
GOALS = {
    "modules of the largest face": MOST_OF_A_FACE,
    "imports past a face": 0,
    "cycles of imports at load": 0,
    "cycles with imports in functions": 0,
    f"class names used more than {MOST_OF_A_NAME} times": 0,
}


def _most(row: str) -> int | None:
    """The goal of a row; None where it has none, as a list."""
    if not row.startswith("files in "):
        return GOALS.get(row)
    return None if _is_list(row) else MOST_FILES


def _is_list(row: str) -> bool:
    return row.removeprefix("files in ").strip("/") in LISTS


def missed(column: Mapping[str, int]) -> set[str]:
    """Rows of a tree's figures that miss their goal."""
    return {row for row, number in column.items() if (most := _most(row)) is not None and number > most}


def _table(columns: Mapping[str, Mapping[str, int]], judged: Mapping[str, int]) -> None:
    """A column each; of folders only those that have, or had, too many files. Marks what the judged column misses."""
    print(f"{'':47}{''.join(f'{head:>10}' for head in columns)}   goal")
    rows = sorted({row for column in columns.values() for row in column if row.startswith("files in ")})
    rows = [row for row in rows if any(column.get(row, 0) > MOST_FILES for column in columns.values())]
    longest = max(columns.values(), key=len)
    rows += [row for row in longest if not row.startswith("files in ")]
    for row in rows:
        most = _most(row)
        goal = f"at most {most}" if most else "0" if most == 0 else "a list" if _is_list(row) else ""
        mark = "  MISSED: --names tells which" if row in missed(judged) else ""
        numbers = (column.get(row, 0 if row.startswith("files in ") else "-") for column in columns.values())
        print(f"{row:47}{''.join(f'{number:>10}' for number in numbers)}   {goal}{mark}")


def _list(tree: Tree) -> None:
    for folder, names in tree.too_full.items():
        print(f"too full: {folder}: {', '.join(names)}")
    for package in tree.without_a_face:
        print(f"without a face: {package}")
    for one in tree.past_a_face:
        print(f"past a face: {one.by} imports {one.of}")
    for cycle in tree.cycles(is_lazy=True):
        print(f"cycle: {', '.join(cycle)}")
    for cycle in tree.cycles_of_folders:
        print(f"cycle of folders: {', '.join(cycle)}")
    for name, modules in tree.names.items():
        print(f"class {name}: {', '.join(modules)}")
    for module in tree.without_importers:
        print(f"not imported: {module}")


def main() -> int:
    """Prints the table, or the first tree's figures as JSON. Returns 1 if the table's first tree misses a goal."""
    parser = argparse.ArgumentParser(prog=".ci/structure", description=__doc__, formatter_class=AS_WRITTEN)
    parser.add_argument("--names", action="store_true")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("folders", nargs="*", type=_root)
    options = parser.parse_args()
    trees = {root.resolve().name[:9]: Tree(root) for root in options.folders} or {"now": Tree(HERE.parent)}
    columns = {name: figures(tree) for name, tree in trees.items()}
    if options.json:
        print(json.dumps(next(iter(columns.values())), indent=1))
        return 0
    judged = next(iter(columns.values()))
    _table(columns if options.folders else {"before": json.loads(BEFORE.read_text()), **columns}, judged)
    if options.names:
        _list(next(iter(trees.values())))
    return int(bool(missed(judged)))


if __name__ == "__main__":
    sys.exit(main())
