"""What the checks ask of the guest's kernel itself."""

import subprocess
from pathlib import Path

CONFIGFS = Path("/sys/kernel/config")


def load(module: str, **parameters: object) -> None:
    """Load a module; one that is there already stays."""
    run("modprobe", module, *(f"{name}={value}" for name, value in parameters.items()))


def run(*command: str) -> str:
    """What a program prints; one that fails fails the check, with what it said."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{' '.join(command)}: {done.stderr.strip() or done.stdout.strip()}"
    return done.stdout
