"""The program: `captain-asn1`, `python -m asn1`."""

import sys

INTERRUPTED = 130  # as a shell reports SIGINT


def main(argv: list[str] | None = None) -> int:
    """Run the command line; Ctrl-C is quiet from the first import on."""
    try:
        from asn1 import cli

        return cli.main(argv)
    except KeyboardInterrupt:
        print(file=sys.stderr)
        return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
