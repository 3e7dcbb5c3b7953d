"""Bundles: contents and errors, in the words of RAUC 1.13."""

import json
import os
from pathlib import Path

import pytest

from board.runtime.errors import StationError
from firmware.update import bundle
from firmware.update.bundle import Box, Bundle
from firmware.update.verity import Tree

NAME = "https://example.org/update.raucb"  # where it came from, whose file lies elsewhere
SAID = """{
  "update" : {
    "version" : "1.2.3",
    "compatible" : "captain trixie quad",
    "build" : "2023-11-14T22:13:20Z"
  },
  "images" : [
    {
      "slot-class" : "rootfs",
      "filename" : "root.ext4",
      "checksum" : "046afc94659039f3394953438e122a1a1749390e361d55b9f79d62106f98f233",
      "size" : 4796416,
      "hooks" : []
    }
  ],
  "manifest-hash" : "4e4339bd9fe96e6a1c3da5ef379e374b2d9aae1e436d33ef9e343ee953dad7a7",
  "bundle" : {
    "format" : "verity",
    "verity-size" : 4096,
    "verity-salt" : "7f31dae5758cad7d8c9c4dddbf48e41ec71dbf53e088df4149311e5c9ce8f60b",
    "verity-hash" : "40de6a88d83a1dd46307bb64d106118f017fb2c90073cb7ceb1203fc0786d5df"
  },
  "meta" : {  }
}"""
LOG = """rauc-Message: 21:20:01.727: Using central status file /var/lib/rauc/status
rauc-Message: 21:20:01.737: Using system config file /etc/rauc/system.conf
rauc-Message: 21:20:01.737: Reading bundle: /root/a.raucb
rauc-Message: 21:20:01.866: Verifying bundle signature...\u0020
"""
GOOD = (
    LOG + "rauc-Message: 21:20:01.904: Verified inline signature by 'CN = captain development e99fc63e, O = captain'\n"
)
SPOILED = {
    "foreign": "signature verification failed: Verify error: self-signed certificate",
    "authority": "signature verification failed: Verify error: unable to get local issuer certificate",
    "changed": "signature verification failed: ECDSA digest_verify_final:\n"
    "807FC30455000000:error:1700009E:CMS routines:CMS_SignerInfo_verify:verification failure:../crypto/cms/cms_sd.c:1004:",
    "truncated": "Invalid bundle format: Signature size (7331548732159390065) exceeds bundle size",
    "short": "Invalid bundle format: Failed to seek to end of bundle: Error seeking in file: Invalid argument",
    "signer changed": "signature verification failed: error:1700008A:CMS routines::signer certificate not found",
    "attribute changed": "signature verification failed: error:170000A1:CMS routines::attribute error",
    "length changed": "signature verification failed: error:03000072:digital envelope routines::decode error",
    "its own length changed": "Invalid bundle format: Signature data is no valid CMS",
    "date": "signature verification failed: Verify error: certificate is not yet valid",
    "plain": "Bundle format 'plain' not allowed",
    "other": "something that nobody has seen before",
}
FOREIGN, DATE, CHANGED, TRUNCATED, FORM = range(5)  # of bundle.REASONS; OTHER: rauc's own words
OTHER = None
MEANT = {
    "foreign": FOREIGN,
    "authority": FOREIGN,
    "changed": CHANGED,
    "signer changed": CHANGED,
    "attribute changed": CHANGED,
    "length changed": CHANGED,
    "its own length changed": CHANGED,
    "truncated": TRUNCATED,
    "short": TRUNCATED,
    "date": DATE,
    "plain": FORM,
    "other": OTHER,
}


def rauc(folder: Path, out: str = "", log: str = "", status: int = 0) -> str:
    """A program that says what it is told to say."""
    (folder / "out").write_text(out)
    (folder / "log").write_text(log)
    path = folder / "rauc"
    path.write_text(f"#!/bin/sh\ncat {folder}/out; cat {folder}/log >&2; exit {status}\n")
    path.chmod(0o755)
    return str(path)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    found = tmp_path / "update.raucb"
    found.write_bytes(b"x" * 5000)
    return found


