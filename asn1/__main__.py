"""Program `captain-asn1`, also run by `python -m asn1`."""

import sys

INTERRUPTED = 130  # exit status that shells use for SIGINT: 128 + 2


def main(argv: list[str] | None = None) -> int:
    """Run the command line. Ctrl-C prints no traceback, also while modules are being imported."""
    try:
        from asn1 import cli

        return cli.main(argv)
    except KeyboardInterrupt:
        print(file=sys.stderr)
        return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
