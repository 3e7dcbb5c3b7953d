"""A wheel of the Python module, for pip: the built module and its stubs (PEP 427, PEP 561)."""

import base64
import hashlib
import sysconfig
import zipfile
from pathlib import Path

from asn1.cpython.build import NAME

PYTHON = "cp310-abi3"  # as build_python(is_limited=True) makes it: CPython 3.10 and every later one
EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest that a zip file can say; no dates in what is generated


def write(folder: Path, version: str, module: Path, stub: str) -> Path:
    """<name>-<version>-<tag>.whl into a folder; the same input gives the same octets.

    module  the shared object, for the limited API
    stub    text of the .pyi
    """
    tag = f"{PYTHON}-{sysconfig.get_platform().replace('-', '_').replace('.', '_')}"
    about = f"{NAME}-{version}.dist-info"
    files = {
        module.name: module.read_bytes(),
        f"{NAME}-stubs/__init__.pyi": stub.encode(),
        f"{about}/METADATA": _lines(
            "Metadata-Version: 2.1", f"Name: {NAME}", f"Version: {version}", "Requires-Python: >=3.10",
            "Summary: ETSI ITS messages: encode, decode, validate, JSON, explain", "License: Apache-2.0",
        ),
        f"{about}/WHEEL": _lines(
            "Wheel-Version: 1.0", "Generator: captain-asn1", "Root-Is-Purelib: false", f"Tag: {tag}"
        ),
    }  # fmt: skip
    record = [f"{name},sha256={_digest(octets)},{len(octets)}" for name, octets in files.items()]
    files[f"{about}/RECORD"] = _lines(*record, f"{about}/RECORD,,")
    path = folder / f"{NAME}-{version}-{tag}.whl"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, octets in files.items():
            entry = zipfile.ZipInfo(name, EPOCH)
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, octets, zipfile.ZIP_DEFLATED)
    return path


def _lines(*lines: str) -> bytes:
    return "".join(f"{line}\n" for line in lines).encode()


def _digest(octets: bytes) -> str:
    """As RECORD wants it (PEP 376, 427): URL-safe base64 without padding."""
    return base64.urlsafe_b64encode(hashlib.sha256(octets).digest()).rstrip(b"=").decode()
