"""All files of the reference, as they should be."""

from collections.abc import Callable
from pathlib import Path

from tests.reference import commands, drops, links, options, topics, types
from tests.reference.data_flow import PICTURE, picture
from tests.reference.page import MissingError, Page

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "firmware" / "reference"
LINKS = ROOT / "tests" / "reference" / "links.txt"
PAGES: tuple[Callable[[], Page], ...] = (options.page, drops.page, topics.page, commands.page, types.page)


def written() -> dict[Path, str]:
    """Return the text of each file. Raises MissingError with every part of the code that has no meaning."""
    made = [page() for page in PAGES]
    if missing := [line for page in made for line in page.missing]:
        raise MissingError("\n".join(missing))
    files = {FOLDER / f"{page.name}.md": page.text() for page in made}
    return files | {PICTURE: picture(), LINKS: links.listed(ROOT)}
