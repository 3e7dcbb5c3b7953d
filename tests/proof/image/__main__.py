"""python -m tests.proof.image: the very card in QEMU, looked at from outside, part by part."""

import argparse
import importlib
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from pathlib import Path

from tests.proof.image.machine import LOADER, NotSeenError
from tests.proof.image.rows import Options, Row, keep

PROJECT = Path(__file__).resolve().parents[3]
MADE = PROJECT / "build/image"
RESULTS = MADE / "results.json"
LOGS = MADE / "proof"  # what the consoles of the last run of each part said
# A part is a module of this package with rows(card, folder, options) -> Iterator[Row]: name = what it shows.
PARTS = {
    "start": "it starts: console, key, endpoint, ssh, a power cut",
    "pi3": "the same card in an emulated Raspberry Pi 3",
    "ports": "each network of the box, scanned from outside",
    "hardening": "how closed each unit is, and why not more",
    "chart": "what a start is made of, and what captain adds to it (a bench)",
    "flash": "make flash, at a loop device",
    "owner": "the owner's files: the guide, mistakes, Raspberry Pi Imager",
    "cuts": "power cuts, on a drive that loses, reorders or tears what was not flushed (most of an hour)",
    "storage": "data in trouble: what the early boot repairs, what the station says, what is written at rest",
    "update": "updates: from a server, in 1970, refused ones, one that fails and is left, and back",
    "update_cuts": "power cuts in the middle of an update, on a drive that loses what was not flushed",
    "trouble": "a station that cannot start: what the box says of it",
    "hang": "a start that hangs before systemd, and the watchdog that ends it",
    "v2n": "MQTT by TLS after a start in 1970",
    "battery": "without a battery: where the clock begins",
    "board": "captain selftest, with a receiver, a modem and pulses of this machine",
    "clock": "its clock steered by pulses, over an outage and a leap second",
}
SHORT = ("start", "update", "cuts")  # a start, an update, ten cuts
NEEDED = {
    "qemu-system-aarch64": "qemu-system-arm",
    "mcopy": "mtools",
    "ssh": "openssh-client",
    "ssh-keygen": "openssh-client",
    "rauc": "rauc",
    "mksquashfs": "squashfs-tools",
    "losetup": "mount",
}


def main() -> int:
    arguments = _arguments()
    trouble = _trouble(arguments.card)
    if trouble:
        print(f"image-test: {trouble}", file=sys.stderr)
        return 2
    options = Options(arguments.count, arguments.short)
    rows: list[Row] = []
    parts = arguments.only or (SHORT if arguments.short else PARTS)
    for part in [one for one in parts if one not in arguments.without]:
        print(f"{part}: {PARTS[part]}", flush=True)
        began = time.monotonic()
        found = list(_shown(_rows(part, arguments.card, options)))
        took = time.monotonic() - began
        keep(RESULTS, part, arguments.card.name, found, took)
        rows += found
        print(f"        {took:.0f} s", flush=True)
    missed = [row for row in rows if not row.is_ok]
    print(f"{len(rows) - len(missed)} of {len(rows)} meet their goal; rows: {RESULTS}, consoles: {LOGS}")
    print(*missed, sep="\n", end="\n" if missed else "")  # once more, as a log may be cut to its end
    return 1 if missed or not rows else 0


def _rows(part: str, card: Path, options: Options) -> Iterator[Row]:
    """Of a part, in a folder of its own; what never came is a row too."""
    measure = importlib.import_module(f"tests.proof.image.{part}").rows
    with tempfile.TemporaryDirectory(prefix="captain-") as name:
        folder = Path(name)
        try:
            yield from measure(card, folder, options)
        except (NotSeenError, subprocess.SubprocessError, OSError) as error:
            traceback.print_exc()
            yield Row(f"{part} comes to its end", str(error).splitlines()[0], "its end", False)
        finally:
            _keep_logs(folder, LOGS / part)


def _shown(rows: Iterator[Row]) -> Iterator[Row]:
    for row in rows:
        print(row, flush=True)
        yield row


def _keep_logs(folder: Path, target: Path) -> None:
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir(parents=True)
    for path in sorted(folder.rglob("*.log")):
        shutil.copy(path, target / "-".join(path.relative_to(folder).parts))


def _trouble(card: Path | None) -> str:
    """Why nothing can be shown; empty where it can."""
    if card is None or not card.is_file():
        return f"{card or 'build/captain-*-arm64.img'}: there is no card: make image builds one"
    for program, package in NEEDED.items():
        if shutil.which(program) is None:
            return f"{program}: is not installed: as root apt-get install {package}"
    if not LOADER.is_file():
        return f"{LOADER}: is not there: as root apt-get install u-boot-qemu"
    return ""


def _arguments() -> argparse.Namespace:
    described = "\n".join(f"  {name:10} {what}" for name, what in PARTS.items())
    parser = argparse.ArgumentParser(
        prog="python -m tests.proof.image",
        description=__doc__,
        epilog=f"parts:\n{described}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    newest = sorted((PROJECT / "build").glob("captain-*-arm64.img"), key=lambda path: path.stat().st_mtime)
    parser.add_argument(
        "--card", metavar="FILE", type=Path, default=newest[-1] if newest else None, help="default: the last one built"
    )
    parser.add_argument("--only", metavar="PART", nargs="+", choices=tuple(PARTS), help="these parts (default: all)")
    parser.add_argument("--without", metavar="PART", nargs="+", choices=tuple(PARTS), default=[], help="all but these")
    parser.add_argument(
        "--short", action="store_true", help=f"a short form; without --only of {', '.join(SHORT)} alone"
    )
    parser.add_argument("--count", metavar="N", type=int, help="of what a part repeats: cuts, starts")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
