"""The program: `captain`, `python -m firmware`, and the frozen binary."""

import sys


def main() -> int:
    if sys.argv[1:2] == ["--worker"]:
        from board.echo import WORKERS
        from board.worker import child

        return child(sys.argv, WORKERS)
    from firmware import cli

    return cli.main(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
