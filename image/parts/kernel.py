"""Unpacks kernel, modules, firmware and boot loader; never runs their scripts."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from image.errors import ImageError
from image.tool import run


class Kernel:
    """Folder with the unpacked packages of kernel, firmware and boot loader.

    Raises ImageError if it has no kernel, or more than one.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        versions = sorted(path.name for path in (folder / "usr/lib/modules").glob("*"))
        if len(versions) != 1:
            raise ImageError(f"kernel.package: it has the modules of {versions or 'no kernel'}", "name one kernel")
        self.version = versions[0]

    @property
    def image(self) -> Path:
        return self.folder / f"boot/vmlinuz-{self.version}"

    @property
    def modules(self) -> Path:
        return self.folder / "usr/lib/modules"

    def device_tree(self, folder: str, name: str) -> Path:
        return self.folder / f"usr/lib/linux-image-{self.version}" / folder / name

    def with_dependencies(self, names: Sequence[str]) -> list[Path]:
        """Return the files of modules with their dependencies, in loading order; built-in modules have no file.

        Raises ImageError for an unknown module.
        """
        found: dict[Path, None] = {}
        for name in names:
            for line in self._depends(name).splitlines():
                verb, path, *_ = [*line.split(), ""]
                if verb == "insmod":
                    found[Path(path)] = None
        return list(found)

    def _depends(self, name: str) -> str:
        try:
            return run(["modprobe", "-d", self.folder, "-S", self.version, "--show-depends", name])
        except ImageError as error:
            raise ImageError(f"kernel.modules: {name}: not a module of {self.version}") from error


def unpack(packages: Iterable[Path], folder: Path) -> Kernel:
    """Unpack packages, and make the module lists for modprobe. Raises ImageError if a tool fails."""
    folder.mkdir(parents=True)
    for package in packages:
        run(["dpkg-deb", "-x", package, folder])
    (folder / "lib").symlink_to("usr/lib")
    kernel = Kernel(folder)
    run(["depmod", "-b", folder, kernel.version])
    return kernel
