"""Other codecs, each over the schema's own ASN.1 text, behind one face: encode and decode in their shapes.

None of them is right everywhere: disagreements.py says where who is wrong, and by which clause.
"""

import contextlib
import copy
import hashlib
import importlib.util
import io
import os
import pickle
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any, Protocol

import asn1tools

from asn1.backends.asn import text as asn
from asn1.model import types as t
from tests.asn1.ranges import unfold
from tests.asn1.reach import components
from tests.asn1.reference import Encoder

CACHE = Path("build/tests/oracles")  # what compilers make of a text, by its hash: they take a second
Shape = Callable[[Any], Any]
Makers = dict[type, Callable[[t.Type, Shape], Shape]]


class Oracle(Protocol):
    """shape: a value of ours in theirs; there is none for what only a newer sender knows."""

    name: str

    def shape(self, value: Any) -> Any: ...
    def encode(self, shaped: Any) -> bytes: ...
    def decode(self, octets: bytes) -> Any: ...


class Asn1tools:
    name = "asn1tools"

    def __init__(self, schema: t.Schema, pdu: t.Reference) -> None:
        self._specification = asn1tools.compile_dict(_parsed(texts(schema, "asn1tools")), "uper")
        self._schema = schema
        self._reference = Encoder(schema)
        self._type = self._compiled(pdu)
        self.shape = shaper(schema, pdu, {t.OpenType: self._open, t.ObjectIdentifier: self._relative})

    def encode(self, shaped: Any) -> bytes:
        return bytes(self._type.encode(shaped))

    def decode(self, octets: bytes) -> Any:
        return self._type.decode(octets)

    def _compiled(self, reference: t.Reference) -> Any:
        module = self._schema.modules[reference.module]
        return self._specification.modules[module.name][reference.name]

    def _open(self, row: t.Type, shape: Shape) -> Shape:
        """An open type is its octets: it does not know object sets."""
        if isinstance(row, t.Reference):
            compiled = self._compiled(row)
            return lambda value: bytes(compiled.encode(shape(value))) or b"\0"  # X.691 11.1.3
        return lambda value: self._reference.encode(row, value)

    def _relative(self, type_: t.Type, _: Shape) -> Shape:
        """asn.py writes RELATIVE-OID as OCTET STRING."""
        if isinstance(type_, t.ObjectIdentifier) and type_.is_relative:
            return lambda value: self._reference.encode(type_, value)[1:]
        return _same


class Pycrate:
    """Raises ImportError where pycrate is not installed."""

    name = "pycrate"

    def __init__(self, schema: t.Schema, pdu: t.Reference) -> None:
        made = generated(texts(schema, "pycrate"))
        module = made.GLOBAL.MOD[schema.modules[pdu.module].name]
        self._type = module[pdu.name]
        makers = {t.OpenType: self._open, t.ObjectIdentifier: _arcs, t.BitString: _number, t.Null: _zero}
        self.shape = shaper(schema, pdu, makers, lambda octets: ("_unk_004", octets))

    def encode(self, shaped: Any) -> bytes:
        self._type.set_val(copy.deepcopy(shaped))  # it takes defaults out of what it is given
        return bytes(self._type.to_uper())

    def decode(self, octets: bytes) -> Any:
        self._type.from_uper(octets)
        return self._type.get_val()

    @staticmethod
    def _open(row: t.Type, shape: Shape) -> Shape:
        name = row.name if isinstance(row, t.Reference) else WORDS[type(row)]
        return lambda value: (name, shape(value))


WORDS = {t.Boolean: "BOOLEAN", t.Integer: "INTEGER", t.OctetString: "OCTET STRING", t.Null: "NULL"}


def texts(schema: t.Schema, dialect: asn.Dialect) -> str:
    """All modules; two of one name would hide each other."""
    names = [module.name for module in schema.modules.values()]
    assert len(names) == len(set(names)), names
    return "\n".join(asn.text(schema, module, dialect) for module in schema.modules.values())


def _same(value: Any) -> Any:
    return value


def shaper(schema: t.Schema, pdu: t.Reference, makers: Makers, unknown: Shape = _same) -> Shape:
    """makers: the shape of a type from that of what it holds; unknown: of an open type of which no row tells the type."""
    return _Shaper(schema, makers, unknown).shape(pdu)


def _number(type_: t.Type, _: Shape) -> Shape:
    return lambda value: (int.from_bytes(value[0], "big") >> (8 * len(value[0]) - value[1]), value[1])


def _zero(type_: t.Type, _: Shape) -> Shape:
    return lambda value: 0


