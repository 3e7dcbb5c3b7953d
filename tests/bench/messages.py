"""`python -m tests.bench.messages`: captain_messages beside asn1tools and pycrate, alternating in one run.

Per message of firmware/vectors.json: decode to a dict; a lazy view with five fields read, as attributes ("view") and by a
reader ("fields"); the same five by the reader alone ("reader"); encode from a dict; the medians, and the ratio to asn1tools
beside what is to be reached. Then decode and encode in C, and the same beside asn1c.
"""

import argparse
import importlib.util
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from timeit import Timer
from typing import Any, NamedTuple

from asn1.model.types import Reference, Schema
from tests.bench import asn1c, message_views
from tests.bench.message_views import Case

ROOT = Path(__file__).resolve().parents[2]
CODEC = ROOT / "build" / "codec" / "python"
GOALS = {"decode": 30, "view": 150, "fields": 150, "reader": 150, "encode": 80}  # times asn1tools' decode or encode
C_GOALS_NS = {("cam-1.4.1", 46): 60}  # of message and octets; of any other 1 ns for each bit
REPETITION_S = 0.01  # of processor time: what else the machine does does not count

Decode = Callable[[bytes], Any]
Encode = Callable[[Any], bytes]


class Codec(NamedTuple):
    """timers: by kind, as GOALS has them."""

    name: str
    timers: dict[str, Timer]


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.messages", description=__doc__)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--only", default="", help="messages whose name contains this")
    arguments = parser.parse_args()
    if not list(CODEC.glob("captain_messages*.so")):
        print("bench: no captain_messages in build/codec/python: make codec", file=sys.stderr)
        return 1
    sys.path.insert(0, str(CODEC))
    cases = [case for case in message_views.cases() if arguments.only in case.name]
    peers = _peers()
    print(f"{'message':14}{'octets':>7}{'':10}{'ours':>10}", *(f"{peer:>11}" for peer in peers), "  ratio  goal")
    for case in cases:
        _compare(case, peers, arguments.rounds)
    program = _c_program()
    if program is None:
        return 1
    _c_figures(cases, program, arguments.rounds)
    asn1c.compare(cases, program, arguments.rounds)
    return 0


def _peers() -> list[str]:
    """Which other codecs there are; says which are missing."""
    there = []
    for name, package in {"asn1tools": "asn1tools", "pycrate": "pycrate_asn1rt"}.items():
        if importlib.util.find_spec(package) is None:
            print(f"bench: {name} is not installed, and not compared", file=sys.stderr)
        else:
            there.append(name)
    return there


# ---------------------------------------------------------------- Python


def _compare(case: Case, peers: list[str], rounds: int) -> None:
    codecs = [_ours(case), *filter(None, (_peer(peer, case) for peer in peers))]
    times: dict[tuple[str, str], list[float]] = {}
    for _ in range(rounds):
        for kind in GOALS:
            for codec in codecs:
                if kind in codec.timers:
                    times.setdefault((codec.name, kind), []).append(_time_s(codec.timers[kind]))
    medians = {key: statistics.median(taken) for key, taken in times.items()}
    for kind, goal in GOALS.items():
        _print_row(case, kind, goal, peers, medians)


def _print_row(case: Case, kind: str, goal: int, peers: list[str], medians: dict[tuple[str, str], float]) -> None:
    ours = medians["ours", kind]
    other = kind if kind == "encode" else "decode"
    cells = [
        f"{medians[peer, other] * 1e6:>9.1f} us" if (peer, other) in medians else f"{'fails':>12}" for peer in peers
    ]
    ratio = medians[peers[0], other] / ours if peers and (peers[0], other) in medians else None
    verdict = "" if ratio is None else f"{ratio:>8.1f}{goal:>6}  {'reached' if ratio >= goal else 'MISSED'}"
    print(f"{case.name:14}{len(case.octets):>7}  {kind:8}{ours * 1e9:>7.0f} ns" + "".join(cells) + verdict)


def _timer(statement: str, **names: Any) -> Timer:
    """With the collector of garbage on, which timeit would stop: programs run with it."""
    return Timer(statement, "import gc; gc.enable()", timer=time.thread_time, globals=names)


