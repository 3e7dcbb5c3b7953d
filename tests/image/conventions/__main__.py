"""make image-conventions: checks our files for other card builders by our tests and by those builders' own tools.

Exits with 1 if a check failed. A check that was not made is named.
"""

import argparse
import subprocess
import sys
from pathlib import Path

from tests.image.conventions.mirrors import Row, rows


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.image.conventions", description=__doc__)
    parser.add_argument(
        "--mirrors", metavar="DIR", type=Path, help="folder of the checkouts rpi-imager, rpi-image-gen and pi-gen"
    )
    mirrors: Path | None = parser.parse_args().mirrors
    if mirrors is not None and not mirrors.is_dir():
        parser.error(f"--mirrors: {mirrors}: not a folder")
    own = ["tests/image/conventions", "tests/image/test_manifest.py"]
    ended = subprocess.run([sys.executable, "-m", "pytest", "-q", *own], check=False)
    found = [Row("structure", "see above" if ended.returncode else "", " ".join(own))]
    found += rows(mirrors.resolve() if mirrors else None)
    print(*found, sep="\n")
    return 1 if any(row.trouble for row in found) else 0


if __name__ == "__main__":
    sys.exit(main())
