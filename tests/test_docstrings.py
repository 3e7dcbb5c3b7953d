"""Docstrings: the rules of tests/docstrings.py for functions that raise errors."""

import ast
from textwrap import dedent

import pytest

from tests.docstrings import raisers

CLASSES = """
class StationError(Exception): ...
class InterfaceError(StationError): ...
class StuckError(InterfaceError): ...
"""


def missing(text: str) -> dict[str, tuple[str, ...]]:
    """Return the missing classes of errors by function."""
    parsed = {"board/errors.py": ast.parse(CLASSES), "board/one.py": ast.parse(dedent(text))}
    return {one.name: one.missing for one in raisers(parsed)}


@pytest.mark.parametrize("named", ["StuckError", "InterfaceError", "StationError"])
def test_function_that_names_the_class_or_a_base_lacks_nothing(named):
    assert missing(f'def start():\n    """Raises {named} where."""\n    raise StuckError("gone")') == {"start": ()}


@pytest.mark.parametrize("text", ["Start it.", "Raises Exception.", "Raises ValueError."])
def test_function_that_names_no_base_of_ours_lacks_the_class(text):
    assert missing(f'def start():\n    """{text}"""\n    raise StuckError("gone")') == {"start": ("StuckError",)}


def test_function_without_docstring_lacks_each_class():
    assert missing("def f(x):\n    if x: raise StuckError\n    raise errors.KeyMissing(x)") == {
        "f": ("KeyMissing", "StuckError")
    }


@pytest.mark.parametrize(
    "body",
    [
        "try:\n        raise StuckError\n    except StationError:\n        pass",
        "try:\n        raise StuckError\n    except (OSError, InterfaceError) as error:\n        return error",
        "with contextlib.suppress(StationError):\n        raise StuckError",
        "try:\n        x()\n    except StuckError:\n        raise",
        "try:\n        x()\n    except StuckError as error:\n        raise error from None",
        "raise SystemExit(2)",
        "def inner():\n        raise StuckError\n    return inner",
    ],
)
def test_error_that_is_caught_or_only_passed_on_is_not_counted(body):
    assert missing(f"def start():\n    {body}") == {}


@pytest.mark.parametrize(
    "body",
    [
        "try:\n        raise StuckError\n    except OSError:\n        pass",
        "try:\n        x()\n    except StationError:\n        raise StuckError",
        "try:\n        raise StuckError\n    except StuckError:\n        log()\n        raise",
    ],
)
def test_error_that_leaves_its_block_is_counted(body):
    assert missing(f"def start():\n    {body}") == {"start": ("StuckError",)}


def test_private_helpers_count_for_their_callers_one_level_deep():
    text = """
        def far(): _first()
        def near(): _second()
        def safe():
            try: _second()
            except StationError: pass
        def _first(): _second()
        def _second(): raise StuckError
        class Port:
            def open(self): self._open()
            def _open(self): raise StuckError
        class _Hidden:
            def open(self): raise StuckError
    """
    assert missing(text) == {"near": ("StuckError",), "Port.open": ("StuckError",)}


def test_constructor_may_be_described_by_its_class():
    text = """
        class Port:
            \"\"\"Raises StuckError where none is.\"\"\"
            def __init__(self): raise StuckError
            def open(self): raise StuckError
    """
    assert missing(text) == {"Port.__init__": (), "Port.open": ("StuckError",)}


def test_error_made_by_a_function_is_known_by_its_annotation():
    text = """
        def fault() -> StuckError: ...
        def vague() -> Exception: ...
        def known(): raise fault()
        def unknown(): raise vague()
        def told():
            \"\"\"Raises StuckError.\"\"\"
            raise vague()
    """
    assert missing(text) == {"known": ("StuckError",), "unknown": ("?",), "told": ()}
