"""A password file as editors leave it."""

from pathlib import Path

import pytest

from board.errors import InterfaceError
from drivers import mqtt_credentials
from drivers.mqtt_options import MqttOptions


def read(tmp_path: Path, octets: bytes) -> bytes:
    path = tmp_path / "password"
    path.write_bytes(octets)
    path.chmod(0o600)
    options = MqttOptions(url="mqtt://localhost", username="me", password_file=str(path))
    return mqtt_credentials.password(options)


@pytest.mark.parametrize("octets", [b"secret", b"secret\n", b"secret\r\nmore\r\n", b"\xef\xbb\xbfsecret\n"])
def test_its_first_line_is_the_password(tmp_path: Path, octets: bytes):
    assert read(tmp_path, octets) == b"secret"


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be"])
def test_utf_16_is_told(tmp_path: Path, encoding: str):
    octets = "\ufeffsecret\n".encode(encoding) if encoding == "utf-16-be" else "secret\n".encode(encoding)
    with pytest.raises(InterfaceError, match="is UTF-16"):
        read(tmp_path, octets)


@pytest.mark.parametrize("octets", [b"", b"\n", b"\xef\xbb\xbf\n"])
def test_an_empty_one_is_told(tmp_path: Path, octets: bytes):
    with pytest.raises(InterfaceError, match="no password"):
        read(tmp_path, octets)
