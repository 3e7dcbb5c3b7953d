"""The kernel, its modules, the firmware and the boot loader: unpacked on the build machine, their scripts never run."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from image.errors import ImageError
from image.program import run


class Kernel:
    """The folder that these packages were unpacked into."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        versions = sorted(path.name for path in (folder / "usr/lib/modules").glob("*"))
        if len(versions) != 1:
            raise ImageError(f"kernel.package: has the modules of {versions or 'no kernel'}", "name one kernel")
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
        """Files of modules, in the order that they are loaded in; one that is part of the kernel has none.

        Raises ImageError: a module that there is not.
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
            raise ImageError(f"kernel.modules: {name}: there is no such module of {self.version}") from error


def unpack(packages: Iterable[Path], folder: Path) -> Kernel:
    """Packages as plain files, with the lists of modules that modprobe reads. Raises ImageError."""
    folder.mkdir(parents=True)
    for package in packages:
        run(["dpkg-deb", "-x", package, folder])
    (folder / "lib").symlink_to("usr/lib")
    kernel = Kernel(folder)
    run(["depmod", "-b", folder, kernel.version])
    return kernel
