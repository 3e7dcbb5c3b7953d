"""OCI image of the station: files of its root, and those of the two stations and the broker."""

import os
import re
from pathlib import Path

import pytest
import yaml

from firmware.config import captain_toml
from image.program import container

EPOCH = 1_750_000_000
SERVICES = yaml.safe_load((container.FILES / "compose.yaml").read_text())["services"]


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Root of two authorities, completed by a user without rights."""
    monkeypatch.setattr(os, "chown", lambda path, user, group: (Path(path) / "owner").write_text(f"{user}:{group}"))
    for name in ("first", "second"):
        path = tmp_path / f"usr/share/ca-certificates/mozilla/{name}.crt"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{name}\n")
    for folder in ("tmp", "build/site", "usr/share/man/man1"):
        (tmp_path / folder).mkdir(parents=True)
    container.complete(tmp_path, EPOCH)
    return tmp_path


def test_root_has_authorities_where_the_stations_openssl_looks(root: Path):
    assert (root / "etc/ssl/certs/ca-certificates.crt").read_text() == "first\nsecond\n"
    assert str((root / "usr/lib/ssl/cert.pem").readlink()) == "/etc/ssl/certs/ca-certificates.crt"


def test_root_has_folders_of_the_stations_user_and_no_other_login(root: Path):
    for place in ("run/captain", "var/lib/captain"):
        assert (root / place / "owner").read_text() == f"{container.USER}:{container.USER}"
    rows = [line.split(":") for line in (root / "etc/passwd").read_text().splitlines()]
    assert {row[0]: row[2] for row in rows} == {"root": "0", "captain": str(container.USER)}
    assert all(row[6] == "/usr/sbin/nologin" for row in rows)


def test_root_has_one_date_and_no_work_folder_or_manual(root: Path):
    assert {path.lstat().st_mtime for path in root.rglob("*")} == {float(EPOCH)}
    assert not (root / "build").exists()
    assert not (root / "usr/share/man").exists()


@pytest.mark.parametrize("name", ["captain.toml", "station.toml"])
def test_configuration_is_valid_and_opens_the_ports(name: str):
    assert captain_toml.load(str(container.FILES / name)).tables.endpoint.address == "0.0.0.0"


def test_composed_stations_differ_in_name_and_ports_only():
    a, b = SERVICES["a"], SERVICES["b"]
    own = {"hostname", "ports"}
    assert {key: a[key] for key in a.keys() - own} == {key: b[key] for key in b.keys() - own}
    assert a["ports"] == ["127.0.0.1:5555-5558:5555-5558"]
    assert b["ports"] == ["127.0.0.1:5565-5568:5555-5558"]


def test_composed_stations_have_the_images_user_files_and_check():
    station = SERVICES["a"]
    assert station["tmpfs"] == ["/tmp:mode=1777"]  # Podman takes neither uid nor gid
    files = [volume.split(":") for service in SERVICES.values() for volume in service["volumes"]]
    assert all((container.FILES / source).is_file() and mode == "ro" for source, _, mode in files)
    assert [place for _, place, _ in files[1:]] == [container.CONFIGURATION] * 2
    assert station["healthcheck"]["test"] == ["CMD", "captain", "status"]
    assert station["read_only"]
    assert station["cap_drop"] == ["ALL"]


def test_composed_stations_reach_the_broker_by_its_service():
    text = (container.FILES / "station.toml").read_text()
    (host,) = re.findall(r'url = "mqtt://(\w+):1883"', text)
    assert SERVICES[host]["volumes"] == ["./mosquitto.conf:/mosquitto/config/mosquitto.conf:ro"]
