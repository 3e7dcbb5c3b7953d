"""Errors in docstrings: finds public functions whose docstrings lack an error.

A function is public if neither its name nor that of its class begins with an underscore. Of the names with two
underscores, only those in OPENERS are public. A function raises X if its body contains `raise X(...)`. It also raises X
if it calls a private function of the same module whose body contains this. X is not counted if the function catches it,
if it only re-raises a caught error, or if X is in NEVER. The docstring must name X or a base class of X. For a
constructor, the docstring of the class counts as well. The class is unknown if a variable is raised, or a call without
annotated result. Then the name of any error will do.
"""

import ast
import builtins
import re
from collections.abc import Iterator, Mapping
from typing import NamedTuple

# Errors that a caller need not expect: the end of a command, bugs, and abstract methods.
NEVER = frozenset({"SystemExit", "AssertionError", "NotImplementedError", "StopIteration", "KeyboardInterrupt"})
CONSTRUCTORS = ("__init__", "__post_init__", "__new__")
OPENERS = (*CONSTRUCTORS, "__call__", "__enter__", "__getitem__", "__next__")
UNKNOWN = "?"
CLASS = re.compile(r"\b[A-Z]\w*(?:Error|Fault|Left|Asked)\b")

Function = ast.FunctionDef | ast.AsyncFunctionDef
Scope = ast.Module | ast.ClassDef


class Raiser(NamedTuple):
    """Public function that raises an error.

    missing  classes of errors that its docstring must name and does not.
    """

    path: str
    line: int
    name: str
    missing: tuple[str, ...]


def raisers(parsed: Mapping[str, ast.Module]) -> list[Raiser]:
    """Return all public functions that raise, in the order of the files. parsed: syntax trees by path."""
    bases, results = _bases(parsed), _results(parsed)
    return [one for path, tree in parsed.items() for one in _Module(path, tree, bases, results).raisers()]


class _Module:
    """Module: one file of the product.

    bases    for each class, its name and the names of its base classes.
    results  for each name of a function, with and without its module, the annotated results of functions of that name.
    """

    def __init__(
        self, path: str, tree: ast.Module, bases: Mapping[str, frozenset[str]], results: Mapping[str, set[str]]
    ) -> None:
        self._path = path
        self._results = results
        self._tree = tree
        self._bases = bases
        self._functions = {name: function for _, name, function in _all(tree, "")}
        self._imported = {
            alias.asname or alias.name: f"{node.module}.{alias.name}"
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom)
            for alias in node.names
        }

    def raisers(self) -> Iterator[Raiser]:
        for scope, name, function in _all(self._tree, ""):
            if not _is_public(name):
                continue
            raised = self._own(function) | self._of_helpers(function, name)
            if not raised:
                continue
            text = ast.get_docstring(function) or ""
            if function.name in CONSTRUCTORS:
                text += "\n" + (ast.get_docstring(scope) or "")
            missing = tuple(sorted(one for one in raised if not self._is_named(one, text)))
            yield Raiser(self._path, function.lineno, name, missing)

    def _is_named(self, raised: str, text: str) -> bool:
        words = set(re.findall(r"\w+", text))
        return bool(CLASS.search(text)) if raised == UNKNOWN else not words.isdisjoint(self._above(raised))

    def _above(self, name: str) -> frozenset[str]:
        """Return a class and its base classes, without Exception and above, which are too general."""
        return self._bases.get(name, frozenset({name}))

    def _own(self, function: Function) -> set[str]:
        """Return the classes that a function's own body raises and does not catch."""
        found: set[str] = set()
        for node, caught, bound in _body(function.body, frozenset(), frozenset()):
            if isinstance(node, ast.Raise) and node.exc is not None:
                found |= {one for one in self._classes(node.exc, bound) if self._escapes(one, caught)}
        return found - NEVER

    def _of_helpers(self, function: Function, name: str) -> set[str]:
        found: set[str] = set()
        for node, caught, _ in _body(function.body, frozenset(), frozenset()):
            helper = self._helper(node, name) if isinstance(node, ast.Call) else None
            if helper is not None and self._functions[helper] is not function:
                found |= {one for one in self._own(self._functions[helper]) if self._escapes(one, caught)}
        return found

    def _escapes(self, raised: str, caught: frozenset[str]) -> bool:
        """Return True if an error leaves the `try` blocks around it. One of unknown class counts as caught in any."""
        if raised == UNKNOWN:
            return not caught
        return caught.isdisjoint(self._above(raised) | {"Exception", "BaseException"})

    def _helper(self, call: ast.Call, name: str) -> str | None:
        """Return the name of a called private function of this module or method of this class; None for other calls."""
        match call.func:
            case ast.Name(id=called) if called.startswith("_") and called in self._functions:
                return called
            case ast.Attribute(value=ast.Name(id="self" | "cls"), attr=called) if called.startswith("_"):
                full = f"{name.rpartition('.')[0]}.{called}"
                return full if full in self._functions else None
        return None

    def _classes(self, raised: ast.expr, bound: frozenset[str]) -> set[str]:
        """Return the classes of a raised expression; empty for a caught error that is raised again."""
        match raised:
            case ast.Call(func=ast.Name(id=called) | ast.Attribute(attr=called)) if called.lstrip("_")[:1].isupper():
                return {called}
            case ast.Call(func=ast.Name(id=called) | ast.Attribute(attr=called)):
                found = self._results.get(self._imported.get(called, called), set())
                return found if len(found) == 1 else {UNKNOWN}
            case ast.Name(id=called) if called in bound:
                return set()
            case ast.Name(id=called) if called[:1].isupper():
                return {called}
        return {UNKNOWN}


