"""The profiles that ship, and those of users: TOML files."""

from pathlib import Path

from board.describe import load, read, remedy
from board.errors import ConfigurationError
from drivers.wire.v2n_description import ProfileDescription

FOLDER = Path(__file__).parent / "profiles"


def names() -> list[str]:
    """The profiles that ship."""
    return sorted(path.stem for path in FOLDER.glob("*.toml") if path.stem != "template")


def profile(name: str) -> ProfileDescription:
    """A profile by its name, or by the path of a TOML file. Raises ConfigurationError."""
    if "/" not in name and not name.endswith(".toml"):
        if name not in names():
            hint = f"{remedy(name, names())}; or give the path of a TOML file"
            raise ConfigurationError(f"profile {name!r} is none that ships", hint)
        path = FOLDER / f"{name}.toml"
    else:
        path = Path(name)
    return read(ProfileDescription, load(path), str(path))
