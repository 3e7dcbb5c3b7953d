"""What a value of image.toml may be: kinds of words and numbers, each with what is said of one that it is not."""

import re
from typing import Annotated, Any, Literal

from image.reading import Check, show, within

# A look reads all of an image, and the data partition grows to its card: an image needs no more.
LARGEST_MIB = 32 * 1024
# A part of a path: neither empty nor . or ..
_PART = r"(?!\.{1,2}(?:/|\Z))[\w.+~@-]+"


def _form(pattern: str, what: str, remedy: str) -> Check:
    """A word that is all of this form."""
    form = re.compile(pattern, re.ASCII)
    return Check(lambda word: "" if form.fullmatch(word) else f"{show(word)} is no {what}; {remedy}")


def _each_once(values: tuple[Any, ...]) -> str:
    twice = [value for value in values if values.count(value) > 1]
    return f"{show(twice[0])} is there twice; name it once" if twice else ""


def _reason(word: str) -> str:
    if not word.strip():
        return "has no reason; say what it is for, or leave it out"
    return "" if word.isprintable() else f"{show(word)} has control characters; give a line of text"


def _names(packages: dict[str, str]) -> str:
    return next(filter(None, map(_PACKAGE.look, packages)), "")


# Source: Debian Policy 5.6.7. A last - or + is a verb of apt's, but for names such as g++.
_PACKAGE = _form(
    r"[a-z0-9][a-z0-9+.-]*[a-z0-9+]", "package's name", "give one as apt has it: lower-case letters, digits, + - ."
)
_EACH_ONCE = Check(_each_once)
_ONE_AT_LEAST = Check(lambda values: "" if values else "is empty; name one at least")

# The box's host name, and the first part of files' names. Source: RFC 1123, 2.1.
Name = Annotated[
    str, _form("[a-z]([a-z0-9-]{0,61}[a-z0-9])?", "host name", "give lower-case letters, digits and -, as captain")
]
Package = Annotated[str, _PACKAGE]
Packages = Annotated[dict[str, Annotated[str, Check(_reason)]], Check(_names)]
# Words of a line of apt's sources.list.
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
# Within "..." of U-Boot's script, which has replaced words like @THIS@ before. arm64's kernel takes 2048 octets, among
# which are those of the script and of the box's owner.
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
Gpio = Annotated[int, within(0, 27)]
# Source: BCM2711 ARM Peripherals, 2022-01-18, 5.3: blocks that have pins at the header.
I2c = Annotated[tuple[Literal[1, 3, 4, 5, 6], ...], _EACH_ONCE]
Uarts = Annotated[tuple[Literal[2, 3, 4, 5], ...], _EACH_ONCE]
Tty = Annotated[str, _form("tty[A-Z]+[0-9]{1,2}", "serial port's name", "give one as ttyS1, without /dev/")]
# Source: Linux, asm-generic/termbits.h, as far as a console is of use at them.
Baud = Literal[1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600]
Mib = Annotated[int, within(1, LARGEST_MIB)]
LabelId = Annotated[int, within(1, 0xFFFFFFFF)]
