"""asn1c beside our C: what it makes of each message, measured in the same rounds as ours.

The program is ASN1C=/path/to/asn1c, or asn1c from PATH: Debian's 0.9.28 or the user's own build of a later one. What it
cannot do is said in the table, with the reason.
"""

import hashlib
import os
import re
import shutil
import statistics
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from asn1.backends.asn import text as asn
from asn1.model.text import load_schema
from tests.asn1.reach import pruned
from tests.bench.asn1c_text import SIZE, helped
from tests.bench.message_views import Case

FOLDER = Path(__file__).resolve().parents[2] / "build" / "bench" / "asn1c"
SOURCE = Path(__file__).with_name("asn1c.c")
# Of newer forks, of older ones, and of 0.9.28. An unknown flag ends with EX_USAGE: then the next line is tried.
FLAGS = (
    ("-fcompound-names", "-no-gen-BER", "-no-gen-XER", "-no-gen-JER", "-no-gen-OER", "-no-gen-APER", "-no-gen-example"),
    ("-fcompound-names", "-no-gen-BER", "-no-gen-XER", "-no-gen-OER", "-no-gen-example"),
    ("-fcompound-names", "-gen-PER"),
)
EX_USAGE = 64
MAINS = ("converter-sample.c", "converter-example.c")  # of 0.9.28, and of later ones
COMPILE = ("cc", "-std=gnu11", "-O2", "-w")


class Times(NamedTuple):
    """Of one message, in ns."""

    decode: float
    encode: float


class CannotError(Exception):
    """What the other compiler cannot, in its words."""


def compare(cases: list[Case], ours: Path, rounds: int) -> None:
    """Prints a table. ours: the program of messages.c."""
    asn1c = os.environ.get("ASN1C") or shutil.which("asn1c")
    if asn1c is None or shutil.which(asn1c) is None:
        print("bench: asn1c: not here; as root apt-get install asn1c, or ASN1C=/path/to/asn1c", file=sys.stderr)
        return
    print(f"\n{_version(asn1c):14}{'':8}decode: ours     asn1c ratio    encode: ours     asn1c ratio   helped with")
    for case in cases:
        print(f"{case.name:14}{len(case.octets):>7} ", _row(asn1c, case, ours, rounds))


def _version(asn1c: str) -> str:
    said = subprocess.run([asn1c, "-version"], capture_output=True, text=True, check=False)
    found = re.search(r"v(\S+)", said.stdout + said.stderr)
    return f"asn1c {found[1]}" if found else "asn1c"


def _row(asn1c: str, case: Case, ours: Path, rounds: int) -> str:
    try:
        return _measured(asn1c, case, ours, rounds, sizes=False)
    except CannotError as error:
        wrong = str(error)
    try:
        return f"{_measured(asn1c, case, ours, rounds, sizes=True)}; with the SIZE of the standard it {wrong}"
    except CannotError:
        return f"asn1c {wrong}"


def _measured(asn1c: str, case: Case, ours: Path, rounds: int, sizes: bool) -> str:
    """sizes: as of `helped`. Raises CannotError, also where that changes nothing."""
    theirs, help_ = _program(asn1c, case.name, sizes)
    pairs = [(times(ours, case), times(theirs, case)) for _ in range(rounds)]
    return "  ".join([*(_cells(pairs, kind) for kind in Times._fields), "; ".join(help_)]).rstrip()


def _cells(pairs: list[tuple[Times, Times]], kind: str) -> str:
    """The medians, and that of the quotients within each round."""
    both = [(getattr(ours, kind), getattr(theirs, kind)) for ours, theirs in pairs]
    ours_ns, theirs_ns = (statistics.median(column) for column in zip(*both, strict=True))
    return f"{ours_ns:>9.1f} ns{theirs_ns:>7.0f} ns{statistics.median(b / a for a, b in both):>6.1f}"


def times(program: Path, case: Case) -> Times:
    """Of one run. Raises CannotError where it does not understand the octets or gives others back."""
    line = f"{case.name} {case.octets.hex()}\n"
    ran = subprocess.run([str(program)], input=line, capture_output=True, text=True, check=False)
    if ran.returncode != 0:
        raise CannotError(ran.stderr.strip() or f"ends with {ran.returncode}")
    decode_ns, encode_ns = map(float, ran.stdout.split()[1:])
    return Times(decode_ns, encode_ns)


# ---------------------------------------------------------------- the program


def _program(asn1c: str, name: str, sizes: bool) -> tuple[Path, list[str]]:
    """The program that measures this message, and with what asn1c was helped; made again where anything has changed."""
    schema = load_schema()
    schema, help_ = helped(pruned(schema, schema.messages[name].pdu), sizes)
    if sizes and SIZE not in help_:
        raise CannotError("is not helped by that")
    texts = {key: asn.text(schema, module, None) for key, module in schema.modules.items()}
    compiler = Path(shutil.which(asn1c) or asn1c).read_bytes()
    sources = [*(text.encode() for text in texts.values()), compiler, *map(Path.read_bytes, _own_sources())]
    folder = FOLDER / (f"{name}-sizes" if sizes else name)
    program, stamp = folder / "program", folder / "stamp"
    digest = hashlib.sha256(b"\0".join(sources)).hexdigest()
    if not stamp.exists() or stamp.read_text() != digest:
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        for key, text in texts.items():
            (folder / f"{key}.asn").write_text(text)
        _generate(asn1c, folder)
        _compile(folder, schema.messages[name].pdu.name.replace("-", "_"), program)
        stamp.write_text(digest)
    return program, help_


def _own_sources() -> tuple[Path, ...]:
    return SOURCE, SOURCE.with_name("times.h"), Path(__file__)


def _generate(asn1c: str, folder: Path) -> None:
    made = folder / "c"
    made.mkdir()
    modules = [str(path) for path in sorted(folder.glob("*.asn"))]
    for flags in FLAGS:
        ran = subprocess.run(
            [asn1c, *flags, *modules], cwd=made, capture_output=True, text=True, errors="replace", check=False
        )
        if ran.returncode != EX_USAGE:
            break
    if ran.returncode != 0:
        raise CannotError(f"cannot: {_reason(ran.stderr)}")


def _reason(said: str) -> str:
    """The line that matters, without the folder."""
    lines = [line for line in said.splitlines() if re.search(r"error|FATAL|clash|[Cc]annot", line)]
    return (lines or said.splitlines() or ["no reason given"])[0].replace(f"{FOLDER}/", "")[:160]


def _compile(folder: Path, pdu: str, program: Path) -> None:
    made = folder / "c"
    sources = [path for path in sorted(made.glob("*.c")) if path.name not in MAINS]

    def compiled(part: list[Path]) -> None:
        _cc(made, "-c", "-I.", *(path.name for path in part))

    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        list(pool.map(compiled, [sources[at : at + 16] for at in range(0, len(sources), 16)]))
    objects = [path.with_suffix(".o").name for path in sources]
    _cc(made, f"-DPDU={pdu}", "-I.", f"-I{SOURCE.parent}", str(SOURCE), *objects, "-lm", "-o", str(program))


def _cc(folder: Path, *arguments: str) -> None:
    ran = subprocess.run([*COMPILE, *arguments], cwd=folder, capture_output=True, text=True, check=False)
    if ran.returncode != 0:
        raise CannotError(f"cannot: its C does not compile: {_reason(ran.stderr)}")
