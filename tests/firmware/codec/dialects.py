"""python -m tests.firmware.codec.dialects: generated values of every edition with a header, through both dialects of JSON.

Each value comes back as the same octets. Some also fit the JSON schema of their edition.
"""

import argparse
import functools
import json
import multiprocessing
import time
from collections.abc import Iterator
from typing import Any, NamedTuple

import jsonschema

from asn1.model import types as t
from firmware.codec.schema import schema
from tests.asn1.codec import captain_messages
from tests.asn1.ranges import read_as
from tests.asn1.reach import pruned
from tests.asn1.trial import chunks
from tests.asn1.truth import schema as asn1_schema
from tests.asn1.values import Values

CHUNK = 5_000
EXAMPLES = 3


class Task(NamedTuple):
    edition: str
    seed: int
    count: int
    checked: int


def editions() -> list[str]:
    """The editions with an ITS PDU header."""
    return [name for name, message in asn1_schema().messages.items() if message.ids]


def octets_of(edition: str, seed: int, count: int, is_long: bool = True) -> Iterator[bytes]:
    """Generated messages of an edition."""
    message: t.Message = asn1_schema().messages[edition]
    values = Values(read_as(pruned(asn1_schema(), message.pdu), message), message.pdu, seed, is_long=is_long)
    codec = captain_messages.find(edition)
    for _ in range(count):
        yield codec.encode(values.value())


@functools.cache
def validator(edition: str, is_plain: bool) -> Any:
    """The JSON schema of an edition, itself checked."""
    made = schema(captain_messages.find(edition), is_plain)
    jsonschema.Draft202012Validator.check_schema(made)
    return jsonschema.Draft202012Validator(made)


def failures(task: Task) -> tuple[str, list[str]]:
    """Return the faults of the values of a task; the first `checked` values are compared with the schemas."""
    codec, found = captain_messages.find(task.edition), []
    validators = {is_plain: validator(task.edition, is_plain) for is_plain in (False, True)}
    for number, octets in enumerate(octets_of(task.edition, task.seed, task.count)):
        for is_plain, one in validators.items():
            text = codec.to_json(octets, plain=is_plain)
            again = codec.from_json(text, plain=is_plain)
            if again != octets:
                found.append(f"{task.edition}: {octets.hex()} comes back as {again.hex()} by {text}")
            if number < task.checked:
                errors = one.iter_errors({"edition": task.edition, "message": json.loads(text)})
                found += [f"{task.edition}: {error.json_path}: {error.message[:200]}" for error in errors]
    return task.edition, found


def tasks(names: list[str], count: int, checked: int) -> Iterator[Task]:
    for name in names:
        for seed, part in chunks(count, CHUNK):
            yield Task(name, seed, part, checked if seed == 0 else 0)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.firmware.codec.dialects", description=__doc__)
    parser.add_argument("--count", type=int, default=100_000, help="values of each edition (default 100000)")
    parser.add_argument("--checked", type=int, default=500, help="of them compared with the schemas (default 500)")
    parser.add_argument("--edition", action="append", help="only this edition; may be given several times")
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args(arguments)
    todo = list(tasks(options.edition or editions(), options.count, options.checked))
    wrong: dict[str, list[str]] = {task.edition: [] for task in todo}
    began = time.monotonic()
    with multiprocessing.get_context("spawn").Pool(options.processes) as pool:
        for name, found in pool.imap_unordered(failures, todo):
            wrong[name] += found
    for name, found in wrong.items():
        print(f"{name:<25} {options.count} values, {min(options.checked, options.count)} checked, {len(found)} wrong")
        print("".join(f"  {one}\n" for one in found[:EXAMPLES]), end="")
    print(f"{time.monotonic() - began:.0f} s with {options.processes} processes")
    return int(any(wrong.values()))


if __name__ == "__main__":
    raise SystemExit(main())
