"""Certificates, keys and passwords of files: each mistake names the file and what to do."""

import shutil
import ssl
import subprocess
from dataclasses import replace

import pytest

from board.runtime.errors import InterfaceError
from drivers.mqtt.client.credentials import context, password
from drivers.mqtt.client.settings import MqttSettings
from tests.broker.fixtures import certificates
from tests.drivers.mqtt.station import written

__all__ = ["certificates"]


@pytest.fixture
def settings(certificates) -> MqttSettings:
    certificate, key = certificates.client
    return MqttSettings(
        "mqtts://a",
        ca=str(certificates.authority.certificate),
        certificate=str(certificate),
        key=str(key),
        username="me",
        password_file="absent",
    )


def trouble(of, settings: MqttSettings) -> str:
    with pytest.raises(InterfaceError) as raised:
        of(settings)
    assert raised.value.hint
    return str(raised.value)


def test_tls_is_of_version_1_2_at_least_and_checks_the_host(settings):
    made = context(settings)
    assert (made.minimum_version, made.check_hostname, made.verify_mode) == (
        ssl.TLSVersion.TLSv1_2,
        True,
        ssl.CERT_REQUIRED,
    )
    assert len(made.get_ca_certs()) == 1


def test_without_a_ca_the_authorities_of_the_system_are_known():
    made = context(MqttSettings("mqtts://a"))
    assert made.verify_mode is ssl.CERT_REQUIRED


@pytest.mark.parametrize("name", ["ca", "certificate", "key"])
def test_a_file_that_is_not_there_is_named(settings, tmp_path, name):
    words = trouble(context, replace(settings, **{name: str(tmp_path / "absent")}))
    assert words.startswith(f"{name} {tmp_path}/absent: No such file or directory")


def test_a_ca_without_a_certificate_is_named(settings, tmp_path):
    path = written(tmp_path / "ca", "no certificate")
    assert trouble(context, replace(settings, ca=path)).startswith(f"ca {path}: contains no certificate")


@pytest.mark.parametrize("name", ["certificate", "key"])
def test_a_certificate_or_key_that_is_none_is_named_and_the_other_is_not(settings, tmp_path, name):
    path = written(tmp_path / name, "nothing of the kind")
    words = trouble(context, replace(settings, **{name: path}))
    assert words.startswith(f"{name} {path}: contains no {name} in PEM form\n")
    assert "BEGIN" in words


@pytest.mark.parametrize(("name", "command"), [("ca", "x509"), ("certificate", "x509"), ("key", "pkey")])
def test_one_in_der_form_is_named_with_the_command_that_makes_the_other_form(settings, tmp_path, name, command):
    path, pem = tmp_path / "a.der", tmp_path / "a.pem"
    plain = ["openssl", command, "-in", getattr(settings, name), "-outform", "DER", "-out", str(path)]
    subprocess.run(plain, check=True, capture_output=True)
    path.chmod(0o600)
    words = trouble(context, replace(settings, **{name: str(path)}))
    remedy = f"openssl {command} -inform DER -in {path} -out {pem}"
    assert words.startswith(f"{name} {path}: is in DER form\n")
    assert remedy in words
    subprocess.run(remedy.split(), check=True, capture_output=True)
    pem.chmod(0o600)
    assert context(replace(settings, **{name: str(pem)}))


def test_a_certificate_that_tls_does_not_take_is_named_with_the_reason(settings, tmp_path):
    key, certificate = tmp_path / "short.key", tmp_path / "short.pem"
    made = f"openssl req -x509 -newkey rsa:512 -nodes -subj /CN=short -keyout {key} -out {certificate}"
    subprocess.run(made.split(), check=True, capture_output=True)
    key.chmod(0o600)
    words = trouble(context, replace(settings, certificate=str(certificate), key=str(key)))
    assert words.startswith(f"certificate {certificate}: this machine's TLS library refuses it: ee key too small\n")


def test_the_key_of_another_certificate_is_named(settings, certificates):
    words = trouble(context, replace(settings, key=str(certificates.observer.key)))
    assert f"key {certificates.observer.key}: is not the key of certificate" in words


@pytest.mark.parametrize("kind", ["ec -pkeyopt ec_paramgen_curve:P-256", "rsa:2048"])
def test_a_key_of_another_algorithm_is_named(settings, tmp_path, kind):
    key, certificate = tmp_path / "a.key", tmp_path / "a.pem"
    made = f"openssl req -x509 -newkey {kind} -nodes -subj /CN=a -keyout {key} -out {certificate}"
    subprocess.run(made.split(), check=True, capture_output=True)
    other = tmp_path / "other.key"
    option = "-algorithm RSA" if kind.startswith("ec") else "-algorithm ed25519"
    subprocess.run(f"openssl genpkey {option} -out {other}".split(), check=True, capture_output=True)
    other.chmod(0o600)
    words = trouble(context, replace(settings, certificate=str(certificate), key=str(other)))
    assert words.startswith(f"key {other}: is not the key of certificate {certificate}\n")


