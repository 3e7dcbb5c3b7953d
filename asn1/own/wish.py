"""Request for a user-defined message, with its checks."""

import re
from pathlib import Path
from typing import NamedTuple

from asn1.model.types import Schema

NAME = re.compile(r"[a-z][a-z0-9]*([.-][a-z0-9]+)*")
# prefix of the message's name, in the attribute that names the document for modules of standards
STANDARD = "experimental: "


class UserRequest(NamedTuple):
    """Request to add a message.

    file, others  file with the PDU; files with its imports, except those from standards.
    id            messageID.
    port          BTP port.
    versions      values of protocolVersion that announce it.
    replace       replace the message of this name.
    """

    file: Path
    pdu: str
    name: str
    id: int
    port: int
    versions: tuple[int, ...] = (1, 2)
    replace: bool = False
    others: tuple[Path, ...] = ()

    @property
    def files(self) -> tuple[Path, ...]:
        return (self.file, *self.others)


class WishError(ValueError):
    """Invalid request."""


def check(wish: UserRequest, schema: Schema, folder: Path) -> None:
    """Raise WishError for an invalid name, number or version."""
    wrong_name = no_name(wish.name, schema)
    if wrong_name:
        raise WishError(f"--name {wrong_name}")
    if not 0 <= wish.id <= 255:
        raise WishError(f"--id {wish.id}: out of range; a messageID is 0 to 255")
    if not 0 <= wish.port <= 65535:
        raise WishError(f"--port {wish.port}: out of range; a BTP port is 0 to 65535")
    wrong = [number for number in wish.versions if not 0 <= number <= 255]
    if wrong:
        raise WishError(f"--versions {wrong[0]}: out of range; a protocolVersion is 0 to 255")
    if not wish.replace and (folder / f"{wish.name}.toml").exists():
        raise WishError(
            f"--name {wish.name}: {folder / wish.name}.toml already exists; replace it with --replace, "
            f"or delete it with `captain-asn1 remove {wish.name}`"
        )


def no_name(name: str, schema: Schema) -> str | None:
    """Return why a user-defined message cannot have this name; None for a valid one."""
    if not NAME.fullmatch(name):
        return f"{name}: invalid name; use lower-case letters, digits, and hyphens between: my-msg"
    for message in schema.messages.values():
        if name in (message.name, message.type) and not message.is_experimental:
            return f"{name}: name already used by {message.standard}; choose another name"
    return None