def test_bundle_with_a_good_signature_is_read_with_its_signer(tmp_path: Path, path: Path):
    found = bundle.read(path, NAME, rauc(tmp_path, SAID, GOOD))
    root, salt = (json.loads(SAID)["bundle"][key] for key in ("verity-hash", "verity-salt"))
    assert found == Bundle(
        NAME,
        5000,
        "1.2.3",
        "captain trixie quad",
        "2023-11-14T22:13:20Z",
        "CN = captain development e99fc63e, O = captain",
        Tree(4096, root, salt),
        4_796_416,
    )


@pytest.mark.parametrize("kind", SPOILED)
def test_bundle_that_is_spoiled_is_refused_for_its_kind_of_reason(tmp_path: Path, path: Path, kind: str):
    with pytest.raises(StationError) as told:
        bundle.read(path, NAME, rauc(tmp_path, "", LOG + SPOILED[kind] + "\n", 1))
    number = MEANT[kind]
    if number is None:
        assert SPOILED[kind] in told.value.message
        return
    _, words, hint = bundle.REASONS[number]
    assert told.value.message == f"{NAME}: {words.format(size=5000)}"
    assert told.value.hint == hint or SPOILED[kind] in told.value.hint


def test_bundle_of_another_signer_is_refused_with_the_one_that_the_box_takes(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(bundle, "box", lambda: Box("x", "a release image, which takes updates of O=Somebody"))
    assert "O=Somebody" in bundle.refusal(NAME, 5000, SPOILED["foreign"]).hint


def test_answer_of_another_form_is_told(tmp_path: Path, path: Path):
    for said in ("", "{", "{}", "[]", '{"update":{},"bundle":{}}', SAID.replace("4096", '"x"')):
        with pytest.raises(StationError, match=f"^{NAME}: "):
            bundle.read(path, NAME, rauc(tmp_path, said, GOOD))


def test_path_of_no_bundle_is_told_before_rauc_is_asked(tmp_path: Path):
    (tmp_path / "empty").touch()
    for name, said in (("none", "No such file"), ("empty", "empty"), (".", "Is a directory")):
        with pytest.raises(StationError, match=said):
            bundle.read(tmp_path / name, NAME, "/none/rauc")


def test_machine_without_rauc_is_told(path: Path):
    with pytest.raises(StationError, match="rauc"):
        bundle.read(path, NAME, "/none/rauc")


def test_bundle_of_another_device_tree_is_refused_with_both_names(tmp_path: Path, path: Path):
    found = bundle.read(path, NAME, rauc(tmp_path, SAID, GOOD))
    bundle.fits(found, Box("captain trixie quad", ""))
    with pytest.raises(StationError, match=f"^{NAME}: .*'captain trixie quad'; .*'captain trixie pi'"):
        bundle.fits(found, Box("captain trixie pi", ""))


def test_box_is_read_with_the_signer_of_its_updates(tmp_path: Path):
    system, signer = tmp_path / "system.conf", tmp_path / "signer"
    system.write_text("[system]\ncompatible=captain trixie quad\n[handlers]\nx=%y\n")
    assert bundle.box(system, signer) == Box("captain trixie quad", "")
    signer.write_text("release O=Somebody,CN=updates\n")
    assert bundle.box(system, signer).takes == (
        "a release image, which accepts updates signed by O=Somebody,CN=updates"
    )


@pytest.mark.parametrize("text", [None, "", "[system]\n", "compatible=x", "[system\n"])
def test_machine_without_two_slots_is_told(tmp_path: Path, text: str | None):
    system = tmp_path / "system.conf"
    if text is not None:
        system.write_text(text)
    with pytest.raises(StationError, match=f"{system}"):
        bundle.box(system, tmp_path / "signer")


def test_path_of_a_pipe_is_refused_at_once(tmp_path: Path):
    os.mkfifo(tmp_path / "fifo")
    with pytest.raises(StationError, match=f"^{NAME}: "):
        bundle.read(tmp_path / "fifo", NAME)
