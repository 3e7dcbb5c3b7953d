"""Checks of our files by the tools of other card builders, from checkouts of their repositories."""

import json
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import jsonschema
import yaml

from image import checksum, manifest
from image.project import PROJECT, epoch, version

FOLDER = PROJECT / "image/conventions"
LAYER = FOLDER / "rpi-image-gen/layer/captain.yaml"
CONFIG = FOLDER / "rpi-image-gen/config/captain.yaml"
STAGE = FOLDER / "pi-gen/stage-captain"
PACKAGES = ("captain_1_arm64.deb", "captain-box_1_all.deb")
# pi-gen's runner of stages, with a chroot that is written down, and without mounts.
RUNNER = r"""
set -ea
eval "$(sed -n '/^run_sub_stage *()/,/^}/p; /^run_stage *()/,/^}/p' "$SCRIPT_DIR/../build.sh")"
log() { :; }
unmount() { :; }
on_chroot() { cat >>"$CALLS"; }
copy_previous() { cp -a "$PREV_ROOTFS_DIR" "$ROOTFS_DIR"; }
run_stage
echo "exported:$EXPORT_DIRS" >>"$CALLS"
"""


class Row(NamedTuple):
    """Result of a check. trouble: None if it was not made; note: why, or what was checked."""

    check: str
    trouble: str | None
    note: str = ""

    def __str__(self) -> str:
        head = "not made" if self.trouble is None else "FAILED" if self.trouble else "ok"
        return f"{head:8}  {self.check}: {self.trouble or self.note}"


def rows(mirrors: Path | None) -> Iterator[Row]:
    """Yield a row per check. mirrors: folder of the checkouts rpi-imager, rpi-image-gen and pi-gen; some may lack."""
    for name, check, run in (
        ("rpi-imager", "the manifest by rpi-imager's schema", imager),
        ("rpi-image-gen", "the layer by rpi-image-gen's lint", lint),
        ("rpi-image-gen", "the layers and files that layer and configuration name", names),
        ("pi-gen", "the stage by pi-gen's runner", stage),
    ):
        if mirrors is None or not (mirrors / name).is_dir():
            yield Row(check, None, f"no checkout {name}; MIRRORS=DIR names its folder")
        else:
            yield run(check, mirrors / name)


def imager(check: str, mirror: Path) -> Row:
    """Validate the manifest of a small card."""
    schema = json.loads((mirror / "doc/json-schema/os-list-schema.json").read_text())
    with tempfile.TemporaryDirectory() as name:
        card = Path(name) / "card.img"
        card.write_bytes(b"card")
        made = json.loads(manifest.text(card, checksum.sha256(card), card, version(), epoch()))
    errors = [error.message for error in jsonschema.Draft7Validator(schema).iter_errors(made)]
    return Row(check, "; ".join(errors), "doc/json-schema/os-list-schema.json")


def lint(check: str, mirror: Path) -> Row:
    """Run rpi-image-gen's own lint of metadata, with the system's Python, which has its modules."""
    missing = subprocess.run(["python3", "-c", "import debian, yaml"], capture_output=True, check=False)
    if missing.returncode:
        return Row(check, None, "it needs Debian's packages python3-debian and python3-yaml")
    words = ["python3", str(mirror / "bin/ig"), "metadata", "--lint", str(LAYER)]
    ended = subprocess.run(words, capture_output=True, text=True, check=False)
    return Row(check, "" if ended.returncode == 0 else (ended.stdout + ended.stderr).strip(), "ig metadata --lint")


def names(check: str, mirror: Path) -> Row:
    """Look for the required layers, and for the configuration that ours includes."""
    config = yaml.safe_load(CONFIG.read_text())
    required = [*metadata(LAYER)["X-Env-Layer-Requires"].split(","), config["device"]["layer"]]
    there = {metadata(path).get("X-Env-Layer-Name") for path in mirror.rglob("*.yaml")}
    missing = [layer for layer in required if layer not in there]
    if not (mirror / "config" / config["include"]["file"]).is_file():
        missing.append(f"config/{config['include']['file']}")
    return Row(check, f"missing: {', '.join(missing)}" if missing else "", ", ".join(required))


def stage(check: str, mirror: Path) -> Row:
    """Run the stage by pi-gen's run_stage(), and compare what it would do in the card's root."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        calls, trouble = run_stage(mirror, folder)
        copied = sorted(path.name for path in (folder / "work/stage-captain/rootfs/var/cache/captain").glob("*"))
    wanted = [
        r"apt-get .*install .*chrony",
        r"apt-get install .*captain/\*\.deb",
        r"captain box setup --write",
        "exported:.*captain",
    ]
    found = iter(calls)
    missing = [pattern for pattern in wanted if not any(re.search(pattern, line) for line in found)]
    if missing:
        trouble = trouble or f"without, or in another order: {missing}: {calls}"
    elif copied != sorted(PACKAGES):
        trouble = f"the root has the packages {copied}"
    return Row(check, trouble, "run_stage() of build.sh")


def run_stage(mirror: Path, folder: Path) -> tuple[list[str], str]:
    """Run a copy of the stage with packages. Returns lines for the chroot, and the error."""
    copy = folder / STAGE.name
    shutil.copytree(STAGE, copy)
    (copy / "00-captain/files").mkdir()
    for name in PACKAGES:
        (copy / "00-captain/files" / name).touch()
    (folder / "work/stage2/rootfs/var").mkdir(parents=True)
    (folder / "calls").touch()
    environment = {
        "SCRIPT_DIR": mirror / "scripts", "WORK_DIR": folder / "work", "STAGE_DIR": copy, "CALLS": folder / "calls",
        "PREV_ROOTFS_DIR": folder / "work/stage2/rootfs", "BASE_DIR": folder, "CLEAN": 0, "EXPORT_DIRS": "",
    }  # fmt: skip
    (folder / "work/stage-captain").mkdir()
    words = {**os.environ, **{key: str(value) for key, value in environment.items()}}
    ended = subprocess.run(["bash", "-c", RUNNER], env=words, capture_output=True, text=True, check=False)
    return (folder / "calls").read_text().splitlines(), ended.stderr.strip() if ended.returncode else ""


def metadata(path: Path) -> dict[str, str]:
    """Return the X-Env fields in the comments of a layer; continued lines are joined."""
    found: dict[str, str] = {}
    name = ""
    for line in path.read_text(errors="replace").splitlines():
        if line == "# METAEND":
            break
        if match := re.fullmatch(r"# (X-Env-[\w-]+): *(.*)", line):
            name = match[1]
            found[name] = match[2]
        elif name and line.startswith("#  "):
            found[name] = f"{found[name]} {line[3:]}".strip()
    return found