@pytest.mark.parametrize("name", ["ca", "certificate", "key"])
@pytest.mark.parametrize("damage", ["half", "no end", "begin only", "another line", "begun again"])
def test_a_damaged_pem_file_is_named_as_damaged(settings, tmp_path, name, damage):
    with open(getattr(settings, name)) as file:
        lines = file.readlines()
    lines = lines[next(at for at, line in enumerate(lines) if line.startswith("-----BEGIN")) :]
    text = {
        "half": "".join(lines)[: len("".join(lines)) // 2],
        "no end": "".join(lines[:-1]),
        "begin only": lines[0],
        "another line": "".join([lines[0], "!" + lines[1][1:], *lines[2:]]),
        "begun again": "".join([*lines[:2], *lines]),
    }[damage]
    path = written(tmp_path / "damaged", text)
    words = trouble(context, replace(settings, **{name: path}))
    assert words == f"{name} {path}: is truncated or damaged\n  (copy it again)"


@pytest.mark.parametrize("name", ["ca", "certificate", "key"])
@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
def test_a_pem_file_in_utf_16_is_named(settings, tmp_path, name, encoding):
    path = tmp_path / "wide"
    with open(getattr(settings, name)) as file:
        path.write_bytes(file.read().encode(encoding))
    path.chmod(0o600)
    words = trouble(context, replace(settings, **{name: str(path)}))
    assert words == f"{name} {path}: is UTF-16\n  (save it as UTF-8)"


def test_a_certificate_request_is_no_damaged_certificate(settings, tmp_path):
    path = tmp_path / "a.csr"
    made = f"openssl req -new -key {settings.key} -subj /CN=a -out {path}"
    subprocess.run(made.split(), check=True, capture_output=True)
    words = trouble(context, replace(settings, certificate=str(path)))
    assert words.startswith(f"certificate {path}: contains no certificate in PEM form\n")


def test_certificate_and_key_that_are_exchanged_are_not_named_as_damaged(settings, tmp_path):
    path = tmp_path / "a.key"
    shutil.copy(settings.certificate, path)
    path.chmod(0o600)
    words = trouble(context, replace(settings, certificate=settings.key))
    assert words.startswith(f"certificate {settings.key}: contains no certificate in PEM form\n")
    words = trouble(context, replace(settings, key=str(path)))
    assert words.startswith(f"key {path}: contains no key in PEM form\n")


def test_an_encrypted_key_is_refused_and_nobody_is_asked_for_its_password(settings, tmp_path):
    path = tmp_path / "encrypted"
    command = ["openssl", "pkey", "-in", settings.key, "-aes128", "-passout", "pass:secret", "-out", str(path)]
    subprocess.run(command, check=True, capture_output=True)
    path.chmod(0o600)
    words = trouble(context, replace(settings, key=str(path)))
    assert words.startswith(f"key {path}: is encrypted\n")
    assert f"openssl pkey -in {path} -out" in words


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o666])
def test_a_key_and_a_password_that_others_may_read_are_refused(settings, tmp_path, mode):
    path = written(tmp_path / "secret", "word", mode)
    for of, name in ((context, "key"), (password, "password_file")):
        words = trouble(of, replace(settings, **{name: path}))
        assert f"{name} {path}: others may read it (mode {mode:04o})" in words
        assert f"chmod 600 {path}" in words


def test_a_password_is_the_first_line_as_it_is(settings, tmp_path):
    for text, expected in (("word", b"word"), ("word\nmore\n", b"word"), ("w ö\r\n", "w ö".encode()), (" x ", b" x ")):
        assert password(replace(settings, password_file=written(tmp_path / "p", text))) == expected


@pytest.mark.parametrize("text", ["", "\n", "\nword", "x" * 65536])
def test_a_file_without_a_password_is_named(settings, tmp_path, text):
    path = written(tmp_path / "p", text)
    assert f"password_file {path}: the first line is empty or too long" in trouble(
        password, replace(settings, password_file=path)
    )


def test_an_editors_mark_is_no_part_of_a_password(settings, tmp_path):
    path = written(tmp_path / "p", "\ufeffword\n")
    assert password(replace(settings, password_file=path)) == b"word"
    assert "is empty or too long" in trouble(
        password, replace(settings, password_file=written(tmp_path / "p", "\ufeff\n"))
    )


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_a_password_in_utf_16_is_named(settings, tmp_path, encoding):
    path = tmp_path / "p"
    path.write_bytes("\ufeffword\n".encode(encoding))
    path.chmod(0o600)
    assert "is UTF-16" in trouble(password, replace(settings, password_file=str(path)))


def test_a_folder_is_no_password(settings, tmp_path):
    assert "not a regular file" in trouble(password, replace(settings, password_file=str(tmp_path)))
