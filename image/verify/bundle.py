"""Verifies an update: the card of the same build must accept it."""

import tempfile
from collections.abc import Iterator
from pathlib import Path

from image.description import Description
from image.errors import ImageError
from image.tool import run


def checks(described: Description, version: str, bundle: Path, keyring: bytes) -> Iterator[tuple[str, str]]:
    """Yield each check with its trouble, which is empty if it passed. keyring: certificate that the card trusts."""
    with tempfile.TemporaryDirectory() as name:
        trusted = Path(name) / "keyring.pem"
        trusted.write_bytes(keyring)
        try:
            said = run(["rauc", "info", "--output-format=shell", f"--keyring={trusted}", bundle])
        except ImageError as error:
            yield "the card trusts the signature of the update", str(error)
            return
    yield "the card trusts the signature of the update", ""
    found = {key: value.strip("'") for key, _, value in (line.partition("=") for line in said.splitlines())}
    wanted = {"MF_COMPATIBLE": described.compatible, "MF_VERSION": version, "IMAGE_CLASS_0": "rootfs"}
    other = [f"{key} is {found.get(f'RAUC_{key}')!r}, not {value!r}" for key, value in wanted.items()
             if found.get(f"RAUC_{key}") != value]  # fmt: skip
    yield "the update says what it is", "; ".join(other)
