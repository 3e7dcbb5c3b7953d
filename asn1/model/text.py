"""Text of the schema: one file per module edition, one line per node, for readable diffs.

    module r1_cam CAM-PDU-Descriptions
    oid { itu-t(0) identified-organization(4) etsi(0) itsDomain(5) wg1(1) en(302637) cam(2) version(2) }
    standard ETSI EN 302 637-2 v1.4.1
    source EN302637-2v141-CAM.asn
    sha256 15c7...
    left-out Foo Bar

    type CamParameters: sequence
      basicContainer: BasicContainer
      lowFrequencyContainer: LowFrequencyContainer optional
      ...
    type GenerationDeltaTime: integer (0..65535) unit "ms"
      oneMilliSec = 1
    class REG-EXT-ID-AND-TYPE: &Type by &id RegionId
    set Reg-MapData of r1_dsrc.REG-EXT-ID-AND-TYPE
      3: r1_addgrpc.MapData-addGrpC
      ...

Writing and reading the text gives the same schema. `left-out` lists names that the standard defines and the schema
omits; errors about their import say so. The parts of a type are indented below it. A reference to another module has
that module's key as prefix.
"""

import errno
import os
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from asn1.model import types
from asn1.model.reader import TextError, load
from asn1.model.writer import dump

__all__ = ["EDITIONS", "FOLDER", "SCHEMA", "TextError", "dump", "load", "load_schema", "messages_of"]

FOLDER = Path(__file__).parents[1]
SCHEMA = FOLDER / "schema"
EDITIONS = FOLDER / "editions.toml"


def load_schema(folder: Path = SCHEMA, editions: Path = EDITIONS) -> types.Schema:
    """Load every module of a folder, and the messages whose modules it contains.

    editions  TOML file with messages; those of the folder's *.toml are added.

    Raises TextError for an invalid schema text, OSError if the folder does not exist.
    """
    if not folder.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(folder))
    loaded = [load(path.read_text(encoding="utf-8"), path.name) for path in sorted(folder.glob("*.schema"))]
    modules = {module.key: module for module in loaded}
    messages: dict[str, types.Message] = {}
    for path in [editions, *sorted(folder.glob("*.toml"))]:
        messages.update((one.name, one) for one in messages_of(tomllib.loads(path.read_text(encoding="utf-8"))))
    present = {name: one for name, one in messages.items() if one.pdu.module in modules}
    return types.Schema(modules, present)


def messages_of(document: dict[str, Any]) -> Iterator[types.Message]:
    """Yield the messages of a TOML document, from its [[message]] tables."""
    standards = {module["key"]: module["standard"] for module in document.get("module", [])}
    tables = {table["name"]: table for table in document.get("message", [])}
    for own in tables.values():
        table = tables.get(own.get("form_of", ""), {}) | own
        module, _, name = table["pdu"].partition(".")
        yield types.Message(
            name=table["name"],
            type=table["type"],
            release=table["release"],
            standard=table.get("standard") or standards[module],
            pdu=types.Reference(module=module, name=name),
            ids=tuple(table.get("ids", [])),
            versions=tuple(table.get("versions", [])),
            btp_port=table.get("btp_port", 0),
            rank=table.get("rank", 1),
            is_experimental=table.get("experimental", False),
            form_of=table.get("form_of", ""),
        )
