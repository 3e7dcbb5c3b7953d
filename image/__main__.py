"""make image, make flash: builds the card, looks it through, writes it."""

import argparse
import sys
import time
from pathlib import Path

from image import build, description, flash, verify
from image.errors import ImageError


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m image", description=__doc__)
    parser.add_argument(
        "--description", metavar="FILE", type=Path, default=build.HERE / "image.toml", help="default: image/image.toml"
    )
    parser.add_argument(
        "--to", metavar="DIR", type=Path, default=build.BUILT, help="where it works; the card lies beside it"
    )
    verbs = parser.add_subparsers(dest="verb", required=True)
    making = verbs.add_parser("build", help="make the card, and look it through")
    making.add_argument("--upgrade", action="store_true", help="with the newest packages")
    making.add_argument("--compress", action="store_true", help="and .xz beside it, for downloads")
    verbs.add_parser("verify", help="look a finished card through")
    writing = verbs.add_parser("flash", help="write it to a card")
    writing.add_argument("device", help="/dev/sdX or /dev/mmcblkX: all that is on it is lost")
    arguments = parser.parse_args()
    try:
        found = description.read(arguments.description)
        made = build.Build(found, arguments.to)
        if arguments.verb == "flash":
            flash.write(made.card().image, Path(arguments.device))
            return 0
        began = time.monotonic()
        card = made.card(getattr(arguments, "upgrade", False))
        if getattr(arguments, "compress", False):
            build.compress(card.image)
        _tell(card, time.monotonic() - began)
        return _verified(verify.Card(found, card.image, arguments.to / "tools"))
    except ImageError as error:
        print(f"image: {error}", file=sys.stderr)
        return 1


def _tell(card: build.Card, took_in_all_s: float) -> None:
    for name, took_s in card.took.items():
        print(f"{took_s:6.1f} s  {name}")
    print(f"{took_in_all_s:6.1f} s  in all\n{card.image}")


def _verified(card: verify.Card) -> int:
    rows = list(card.rows())
    failed = [row for row in rows if row.trouble]
    for row in failed:
        print(row, file=sys.stderr)
    print(f"{len(rows) - len(failed)} of {len(rows)} checks of the card are ok")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
