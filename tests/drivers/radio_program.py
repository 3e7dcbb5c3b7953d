"""Program that tests start as the radio process of a station."""

import sys

from board.runtime.worker import child
from drivers.som301e.process import serve

if __name__ == "__main__":
    sys.exit(child(sys.argv, {"som301e": lambda: serve}))
