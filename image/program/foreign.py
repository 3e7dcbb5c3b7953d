"""Third-party imports of our modules: the list that decides a new freeze."""

import ast
from collections.abc import Iterable, Sequence
from pathlib import Path

from image.program.contents import bytecode

# Module of all messages, compiled from our ASN.1 descriptions; it is added with our modules.
MESSAGES = "captain_messages"


def imports(root: Path, libraries: Sequence[Path]) -> list[str]:
    """Return the sorted names of all imported modules, from import statements anywhere in the code.

    libraries  folders of Python's and of installed packages. They tell whether b in `from a import b` is a module.
    """
    found: set[str] = set()
    for path in bytecode.sources(root):
        for module, names in _statements(ast.parse(path.read_bytes(), str(path))):
            if module.split(".")[0] in (*bytecode.PACKAGES, MESSAGES):
                continue
            found.add(module)
            found |= {f"{module}.{name}" for name in names if _is_module(f"{module}.{name}", libraries)}
    return sorted(found)


def script(names: Iterable[str]) -> str:
    """Return a program that imports all modules: for the freezer to analyse, and to run as a check."""
    return "".join(f"import {name}\n" for name in names)


def _statements(node: ast.AST) -> Iterable[tuple[str, list[str]]]:
    """Yield import statements, except those for type checkers only, and relative ones, which import our modules."""
    if isinstance(node, ast.Import):
        yield from ((alias.name, []) for alias in node.names)
    elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
        yield node.module, [alias.name for alias in node.names]
    is_for_types = isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
    for below in node.orelse if is_for_types else ast.iter_child_nodes(node):  # type: ignore[attr-defined]
        yield from _statements(below)


def _is_module(name: str, libraries: Sequence[Path]) -> bool:
    place = name.replace(".", "/")
    return any(
        (folder / place).is_dir() or (folder / f"{place}.py").exists() or any(folder.glob(f"{place}.*.so"))
        for folder in libraries
    )