def _arcs(type_: t.Type, _: Shape) -> Shape:
    return lambda value: tuple(map(int, value.split(".")))


class _Shaper:
    """Shapes of one codec; `_same` where nothing changes, so that most of a value is not touched."""

    def __init__(self, schema: t.Schema, makers: Makers, unknown: Shape) -> None:
        self._schema = schema
        self._makers = makers
        self._unknown = unknown
        self._known: dict[tuple[str, str], Shape] = {}

    def shape(self, type_: t.Type) -> Shape:
        base, _ = unfold(self._schema, type_)
        if not isinstance(type_, t.Reference):
            return self._build(base)
        key = (type_.module, type_.name)
        if key not in self._known:
            self._known[key] = self._later(key)
            self._known[key] = self._build(base)
        return self._known[key]

    def _later(self, key: tuple[str, str]) -> Shape:
        """For a type that recurs, while it is built."""

        def shape(value: Any) -> Any:
            return self._known[key](value)

        return shape

    def _build(self, type_: t.Type) -> Shape:
        match type_:
            case t.Sequence():
                return self._sequence(type_)
            case t.Choice():
                shapes = {one.name: self.shape(one.type) for one in components(type_)}
                if all(shape is _same for shape in shapes.values()):
                    return _same
                return lambda value: (value[0], shapes[value[0]](value[1]))
            case t.SequenceOf():
                element = self.shape(type_.element)
                return _same if element is _same else lambda value: [element(one) for one in value]
        make = self._makers.get(type(type_))
        return make(type_, _same) if make else _same

    def _sequence(self, type_: t.Sequence) -> Shape:
        shapes = {one.name: self.shape(one.type) for one in components(type_) if not isinstance(one.type, t.OpenType)}
        opens = {one.name: self._open(one.type) for one in components(type_) if isinstance(one.type, t.OpenType)}
        changed = {name: shape for name, shape in shapes.items() if shape is not _same}
        if not changed and not opens:
            return _same

        def shape(value: dict[str, Any]) -> dict[str, Any]:
            shaped = dict(value)
            for name, one in changed.items():
                if name in shaped:
                    shaped[name] = one(shaped[name])
            for name, (selector, rows) in opens.items():
                shaped[name] = rows.get(value[selector], self._unknown)(value[name])
            return shaped

        return shape

    def _open(self, type_: t.OpenType) -> tuple[str, dict[Any, Shape]]:
        rows = self._schema.modules[type_.set_.module].sets[type_.set_.name].rows
        make = self._makers[t.OpenType]
        return type_.selector, {row.value: make(row.type, self.shape(row.type)) for row in rows}


def _parsed(text: str) -> Any:
    def parse(path: Path) -> None:
        path.write_bytes(pickle.dumps(asn1tools.parse_string(text)))

    return pickle.loads(_cached(text, "asn1tools", "pickle", parse).read_bytes())


def generated(text: str) -> Any:
    """The Python that pycrate makes of a text, imported."""
    path = _cached(text, "pycrate", "py", lambda path: _generate(text, path))
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    with contextlib.redirect_stdout(io.StringIO()):
        spec.loader.exec_module(module)
    return module


def _generate(text: str, path: Path) -> None:
    from pycrate_asn1c import asnproc, setobj

    setobj.ASN1Set._init = _patched(setobj, setobj.ASN1Set._init)
    with contextlib.redirect_stdout(io.StringIO()):
        asnproc.GLOBAL.clear()
        asnproc.compile_text(text)
        asnproc.generate_modules(asnproc.PycrateGenerator, str(path))
        asnproc.GLOBAL.clear()


def _cached(text: str, compiler: str, kind: str, make: Callable[[Path], None]) -> Path:
    """Complete or not there: another process may make the same."""
    digest = hashlib.sha256(f"{version(compiler)} {text}".encode()).hexdigest()
    path = CACHE / f"{compiler}_{digest[:20]}.{kind}"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished = path.with_suffix(f".{os.getpid()}")
        make(unfinished)
        unfinished.rename(path)
    return path


def _patched(setobj: Any, init: Callable[[Any], None]) -> Callable[[Any], None]:
    """pycrate 0.8.1 puts ranges of extensions among the single values, and then fails to sort them."""
    if init.__name__ == "sorted_init":
        return init

    def sorted_init(self: Any) -> None:
        ranges = [one for one in self._ev or () if isinstance(one, setobj.ASN1Range)]
        if ranges:
            self._er = setobj.reduce_rangelist(self._er + ranges)
            self._ev = [one for one in self._ev if not isinstance(one, setobj.ASN1Range)]
        init(self)

    return sorted_init
