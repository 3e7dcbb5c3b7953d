"""Checks by the tools of other card builders: missing checkouts, and tools that refuse our files."""

import json
from pathlib import Path

from tests.image.conventions.mirrors import Row, rows

RUNNER = """\
run_sub_stage() {
    pushd "$SUB_STAGE_DIR" >/dev/null
    on_chroot <<EOF
apt-get install -y $(cat 00-packages)
EOF
    SCRIPT
    popd >/dev/null
}
run_stage() {
    STAGE=${STAGE_DIR##*/}
    ROOTFS_DIR=$WORK_DIR/$STAGE/rootfs
    cd "$STAGE_DIR"
    ./prerun.sh
    EXPORT_DIRS="$STAGE_DIR"
    for SUB_STAGE_DIR in "$STAGE_DIR"/*/; do
        run_sub_stage
    done
}
"""


def found(mirrors: Path | None) -> dict[str, Row]:
    return {row.check.split(" by ")[0]: row for row in rows(mirrors)}


def mirror(folder: Path, path: str, text: str) -> None:
    (folder / path).parent.mkdir(parents=True, exist_ok=True)
    (folder / path).write_text(text)


def test_check_without_its_checkout_is_not_made_and_names_it(tmp_path: Path):
    for folder in (None, tmp_path):
        for row in rows(folder):
            assert row.trouble is None
            assert str(row).startswith("not made  ")
            assert "no checkout" in row.note


def test_manifest_that_the_schema_of_the_checkout_refuses_fails_with_the_reason(tmp_path: Path):
    path = "rpi-imager/doc/json-schema/os-list-schema.json"
    for schema, said in (({"required": ["os_list"]}, ""), ({"required": ["moon"]}, "'moon' is a required property")):
        mirror(tmp_path, path, json.dumps(schema))
        assert found(tmp_path)["the manifest"].trouble == said


def test_stage_that_pi_gens_runner_does_not_run_fails(tmp_path: Path):
    for script, is_run in (("./01-run.sh", True), (":", False)):
        mirror(tmp_path, "pi-gen/build.sh", RUNNER.replace("SCRIPT", script))
        (tmp_path / "pi-gen/scripts").mkdir(exist_ok=True)
        trouble = found(tmp_path)["the stage"].trouble
        assert trouble is not None
        assert (trouble == "") is is_run


def test_layers_and_configurations_that_the_checkout_lacks_are_named(tmp_path: Path):
    check = "the layers and files that layer and configuration name"
    mirror(tmp_path, "rpi-image-gen/device/pi4.yaml", "# METABEGIN\n# X-Env-Layer-Name: rpi4\n# METAEND\n")
    row = found(tmp_path)[check]
    assert row.trouble == "missing: rpi-boot-firmware, config/trixie-minbase.yaml"
    mirror(tmp_path, "rpi-image-gen/layer/boot.yaml", "# METABEGIN\n# X-Env-Layer-Name: rpi-boot-firmware\n# METAEND\n")
    mirror(tmp_path, "rpi-image-gen/config/trixie-minbase.yaml", "")
    assert found(tmp_path)[check].trouble == ""
