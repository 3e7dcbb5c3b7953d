"""Value types of image.toml: words and numbers, each with its error."""

import re
from collections.abc import Sequence
from typing import Annotated, Literal

from board.runtime.describe import Check, Range
from board.runtime.errors import ConfigurationError
from board.runtime.toml import show

# Largest image in MiB: verification reads all of it, and the data partition grows on the card anyway.
LARGEST_MIB = 32 * 1024
# Part of a path: not empty, and neither . nor ..
_PART = r"(?!\.{1,2}(?:/|\Z))[\w.+~@-]+"


def _form(pattern: str, what: str, remedy: str) -> Check:
    """Return a check that a whole word matches a pattern."""
    form = re.compile(pattern, re.ASCII)

    def look(word: str) -> None:
        if not form.fullmatch(word):
            raise ConfigurationError(f"{show(word)} is an invalid {what}", remedy)

    return Check(look)


def _each_once(values: Sequence[object]) -> None:
    if twice := [value for value in values if values.count(value) > 1]:
        raise ConfigurationError(f"{show(twice[0])} is there twice", "name it once")


def _one_at_least(values: Sequence[object]) -> None:
    if not values:
        raise ConfigurationError("is empty", "name one at least")


def _reason(word: str) -> None:
    if not word.strip():
        raise ConfigurationError("has no reason", "say what it is for, or leave it out")
    if not word.isprintable():
        raise ConfigurationError(f"{show(word)} has control characters", "give a line of text")


def _names(packages: dict[str, str]) -> None:
    for name in packages:
        _PACKAGE.look(name)


# Source: Debian Policy 5.6.7. apt reads a final - or + as a command, except in names such as g++.
_PACKAGE = _form(
    r"[a-z0-9][a-z0-9+.-]*[a-z0-9+]", "package's name", "give one as apt has it: lower-case letters, digits, + - ."
)
_EACH_ONCE = Check(_each_once)
_ONE_AT_LEAST = Check(_one_at_least)

# Host name of the box, and beginning of the files' names. Source: RFC 1123, 2.1.
Name = Annotated[
    str, _form("[a-z]([a-z0-9-]{0,61}[a-z0-9])?", "host name", "give lower-case letters, digits and -, as captain")
]
Package = Annotated[str, _PACKAGE]
Packages = Annotated[dict[str, Annotated[str, Check(_reason)]], Check(_names)]
# Words in a line of apt's sources.list.
Suite = Annotated[str, _form("[a-z][a-z0-9.-]*(/[a-z0-9.-]+)?", "suite", "give one as trixie")]
Mends = Annotated[
    tuple[Annotated[str, _form("-[a-z0-9-]*[a-z0-9]", "end of a suite's name", "give one as -security")], ...],
    _EACH_ONCE,
]
Components = Annotated[
    tuple[Annotated[str, _form("[a-z0-9][a-z0-9+./-]*", "component", "give one as main")], ...],
    _EACH_ONCE,
    _ONE_AT_LEAST,
]
Site = Annotated[str, _form(r"[a-z+]+:/[\w.~:/%@+\[\]-]+", "address of an archive", "give one as http://HOST/debian")]
Keyring = Annotated[
    str, _form(f"(/{_PART})+", "path of a file", "give all of it, as /usr/share/keyrings/debian-archive-keyring.gpg")
]
Modules = Annotated[
    tuple[
        Annotated[str, _form(r"\w[\w-]*", "module's name", "give one as modprobe has it: letters, digits, - _")], ...
    ],
    _EACH_ONCE,
]
# Text between quotes in U-Boot's script, in which placeholders like @THIS@ were replaced before. The kernel of arm64
# accepts 2048 octets, which include the words of the script and of the box's owner.
CommandLine = Annotated[
    str,
    _form(
        r"(?!.*@[A-Z_]{3,}@)[\w .,:=/+%@*~-]{0,1024}",
        "command line",
        "give at most 1024 letters, digits, blanks and . , : = / + % @ * ~ - _; U-Boot's script would read others",
    ),
]
Path = Annotated[str, _form(f"{_PART}(/{_PART})*", "path in a package", "give one as usr/lib/raspi-firmware")]
Files = Annotated[
    tuple[Annotated[str, _form(r"\w([\w.+-]*\w)?", "file's name", "give it without a folder, as start4.elf")], ...],
    _EACH_ONCE,
    _ONE_AT_LEAST,
]
Trees = Annotated[
    tuple[Annotated[str, _form(r"\w[\w.+-]*\.dtb", "device tree's name", "give one as bcm2711-rpi-4-b.dtb")], ...],
    _EACH_ONCE,
    _ONE_AT_LEAST,
]
Board = Annotated[str, _form(r"\w[\w-]*", "board's name", "give one of board/boards, without .toml")]
Gpio = Annotated[int, Range(0, 27)]
# Source: BCM2711 ARM Peripherals, 2022-01-18, 5.3: blocks with pins on the header.
I2c = Annotated[tuple[Literal[1, 3, 4, 5, 6], ...], _EACH_ONCE]
Uarts = Annotated[tuple[Literal[2, 3, 4, 5], ...], _EACH_ONCE]
Tty = Annotated[str, _form("tty[A-Z]+[0-9]{1,2}", "serial port's name", "give one as ttyS1, without /dev/")]
# Source: Linux, asm-generic/termbits.h; the speeds that are useful for a console.
Baud = Literal[1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600]
Mib = Annotated[int, Range(1, LARGEST_MIB)]
LabelId = Annotated[int, Range(1, 0xFFFFFFFF)]