def _is_public(name: str) -> bool:
    return all(not part.startswith("_") or part in OPENERS for part in name.split("."))


def _all(scope: Scope, prefix: str) -> Iterator[tuple[Scope, str, Function]]:
    """Yield the functions of a module and the methods of its classes, each with its scope and full name."""
    for node in scope.body:
        if isinstance(node, ast.ClassDef):
            yield from _all(node, f"{prefix}{node.name}.")
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield scope, prefix + node.name, node


def _body(
    nodes: list[ast.stmt] | list[ast.AST], caught: frozenset[str], bound: frozenset[str]
) -> Iterator[tuple[ast.AST, frozenset[str], frozenset[str]]]:
    """Yield all nodes of a body, each with the classes that are caught around it and the names of caught errors.

    Inner functions are left out.
    """
    for node in nodes:
        if isinstance(node, Function | ast.Lambda | ast.ClassDef):
            continue
        yield node, caught, bound
        if isinstance(node, ast.Try):
            handled = frozenset(name for one in node.handlers for name in _handled(one))
            yield from _body(node.body, caught | handled, bound)
            for handler in node.handlers:
                yield from _body(handler.body, caught, bound | ({handler.name} if handler.name else set()))
            yield from _body([*node.orelse, *node.finalbody], caught, bound)
        elif isinstance(node, ast.With):
            suppressed = frozenset(name for item in node.items for name in _suppressed(item.context_expr))
            yield from _body(list(node.items), caught, bound)
            yield from _body(node.body, caught | suppressed, bound)
        else:
            yield from _body(list(ast.iter_child_nodes(node)), caught, bound)


def _handled(handler: ast.ExceptHandler) -> list[str]:
    """Return the names of the classes that an `except` clause catches and does not raise again."""
    if any(isinstance(node, ast.Raise) and node.exc is None for node in ast.walk(handler)):
        return []
    return ["BaseException"] if handler.type is None else _names(handler.type)


def _suppressed(context: ast.expr) -> list[str]:
    match context:
        case ast.Call(func=ast.Name(id="suppress") | ast.Attribute(attr="suppress"), args=classes):
            return [name for one in classes for name in _names(one)]
    return []


def _names(classes: ast.expr) -> list[str]:
    match classes:
        case ast.Tuple(elts=elements):
            return [name for one in elements for name in _names(one)]
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return [name]
    return []


def _bases(parsed: Mapping[str, ast.Module]) -> dict[str, frozenset[str]]:
    """Return each class of the project and of Python with its base classes, without Exception and above."""
    direct: dict[str, set[str]] = {}
    for tree in parsed.values():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                direct.setdefault(node.name, set()).update(name for base in node.bases for name in _names(base))
    for name, value in vars(builtins).items():
        if isinstance(value, type) and issubclass(value, Exception):
            direct[name] = {base.__name__ for base in value.__bases__}

    def above(name: str) -> frozenset[str]:
        if name in ("Exception", "BaseException", "object"):
            return frozenset()
        return frozenset({name}).union(*(above(base) for base in direct.get(name, ())))

    return {name: above(name) for name in direct}


def _results(parsed: Mapping[str, ast.Module]) -> dict[str, set[str]]:
    """Return the annotated results of functions and methods, by their names with and without the module."""
    found: dict[str, set[str]] = {}
    for path, tree in parsed.items():
        module = path.removesuffix(".py").replace("/", ".")
        for node in ast.walk(tree):
            if isinstance(node, Function):
                result = ast.unparse(node.returns).strip("'\"") if node.returns else UNKNOWN
                known = result if result.isidentifier() and result != "Exception" else UNKNOWN
                for name in (node.name, f"{module}.{node.name}"):
                    found.setdefault(name, set()).add(known)
    return found
