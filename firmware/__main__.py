"""The program: `captain`, `python -m firmware`, and the frozen binary."""

import sys


def main() -> int:
    from firmware import cli

    return cli.main(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
