"""Layer and configuration for rpi-image-gen: metadata, variables, and what the hook does in the card's root."""

import os
import re
import subprocess
from pathlib import Path

import pytest
import yaml

from tests.image.conventions.mirrors import CONFIG, LAYER, PACKAGES, metadata

FIELDS = metadata(LAYER)
VARIABLES = {name.removeprefix("X-Env-Var-") for name in FIELDS if re.fullmatch(r"X-Env-Var-[a-z]+", name)}
HOOK = yaml.safe_load(LAYER.read_text())["mmdebstrap"]["customize-hooks"][0]
CHROOT = '#!/bin/sh\nshift\necho "$*" >>"$CALLS"\ncase "$*" in *"$FAILING"*) exit 1;; esac\n'


# Source: rpi-image-gen, site/metadata_parser.py: fields that its lint accepts; those of a variable with X-Env-VarPrefix.
OF_LAYERS = {
    "Name",
    "Desc",
    "Version",
    "Requires",
    "Conflicts",
    "Category",
    "Type",
    "Generator",
    "Provides",
    "RequiresProvider",
}
OF_VARIABLES = {"Desc", "Required", "Valid", "Set", "Anchor", "Conflicts", "Triggers"}


def test_fields_of_the_layer_are_those_that_lint_accepts():
    for field in FIELDS:
        kind, *rest = field.removeprefix("X-Env-").split("-")
        if kind == "Layer":
            assert rest[0] in OF_LAYERS
        elif kind == "Var":
            assert rest[0] in VARIABLES
            assert set(rest[1:]) <= OF_VARIABLES
        else:
            assert field == "X-Env-VarPrefix"


def test_default_of_the_generation_is_in_the_range_of_its_rule():
    low, high = map(int, FIELDS["X-Env-Var-pi-Valid"].removeprefix("int:").split("-"))
    assert low <= int(FIELDS["X-Env-Var-pi"]) <= high


def test_layer_has_the_metadata_that_a_build_needs():
    assert FIELDS["X-Env-Layer-Name"] == FIELDS["X-Env-VarPrefix"] == "captain"
    assert re.fullmatch(r"\d+\.\d+\.\d+", FIELDS["X-Env-Layer-Version"])
    for name in VARIABLES:
        assert all(FIELDS[f"X-Env-Var-{name}-{key}"] for key in ("Desc", "Required", "Valid", "Set"))


def test_hook_uses_the_declared_variables_and_no_others():
    assert set(re.findall(r"\$IGconf_captain_(\w+)", HOOK)) == VARIABLES
    assert "IGconf_" not in re.sub(r"\$IGconf_captain_\w+", "", HOOK)


def test_configuration_chooses_the_layer_and_sets_its_variables():
    config = yaml.safe_load(CONFIG.read_text())
    assert config["layer"]["app"] == FIELDS["X-Env-Layer-Name"]
    assert config["captain"].keys() == VARIABLES


@pytest.mark.parametrize(("failing", "count"), [("nothing", 2), ("apt-get", 1), ("captain box", 2)])
def test_hook_installs_then_sets_up_and_fails_with_either(tmp_path: Path, failing: str, count: int):
    root, debs, calls = tmp_path / "root", tmp_path / "debs", tmp_path / "calls"
    (root / "tmp").mkdir(parents=True)
    debs.mkdir()
    for name in PACKAGES:
        (debs / name).touch()
    program = tmp_path / "bin/chroot"
    program.parent.mkdir()
    program.write_text(CHROOT)
    program.chmod(0o755)
    environment = {
        "PATH": f"{program.parent}:{os.environ['PATH']}", "CALLS": str(calls), "FAILING": failing,
        "IGconf_captain_packages": str(debs), "IGconf_captain_board": "pi", "IGconf_captain_pi": "5",
    }  # fmt: skip
    ended = subprocess.run(["sh", "-c", HOOK, "hook", root], env=environment, check=False)
    wanted = [
        "sh -c apt-get install --yes /tmp/captain/*.deb chrony",
        "captain box setup --write --board pi --pi 5",
    ]
    assert calls.read_text().splitlines() == wanted[:count]
    assert (ended.returncode == 0) == (failing == "nothing")
    left = sorted(path.name for path in root.rglob("*.deb"))
    assert left == ([] if failing == "nothing" else sorted(PACKAGES))
