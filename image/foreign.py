"""What our modules import and is not ours: it is frozen once, and kept while they import the same."""

import ast
from collections.abc import Iterable, Sequence
from pathlib import Path

from image import bytecode

# Compiled from our descriptions, beside the modules: it comes with them.
MESSAGES = "captain_messages"


def imports(root: Path, libraries: Sequence[Path]) -> list[str]:
    """Modules by name, sorted: those of every import statement, wherever it stands.

    libraries  folders of Python's and of installed packages: `from a import b` may name a module or what is in one,
               and they tell which.
    """
    found: set[str] = set()
    for path in bytecode.sources(root):
        for module, names in _statements(ast.parse(path.read_bytes(), str(path))):
            if module.split(".")[0] in (*bytecode.FOLDERS, MESSAGES):
                continue
            found.add(module)
            found |= {f"{module}.{name}" for name in names if _is_module(f"{module}.{name}", libraries)}
    return sorted(found)


def script(names: Iterable[str]) -> str:
    """A program for the freezer to look at; run, it tells whether all is there."""
    return "".join(f"import {name}\n" for name in names)


def _statements(node: ast.AST) -> Iterable[tuple[str, list[str]]]:
    """Import statements but those that only a type checker reads; relative ones are ours."""
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
