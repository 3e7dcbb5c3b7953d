"""Writes firmware/reference, and the list of external links: python -m tests.reference, or `make reference`."""

import sys

from tests.reference.page import MissingError
from tests.reference.pages import FOLDER, written


def main() -> int:
    """Write what has changed. Returns 1 where the code has no meaning for something."""
    try:
        files = written()
    except MissingError as error:
        print(f"{error}\nWrite the meaning there, then run `make reference` again.", file=sys.stderr)
        return 1
    FOLDER.mkdir(exist_ok=True)
    for path, text in files.items():
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
            print(f"written: {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