def _time_s(timer: Timer) -> float:
    """Of one statement: loops until REPETITION_S is over, counted in powers of two."""
    loops = 1
    while (taken := timer.timeit(loops)) < REPETITION_S:
        loops *= 2
    return taken / loops


def _ours(case: Case) -> Codec:
    import captain_messages

    message = captain_messages.find(case.name)
    value, read = message.decode(case.octets), message.reader(*case.paths)
    if message.encode(value) != case.octets:
        print(f"bench: {case.name} is encoded again otherwise", file=sys.stderr)
    return Codec(
        "ours",
        {
            "decode": _timer("decode(octets)", decode=message.decode, octets=case.octets),
            "view": _timer(case.read, decode=message.view, octets=case.octets),
            "fields": _timer("read(decode(octets))", read=read, decode=message.view, octets=case.octets),
            "reader": _timer("read(octets)", read=read, octets=case.octets),
            "encode": _timer("encode(value)", encode=message.encode, value=value),
        },
    )


def _peer(name: str, case: Case) -> Codec | None:
    """None, and a line on stderr, where it cannot do this message."""
    from asn1.model.text import load_schema
    from tests.asn1.reach import pruned

    schema = load_schema()
    pdu = schema.messages[case.name].pdu
    try:
        decode, encode = PEERS[name](pruned(schema, pdu), pdu)
        value = decode(case.octets)
        encode(value)
    except Exception as error:  # noqa: BLE001
        print(f"bench: {name} fails on {case.name}: {error!r:.100}", file=sys.stderr)
        return None
    return Codec(
        name,
        {
            "decode": _timer("decode(octets)", decode=decode, octets=case.octets),
            "encode": _timer("encode(value)", encode=encode, value=value),
        },
    )


def _asn1tools(schema: Schema, pdu: Reference) -> tuple[Decode, Encode]:
    """As its manual says: with the checks of types that are on unless somebody says otherwise."""
    import asn1tools

    from tests.asn1.oracles import texts

    specification = asn1tools.compile_string(texts(schema, "asn1tools"), "uper")
    return partial(specification.decode, pdu.name), partial(specification.encode, pdu.name)


def _pycrate(schema: Schema, pdu: Reference) -> tuple[Decode, Encode]:
    from tests.asn1.oracles import Pycrate

    type_ = Pycrate(schema, pdu)._type

    def decode(octets: bytes) -> Any:
        type_.from_uper(octets)
        return type_.get_val()

    def encode(value: Any) -> bytes:
        type_.set_val(value)
        return bytes(type_.to_uper())

    return decode, encode


PEERS = {"asn1tools": _asn1tools, "pycrate": _pycrate}


# ---------------------------------------------------------------- C


def _c_program() -> Path | None:
    """messages.c with the objects of the Python module."""
    program = ROOT / "build" / "bench-messages"
    objects = sorted((CODEC / ".objects").glob("src-*.o"))
    generated = ROOT / "asn1" / "backends" / "c" / "runtime" / "include"
    source = Path(__file__).with_name("messages.c")
    flags = ["-std=gnu11", "-O2", f"-I{generated}", "-Wl,--gc-sections"]
    made = subprocess.run(["cc", *flags, source, *objects, "-o", program], capture_output=True, text=True, check=False)
    if made.returncode == 0:
        return program
    print(f"bench: no figures of C: {made.stderr:.500}", file=sys.stderr)
    return None


def _c_figures(cases: list[Case], program: Path, rounds: int) -> None:
    print("\nC                    decode                                           encode")
    for case in cases:
        runs = [asn1c.times(program, case) for _ in range(rounds)]
        cells = (_c_cell(statistics.median(column), case) for column in zip(*runs, strict=True))
        print((f"{case.name:14}" + "  ".join(cells)).rstrip())


def _c_cell(ns: float, case: Case) -> str:
    bits = 8 * len(case.octets)
    goal_ns = C_GOALS_NS.get((case.name, len(case.octets)), bits)
    verdict = "reached" if ns < goal_ns else "MISSED"
    return f"{ns:>9.1f} ns {bits / 8 / ns * 1e3:>7.0f} MB/s {ns / bits:>6.3f} ns/bit  {verdict:7}"


if __name__ == "__main__":
    sys.exit(main())
