"""The program: `captain`, `python -m firmware`, and the frozen binary."""

import os
import signal
import sys

INTERRUPTED = 130  # as a shell reports SIGINT


def main() -> int:
    """Run the command line; Ctrl-C is quiet from the first import on."""
    try:
        _die_with_boot_loader()
        return _main()
    except KeyboardInterrupt:
        return INTERRUPTED


def _die_with_boot_loader() -> None:
    """Frozen into one file, the program is a child of what unpacked it: whoever kills that means the station."""
    unpacked = getattr(sys, "_MEIPASS", "")
    if unpacked and not unpacked.startswith(os.path.dirname(sys.executable)):
        from board.child import die_with_parent

        die_with_parent(signal.SIGTERM)()


def _main() -> int:
    if sys.argv[1:2] == ["--worker"]:
        from board.worker import child
        from firmware.workers import WORKERS

        return child(sys.argv, WORKERS)
    from firmware import cli

    return cli.main(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
