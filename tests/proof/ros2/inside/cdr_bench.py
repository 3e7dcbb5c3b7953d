"""Benchmark of UPER to CDR and back: ours, rclpy, asn1tools. JSON on stdout.

    cdr_bench.py FOLDER EDITION OCTETS,OCTETS... ROUNDS PEERS

FOLDER holds captain_messages. OCTETS is a message in hexadecimal; the first one that asn1tools reads as we do is taken, or
else the first. PEERS are the site-packages that hold asn1tools. Times are processor time of the thread in ns, medians of
ROUNDS that alternate. The peers get some of their work for nothing. The typed message is one compiled expression of
constructors and numbers, so reading a dict and choosing fields are not counted. On the way back the message is not read.
"""

import json
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from timeit import Timer
from typing import Any

ROOT = Path(__file__).resolve().parents[4]
sys.path[:0] = [sys.argv[1], str(ROOT)]
sys.path.append(sys.argv[5])

import asn1tools
import captain_messages
import numpy

from asn1.backends.ros2 import profiles
from asn1.model.text import load_schema
from tests.asn1.backends.ros2.cdr_reference import Reference
from tests.asn1.oracles import texts
from tests.asn1.reach import pruned

PROFILE = "etsi_its"
REPETITION_S = 0.01


class Bench:
    def __init__(self, edition: str, candidates: list[bytes]) -> None:
        self.schema = load_schema()
        self.message = captain_messages.find(edition)
        self.pdu = self.schema.messages[edition].pdu
        self.specification = asn1tools.compile_string(texts(pruned(self.schema, self.pdu), "asn1tools"), "uper")
        octets = self.octets = next(filter(self._is_read, candidates), candidates[0])
        [self.package] = profiles.packages(self.schema, [self.schema.messages[edition]], PROFILE)
        self.reference = Reference(self.schema, self.package)
        self.top = self.package.top(edition)
        self.value = self.message.decode(octets)
        self.object = self.reference.object(self.top, self.top.definition.type, self.value)
        self.cdr, self.left_out = self.message.to_cdr(octets)
        self.type = self.reference.type_of(self.top.name)
        self.without: dict[str, str] = {}  # peers, and why they have no figures

    def _is_read(self, octets: bytes) -> bool:
        """asn1tools has other shapes for some values, but the octets that it writes of them are the same."""
        try:
            name = self.pdu.name
            return bool(self.specification.encode(name, self.specification.decode(name, octets)) == octets)
        except Exception:  # noqa: BLE001 - whatever it raises: it does not read them
            return False

    def timers(self) -> dict[str, Timer]:
        made = {
            "ours_to": _timer("f(octets)", f=self.message.to_cdr, octets=self.octets),
            # With the message that it was where something of that had to stay beside: DENM of a real station is such a one.
            "ours_from": _timer(
                "f(cdr, None, original)",
                f=self.message.from_cdr,
                cdr=self.cdr,
                original=self.octets if self.left_out else None,
            ),
        }
        for name, add in (("rclpy", self.rclpy), ("asn1tools", self.asn1tools)):
            try:
                made |= add()
            except Exception as error:  # noqa: BLE001 - a peer that is not there, or cannot, has no figures
                self.without[name] = " ".join(f"{type(error).__name__}: {error}".split())[:160]
        return made

    def rclpy(self) -> dict[str, Timer]:
        import importlib

        from rclpy.serialization import deserialize_message, serialize_message

        module = importlib.import_module(f"{self.package.name}.msg")
        text = _expression(self.object, lambda name: f"m.{name}", numpy_arrays=False)
        build = eval(f"lambda: {text}", {"m": module})
        top = getattr(module, self.top.name)
        # Octets of padding are what the writer's memory held, so that messages are compared and not CDR.
        for made in (build(), deserialize_message(self.cdr, top)):
            if self.message.from_cdr(bytes(serialize_message(made)), original=self.octets) != self.octets:
                raise ValueError("rclpy says another message")
        return {
            "rclpy_build": _timer("build()", build=build),
            "rclpy_to": _timer("f(build())", f=serialize_message, build=build),
            "rclpy_from": _timer("f(cdr, top)", f=deserialize_message, cdr=self.cdr, top=top),
        }

    def asn1tools(self) -> dict[str, Timer]:
        specification, pdu = self.specification, self.pdu
        value = specification.decode(pdu.name, self.octets)
        specification.encode(pdu.name, value)
        types = {f"t{k}": type_ for k, type_ in enumerate(self.reference.store.types.values())}
        names = {type_: name for name, type_ in types.items()}
        text = _expression(self.object, lambda name: name, True, lambda one: names[type(one)])
        build = eval(f"lambda: {text}", {**types, "array": numpy.array})
        store = self.reference.store
        if bytes(store.serialize_cdr(build(), self.type)) != self.cdr:
            raise ValueError("serialised otherwise")
        names_of = {
            "decode": specification.decode, "encode": specification.encode, "write": store.serialize_cdr,
            "read": store.deserialize_cdr, "build": build, "pdu": pdu.name, "type_": self.type, "value": value,
            "octets": self.octets, "cdr": self.cdr,
        }  # fmt: skip
        return {
            "asn1tools_to": _timer("decode(pdu, octets); write(build(), type_)", **names_of),
            "asn1tools_from": _timer("read(cdr, type_); encode(pdu, value)", **names_of),
        }


def _expression(
    value: Any, named: Callable[[str], str], numpy_arrays: bool, class_of: Callable[[Any], str] | None = None
) -> str:
    """Constructors and constants that make a message again."""
    if isinstance(value, numpy.ndarray):
        return f"array({value.tolist()}, dtype={value.dtype.name!r})" if numpy_arrays else repr(value.tolist())
    if isinstance(value, list):
        return f"[{', '.join(_expression(one, named, numpy_arrays, class_of) for one in value)}]"
    if isinstance(value, bool | int | str):
        return repr(value)
    name = class_of(value) if class_of else named(type(value).__name__.rpartition("__")[2])
    fields = vars(value) if hasattr(value, "__dict__") else {one: getattr(value, one) for one in value.__slots__}
    words = (
        f"{key}={_expression(one, named, numpy_arrays, class_of)}"
        for key, one in fields.items()
        if not key.startswith("__")
    )
    return f"{name}({', '.join(words)})"


def _timer(statement: str, **names: Any) -> Timer:
    return Timer(statement, "import gc; gc.enable()", timer=time.thread_time, globals=names)


def _time_ns(timer: Timer) -> float:
    loops = 1
    while (taken := timer.timeit(loops)) < REPETITION_S:
        loops *= 2
    return taken / loops * 1e9


def main(edition: str, octets: str, rounds: int) -> dict[str, Any]:
    bench = Bench(edition, [bytes.fromhex(one) for one in octets.split(",")])
    times: dict[str, list[float]] = {}
    timers = bench.timers()
    for _ in range(rounds):
        for name, timer in timers.items():
            times.setdefault(name, []).append(_time_ns(timer))
    return {
        "octets": len(bench.octets),
        "cdr": len(bench.cdr),
        "without": bench.without,
        **{name: statistics.median(taken) for name, taken in times.items()},
    }


if __name__ == "__main__":
    print(json.dumps(main(sys.argv[2], sys.argv[3], int(sys.argv[4]))))
