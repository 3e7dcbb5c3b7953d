"""Markdown documents of the repository: their files, fenced blocks and the anchors of headings."""

import os
import re
from collections.abc import Iterator
from pathlib import Path

# Folders of builds, tools and environments, whose files do not belong to the repository.
NOT_OURS = re.compile(r"^(build|\..*|.*\.egg-info|__pycache__|node_modules|dist)$")
FENCE = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)


def files(root: Path) -> Iterator[Path]:
    """Yield all files of the repository below a folder."""
    for folder, folders, names in os.walk(root):
        folders[:] = [name for name in folders if not NOT_OURS.match(name)]
        yield from (Path(folder) / name for name in names)


def blocks(text: str, tag: str) -> list[str]:
    """Return the fenced blocks with this tag, the words behind the first three backticks."""
    return re.findall(rf"^```{re.escape(tag)}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def anchor(heading: str) -> str:
    """Return the anchor of a heading, as GitHub makes it: lower case, hyphens for spaces, no punctuation."""
    return re.sub(r"[^\w -]", "", heading).strip().lower().replace(" ", "-")
