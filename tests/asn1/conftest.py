"""Schema texts, parsed once per session."""

import functools
from collections.abc import Iterator

import pytest

from asn1.model import text


@pytest.fixture(scope="session", autouse=True)
def parsed_once() -> Iterator[None]:
    """Keep what `text.load` makes of each text: the committed schema takes 0.3 s, and most tests load it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(text, "load", functools.cache(text.load))
        yield
