"""What is looked at in an update: would the card that was made with it take it?"""

import tempfile
from collections.abc import Iterator
from pathlib import Path

from image.description import Description
from image.errors import ImageError
from image.program import run


def checks(described: Description, version: str, bundle: Path, keyring: bytes) -> Iterator[tuple[str, str]]:
    """Each check with its trouble, which is empty where it is well. keyring: what the card trusts."""
    with tempfile.TemporaryDirectory() as name:
        trusted = Path(name) / "keyring.pem"
        trusted.write_bytes(keyring)
        try:
            said = run(["rauc", "info", "--output-format=shell", f"--keyring={trusted}", bundle])
        except ImageError as error:
            yield "the update is signed for the card", str(error)
            return
    yield "the update is signed for the card", ""
    found = {key: value.strip("'") for key, _, value in (line.partition("=") for line in said.splitlines())}
    wanted = {"MF_COMPATIBLE": described.compatible, "MF_VERSION": version, "IMAGE_CLASS_0": "rootfs"}
    other = [f"{key} is {found.get(f'RAUC_{key}')!r}, not {value!r}" for key, value in wanted.items()
             if found.get(f"RAUC_{key}") != value]  # fmt: skip
    yield "the update says what it is", "; ".join(other)
