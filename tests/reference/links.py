"""List of the addresses outside the project that its documents link to, with the documents."""

import re
from pathlib import Path

from tests.documents import FENCE, files

ADDRESS = re.compile(r"\]\((https?://[^)\s]+)\)|(?<![`(\w])<?(https?://[^\s>)`\]]+)")


def listed(root: Path) -> str:
    """Return a line for each address, in order: the address, and the documents that link to it."""
    found: dict[str, set[str]] = {}
    for path in (path for path in files(root) if path.suffix == ".md"):
        for address in addresses(path.read_text(encoding="utf-8")):
            found.setdefault(address, set()).add(path.relative_to(root).as_posix())
    return "".join(f"{address} {' '.join(sorted(where))}\n" for address, where in sorted(found.items()))


def addresses(text: str) -> set[str]:
    """Return the external addresses of a document, without those of its examples."""
    return {(one[0] or one[1]).rstrip(".,;:") for one in ADDRESS.findall(FENCE.sub("", text))}
