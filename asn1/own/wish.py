"""Wish of a user for a message, checked before files are read."""

import re
from pathlib import Path
from typing import NamedTuple

from asn1.types import Schema

NAME = re.compile(r"[a-z][a-z0-9]*([.-][a-z0-9]+)*")
STANDARD = "experimental: "  # in front of the message's name, where a module of a standard names its document


class Wish(NamedTuple):
    """What is asked for.

    file, others  where the PDU and what it imports is, but for what the standards have
    versions      protocolVersion values that announce it
    replace       a message of this name
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
    """A wish that cannot be granted as it stands."""


def check(wish: Wish, schema: Schema, folder: Path) -> None:
    """Raises WishError for a name, number or version that no message can have."""
    wrong_name = no_name(wish.name, schema)
    if wrong_name:
        raise WishError(f"--name {wrong_name}")
    if not 0 <= wish.id <= 255:
        raise WishError(f"--id {wish.id}: a messageID is one octet, 0 to 255")
    if not 0 <= wish.port <= 65535:
        raise WishError(f"--port {wish.port}: a BTP port is 0 to 65535")
    wrong = [number for number in wish.versions if not 0 <= number <= 255]
    if wrong:
        raise WishError(f"--versions {wrong[0]}: a protocolVersion is one octet, 0 to 255")
    if not wish.replace and (folder / f"{wish.name}.toml").exists():
        raise WishError(
            f"--name {wish.name}: {folder / wish.name}.toml is there already; --replace takes this one instead, "
            f"`captain-asn1 remove {wish.name}` takes it away"
        )


def no_name(name: str, schema: Schema) -> str | None:
    """Why a message of one's own cannot be called so."""
    if not NAME.fullmatch(name):
        return f"{name}: small letters and digits, with hyphens between: my-msg"
    for message in schema.messages.values():
        if name in (message.name, message.type) and not message.is_experimental:
            return f"{name}: {message.standard} is called so; choose another name"
    return None
