"""`make fuzz`: coverage-guided fuzzing of every message in C under ASan and UBSan, of CDR, and of the Python module.

A finding ends its target; the input that shows it lies in build/fuzz/findings, and `build/fuzz/bin/MESSAGE FILE` shows it again.
Exit status 1 where there is one.
"""

import argparse
import os
import sys
import time
from concurrent.futures import ThreadPoolExecutor, as_completed

from asn1.model import selection, text
from tests.fuzz import build, corpus, run

FOLDER = corpus.ROOT / "build" / "fuzz"


def main() -> int:
    args = _arguments()
    schema = text.load_schema()
    try:
        messages = selection.named(schema, args.messages) if args.messages else tuple(schema.messages)
        programs = build.programs(schema, messages, FOLDER, args.jobs)
        module = build.python_module(FOLDER) if args.python or not args.messages else None
        cdr = build.cdr_program(schema, FOLDER, args.jobs) if args.cdr or not args.messages else None
    except (selection.UnknownMessageError, build.BuildError) as error:
        print(f"fuzz: {error}", file=sys.stderr)
        return 1
    started = time.monotonic()
    with ThreadPoolExecutor(args.jobs) as pool:
        jobs = []
        if module is not None:  # first: it takes longest, and both processors should end at about the same time
            jobs.append(pool.submit(run.python_target, module, FOLDER, list(schema.messages), args))
        if cdr is not None:
            jobs.append(pool.submit(run.cdr_target, cdr, FOLDER, list(schema.messages), args))
        jobs += [pool.submit(run.target, name, program, FOLDER, args) for name, program in programs.items()]
        for done, job in enumerate(as_completed(jobs), 1):
            run.progress(job.result(), done, len(jobs))
    outcomes = sorted((job.result() for job in jobs), key=lambda one: one.name in (run.CDR, run.PYTHON))
    return run.report(outcomes, args.runs, time.monotonic() - started)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("messages", nargs="*", metavar="MESSAGE", help="default: all, and the Python module")
    parser.add_argument(
        "--runs", type=int, default=100_000, help="inputs per target; -1: no bound; default: %(default)s"
    )
    parser.add_argument(
        "--every", type=_at_least_one, default=16, metavar="N",
        help="explanation, text and JSON, the costly checks, for one input in N, which its octets choose; 1: for all; "
        "decode, encode and validate are for all in any case; default: %(default)s",
    )  # fmt: skip
    parser.add_argument("--seconds", type=int, default=0, help="at most so long per target; 0: no bound")
    parser.add_argument("--seed", type=int, default=1, help="of the random numbers; default: %(default)s")
    processors = os.cpu_count() or 1
    parser.add_argument(
        "--jobs", type=int, default=processors, help="targets at once; default: %(default)s, as processors"
    )
    parser.add_argument("--python", action="store_true", help="the Python module beside the named messages")
    parser.add_argument("--cdr", action="store_true", help="ROS 2's CDR of all messages beside the named ones")
    parser.add_argument("--keep", action="store_true", help="write what reached new code into tests/asn1/corpus")
    return parser.parse_args()


def _at_least_one(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text}: 1 or more")
    return number


if __name__ == "__main__":
    sys.exit(main())
