"""`make fuzz`: coverage-guided fuzzing of every message, in C under ASan and UBSan, and of the Python module.

A finding ends its target; the input that shows it lies in build/fuzz/findings. Exit status 1 where there is one.
"""

import argparse
import os
import sys
from concurrent.futures import ThreadPoolExecutor

from asn1 import selection, text
from tests.fuzz import build, corpus, run

FOLDER = corpus.ROOT / "build" / "fuzz"


def main() -> int:
    args = _arguments()
    schema = text.load_schema()
    messages = selection.named(schema, args.messages) if args.messages else tuple(schema.messages)
    try:
        programs = build.programs(schema, messages, FOLDER, args.jobs)
        module = build.python_module(FOLDER) if args.python or not args.messages else None
    except build.BuildError as error:
        print(f"fuzz: {error}", file=sys.stderr)
        return 1
    with ThreadPoolExecutor(args.jobs) as pool:
        jobs = [pool.submit(run.target, name, program, FOLDER, args) for name, program in programs.items()]
        if module is not None:
            jobs.append(pool.submit(run.python_target, module, FOLDER, args))
        outcomes = [job.result() for job in jobs]
    return run.report(outcomes)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("messages", nargs="*", metavar="MESSAGE", help="default: all, and the Python module")
    parser.add_argument("--runs", type=int, default=100_000, help="inputs per target; default: %(default)s")
    parser.add_argument("--seconds", type=int, default=0, help="at most so long per target; 0: no bound")
    parser.add_argument("--seed", type=int, default=1, help="of the random numbers; default: %(default)s")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="targets at once; default: %(default)s")
    parser.add_argument("--python", action="store_true", help="the Python module beside the named messages")
    parser.add_argument("--keep", action="store_true", help="write what reached new code into tests/asn1/corpus")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
