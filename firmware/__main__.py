"""The program: `captain`, `python -m firmware`, and the frozen binary."""

import os
import signal
import sys

INTERRUPTED = 130  # exit status by which shells report SIGINT


def main() -> int:
    """Run the command line and return its exit status. Ctrl-C prints no traceback, even during imports."""
    try:
        _die_with_boot_loader()
        return _main()
    except KeyboardInterrupt:
        return INTERRUPTED


def _die_with_boot_loader() -> None:
    """Make this process end with its boot loader.

    The one-file program is a child of PyInstaller's boot loader. If the loader is killed, the station must stop.
    """
    unpacked = getattr(sys, "_MEIPASS", "")
    if unpacked and not unpacked.startswith(os.path.dirname(sys.executable)):
        from board.runtime.child import die_with_parent

        die_with_parent(signal.SIGTERM)()


def _main() -> int:
    if sys.argv[1:2] == ["--worker"]:
        from board.runtime.worker import child
        from firmware.workers import WORKERS

        return child(sys.argv, WORKERS)
    from firmware import cli

    return cli.main(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
