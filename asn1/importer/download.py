"""Download of ASN.1 modules from a list of lines `<path in the directory> <https address>`."""

import tempfile
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from asn1.importer.parser.fault import ImportFault, Place, Problem, fault

# Limit for one file. The largest module of the standards has 0.4 MiB.
MAX_OCTETS = 8 * 2**20
TIMEOUT_S = 30.0

Fetch = Callable[[str], bytes]


@contextmanager
def directory_of(source: Path, fetch: Fetch | None = None) -> Iterator[Path]:
    """Yield the directory itself; for a list of addresses, a temporary directory with the downloaded files.

    Raises ImportFault with every line that cannot be fetched, OSError if the list cannot be read.
    """
    if source.is_dir():
        yield source
        return
    wanted = _lines(source)
    with tempfile.TemporaryDirectory(prefix="modules-") as folder:
        problems: list[Problem] = []
        for place, name, address in wanted:
            try:
                octets = (fetch or _fetch)(address)
            except (OSError, urllib.error.URLError) as error:
                problems.append(Problem(place, f"{address}: {error}"))
                continue
            path = Path(folder, name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(octets)
        if problems:
            raise ImportFault(problems)
        yield Path(folder)


def _lines(source: Path) -> list[tuple[Place, str, str]]:
    """Return place, path and address of each line. Blank lines and lines that begin with # are skipped."""
    found: list[tuple[Place, str, str]] = []
    for number, line in enumerate(source.read_text(encoding="utf-8").splitlines(), 1):
        place, words = Place(source.name, number), line.split()
        if not words or words[0].startswith("#"):
            continue
        if len(words) != 2 or not words[1].startswith("https://"):
            raise fault(place, "expected <path> <https address>")
        path = PurePosixPath(words[0])
        if path.is_absolute() or ".." in path.parts:
            raise fault(place, f"{words[0]} is outside the download directory; use a relative path without ..")
        found.append((place, words[0], words[1]))
    return found


def _fetch(address: str) -> bytes:
    with urllib.request.urlopen(address, timeout=TIMEOUT_S) as answer:
        octets: bytes = answer.read(MAX_OCTETS + 1)
    if len(octets) > MAX_OCTETS:
        raise OSError(f"more than {MAX_OCTETS} octets")
    return octets
