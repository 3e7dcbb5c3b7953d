"""Modules that Debian's kernels lack, built for the kernel of a card: simulated GPIO lines, simulated chips at I2C.

Out of tree, from Debian's sources of that very version, by the cross compiler; kept in build/modules. gpio-sim needs
simulated interrupts, which Debian has not set either: their source is linked in.
"""

import shutil
from collections.abc import Sequence
from pathlib import Path

from image.description import Base
from image.packages import Archive
from image.step import Steps
from image.tool import run

MADE = Path(__file__).resolve().parents[3] / "build/modules"
CROSS = "aarch64-linux-gnu-"
NAMES = ("gpio-sim", "i2c-stub")
SOURCES = (
    "drivers/gpio/gpio-sim.c",
    "drivers/gpio/gpiolib.h",
    "kernel/irq/irq_sim.c",
    "drivers/i2c/i2c-stub.c",
)
# An option of a newer compiler than Debian 12's, and type information, which only pahole makes.
LEFT_OUT = ("CONFIG_CC_HAS_MIN_FUNCTION_ALIGNMENT=", "CONFIG_DEBUG_INFO_BTF_MODULES=")
KBUILD = "obj-m := gpio-sim.o i2c-stub.o\ngpio-sim-y := gpio-sim-alone.o irq_sim.o\n"


def built(base: Base, version: str) -> dict[str, Path]:
    """Files of the modules, by name.

    base     of the card: where its kernel comes from.
    version  of that, as `uname -r` says it: 6.12.107+deb13-arm64.

    Raises ImageError: Debian has this version no more, or it does not compile.
    """
    steps = Steps(MADE)
    try:
        folder = steps.made(version, [Path(__file__), str(base)], lambda target: _build(base, version, target))
    finally:
        steps.close()
    return {name: folder / f"{name}.ko" for name in NAMES}


def _build(base: Base, version: str, target: Path) -> None:
    headers, folder = target / "headers", target / "modules"
    package = _unpack_headers(base, version, headers)
    _unpack_sources(base, package, folder)
    tree = headers / f"usr/src/linux-headers-{version}"
    makefile = tree / "Makefile"  # names the common part by its path in a system of its own
    makefile.write_text(makefile.read_text().replace("include /usr/src/", f"include {headers}/usr/src/"))
    words = [f"M={folder}", "ARCH=arm64", f"CROSS_COMPILE={CROSS}", f"CC={CROSS}gcc", *LEFT_OUT, "modules"]
    run(["make", "-s", "-C", tree, *words])
    for name in NAMES:
        run([f"{CROSS}strip", "-g", "-o", target / f"{name}.ko", folder / f"{name}.ko"])
    shutil.rmtree(headers)
    shutil.rmtree(folder)


def _unpack_headers(base: Base, version: str, target: Path) -> str:
    """What a module is compiled with; returns the version of the package that the kernel is of."""
    release = version.removesuffix(f"-{base.architecture}")
    found = _unpack(base, base.architecture, [f"linux-headers-{version}", f"linux-headers-{release}-common"], target)
    here = run(["dpkg", "--print-architecture"]).strip()  # of programs that run on this machine
    _unpack(base, here, [f"linux-kbuild-{release}={found}", "libc6"], target)
    _use_its_library(target, next(target.glob("usr/lib/linux-kbuild-*/scripts/mod/modpost")))
    return found


def _use_its_library(root: Path, program: Path) -> None:
    """A program of another release wants that one's libc. This one only chooses the form of it for a processor."""
    loader = next(root.glob("usr/lib/*/ld-linux*.so.*"))
    itself = program.with_name(f"{program.name}.real-lsb-64")
    program.write_text(f'#!/bin/sh\nexec {loader} --library-path {loader.parent} {itself} "$@"\n')


def _unpack_sources(base: Base, package: str, target: Path) -> None:
    """The few files of the sources that are compiled, side by side."""
    name = f"linux-source-{'.'.join(package.split('.')[:2])}"
    whole = target.parent / "source"
    _unpack(base, base.architecture, [f"{name}={package}"], whole)
    target.mkdir()
    places = [f"{name}/{place}" for place in SOURCES]
    run(["tar", "-xJf", whole / f"usr/src/{name}.tar.xz", "-C", target, "--transform", "s,.*/,,", *places])
    shutil.rmtree(whole)
    interrupts = target / "irq_sim.c"  # irq_to_desc() is not for modules
    text = interrupts.read_text()
    interrupts.write_text(text.replace("irq_to_desc(irqnum)", "irq_data_to_desc(irq_get_irq_data(irqnum))"))
    (target / "gpio-sim.c").rename(target / "gpio-sim-alone.c")
    (target / "Kbuild").write_text(KBUILD)


def _unpack(base: Base, architecture: str, names: Sequence[str], target: Path) -> str:
    """Debian's packages; returns the version of the first."""
    folder = MADE / architecture
    archive = Archive(folder, base, architecture)
    archive.update()
    found = {package.name: package for package in archive.alone(names)}
    for package in found.values():
        run(["dpkg-deb", "-x", folder / "archives" / package.file, target])
    return found[names[0].partition("=")[0]].version
