"""A program with the radio's worker, started by tests of it as the station starts itself."""

import sys

from board.worker import child
from drivers.v2xcast import serve

if __name__ == "__main__":
    sys.exit(child(sys.argv, {"som301e": lambda: serve}))
