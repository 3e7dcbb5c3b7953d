"""make image, programs, release, flash: builds, checks, releases and flashes card and programs."""

import argparse
import errno
import sys
import time
from pathlib import Path

from image import description, step
from image.card import build, figures, flash, keys, release, twice
from image.errors import ImageError
from image.program import programs, repository
from image.verify import card as verify

HINTS = {
    errno.EACCES: "run it as root, or as the user who built it",
    errno.EPERM: "run it as root, or as the user who built it",
    errno.ENOSPC: "make room, or name a folder elsewhere: --to DIR",
    errno.EIO: "check the disk",
    errno.EROFS: "name a folder elsewhere: --to DIR",
}


def main() -> int:
    arguments = _parser().parse_args()
    verbs = {
        "build": _build,
        "verify": _verify,
        "twice": _twice,
        "programs": _programs,
        "release": _release,
        "flash": _flash,
    }
    try:
        return verbs[arguments.verb](arguments, description.read(arguments.description))
    except ImageError as error:
        print(f"image: {error}", file=sys.stderr)
    except OSError as error:
        if error.errno not in HINTS:
            raise  # a bug of this program
        what = f"{error.filename or arguments.to}: {error.strerror}"
        print(f"image: {ImageError(what, HINTS[error.errno])}", file=sys.stderr)
    except KeyboardInterrupt:
        print("image: stopped; the next call repeats the unfinished step", file=sys.stderr)
        return 130
    return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m image", description=__doc__)
    parser.add_argument(
        "--description", metavar="FILE", type=Path, default=build.HERE / "image.toml", help="default: image/image.toml"
    )
    parser.add_argument(
        "--to", metavar="DIR", type=_folder, default=build.BUILT, help="build folder; the card is beside it"
    )
    verbs = parser.add_subparsers(dest="verb", required=True)
    making = verbs.add_parser("build", help="make the card and verify it")
    making.add_argument("--upgrade", action="store_true", help="with the newest packages")
    verbs.add_parser("verify", help="verify the last made card again")
    verbs.add_parser("twice", help="make the card again from the same packages and list the differences")
    programs_alone = verbs.add_parser("programs", help="make programs and Debian packages alone, in build/programs")
    programs_alone.add_argument("--upgrade", action="store_true", help="with the newest packages")
    releasing = verbs.add_parser("release", help="make all files of a release, in build/release")
    releasing.add_argument("--key", default="", metavar="FINGERPRINT", help="key that signs the apt repository")
    writing = verbs.add_parser("flash", help="write the last made card to a device")
    writing.add_argument("device", type=Path, help="/dev/sdX or /dev/mmcblkX; its contents are lost")
    return parser


def _folder(word: str) -> Path:
    try:
        path = Path(word).resolve()
    except (OSError, RuntimeError) as error:  # RuntimeError: a loop of links, before Python 3.13
        raise argparse.ArgumentTypeError(f"{word}: cannot be followed: {error}") from error
    if path.is_symlink():
        raise argparse.ArgumentTypeError(f"{word}: cannot be followed: Symlink loop")
    return path


def _build(arguments: argparse.Namespace, described: description.Description) -> int:
    began = time.monotonic()
    made = build.Build(described, arguments.to)
    card = made.card(arguments.upgrade)
    _tell(made.steps.folder, described, card, time.monotonic() - began)
    return _verified(described, made.steps.folder, card, made.keys)


def _verify(arguments: argparse.Namespace, described: description.Description) -> int:
    with step.at_rest(arguments.to):
        card = build.planned(described, arguments.to)
        if not card.image.is_file():
            raise ImageError(f"{card.image}: is not there", "make image builds it")
        return _verified(described, arguments.to, card, keys.kept(arguments.to / build.KEYS))


def _twice(arguments: argparse.Namespace, described: description.Description) -> int:
    first = arguments.to.resolve()
    card = build.Build(described, first).card()
    began = time.monotonic()
    second, took = twice.again(first, described)
    print(*figures.times(took, time.monotonic() - began), sep="\n")
    rows = list(twice.compared(first, card.image, second))
    print(*rows, sep="\n")
    return 1 if any(row.differing and not row.is_left_out for row in rows) else 0


def _programs(arguments: argparse.Namespace, described: description.Description) -> int:
    to = arguments.to.parent / "programs"
    rows = programs.make(described, arguments.to, to, arguments.upgrade)
    programs.write_sums(rows, to)
    print(*rows, to / programs.SUMS, sep="\n")
    return 0 if all(row.is_ok for row in rows) else 1


def _release(arguments: argparse.Namespace, described: description.Description) -> int:
    if arguments.key:
        repository.check(arguments.key)
    made = build.Build(described, arguments.to)
    card = made.card()
    if _verified(described, made.steps.folder, card, made.keys):
        return 1
    to = made.steps.folder.parent / "release"
    rows = list(release.make(made, card, to, arguments.key))
    print(*rows, sep="\n")
    print(to / programs.SUMS)
    signed = f"signed by {arguments.key}" if arguments.key else "not signed: make release KEY=FINGERPRINT signs it"
    print(f"{to / release.REPOSITORY}: {signed}")
    if made.keys.kind == keys.DEVELOPMENT:
        what = f"boxes accept any update signed on this machine; for a release, {keys.KEY} and {keys.CERTIFICATE}"
        print(f"image: signed by the development key: {what} name a key of your own", file=sys.stderr)
    return 0 if all(row.is_ok for row in rows) else 1


def _flash(arguments: argparse.Namespace, described: description.Description) -> int:
    with step.at_rest(arguments.to):
        card = build.planned(described, arguments.to)
        flash.flash(card.image, card.checksums, arguments.device)
    return 0


def _tell(folder: Path, described: description.Description, card: build.CardBuild, took_in_all_s: float) -> None:
    print(*figures.times(card.took, took_in_all_s), *figures.sizes(described, folder, card), sep="\n")
    print(card.image)


def _verified(described: description.Description, folder: Path, card: build.CardBuild, signer: keys.Keys) -> int:
    looked = verify.FinishedCard(described, card.image, folder, keys.secret(signer), card)
    rows: list[verify.Check] = []
    try:
        rows.extend(looked.rows())
    except ImageError as error:  # the checks before it are reported as well
        rows.append(verify.Check("the rest of it", str(error)))
    failed = [row for row in rows if row.trouble]
    for row in failed:
        print(row, file=sys.stderr)
    print(f"{len(rows) - len(failed)} of {len(rows)} checks of the card are ok")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
