"""Certificates, keys and passwords of files: each mistake names the file and what to do."""

import errno
import os
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
from tests.said import tells

__all__ = ["certificates"]

# Key words of an error and its remedy: of a file without content of its kind, and of a password_file without a password.
FOREIGN = {
    "ca": ("no certificate", "PEM", "BEGIN CERTIFICATE"),
    "certificate": ("no certificate", "PEM", "BEGIN CERTIFICATE"),
    "key": ("no key", "PEM", "BEGIN PRIVATE KEY"),
}
NO_PASSWORD = "first line", "empty"


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
def test_file_that_is_absent_is_refused_by_its_option_and_path(settings, tmp_path, name):
    words = trouble(context, replace(settings, **{name: str(tmp_path / "absent")}))
    assert words.startswith(f"{name} {tmp_path}/absent: {os.strerror(errno.ENOENT)}")


def test_ca_without_a_certificate_is_refused_by_its_path(settings, tmp_path):
    path = written(tmp_path / "ca", "no certificate")
    assert tells(trouble(context, replace(settings, ca=path)), f"ca {path}: ", *FOREIGN["ca"])


@pytest.mark.parametrize("name", ["certificate", "key"])
def test_certificate_or_key_of_another_content_is_refused_and_the_other_is_not(settings, tmp_path, name):
    path = written(tmp_path / name, "nothing of the kind")
    words = trouble(context, replace(settings, **{name: path}))
    assert tells(words, f"{name} {path}: ", *FOREIGN[name])


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


def test_certificate_that_openssl_refuses_is_refused_with_its_reason(settings, tmp_path):
    key, certificate = tmp_path / "short.key", tmp_path / "short.pem"
    made = f"openssl req -x509 -newkey rsa:512 -nodes -subj /CN=short -keyout {key} -out {certificate}"
    subprocess.run(made.split(), check=True, capture_output=True)
    key.chmod(0o600)
    words = trouble(context, replace(settings, certificate=str(certificate), key=str(key)))
    assert tells(words, f"certificate {certificate}: ", "TLS library", ": ee key too small")


def test_key_of_another_certificate_is_refused_with_both_paths(settings, certificates):
    words = trouble(context, replace(settings, key=str(certificates.observer.key)))
    assert tells(words, f"key {certificates.observer.key}: ", "not the key", f"certificate {settings.certificate}")


@pytest.mark.parametrize("kind", ["ec -pkeyopt ec_paramgen_curve:P-256", "rsa:2048"])
def test_key_of_another_algorithm_is_refused_with_both_paths(settings, tmp_path, kind):
    key, certificate = tmp_path / "a.key", tmp_path / "a.pem"
    made = f"openssl req -x509 -newkey {kind} -nodes -subj /CN=a -keyout {key} -out {certificate}"
    subprocess.run(made.split(), check=True, capture_output=True)
    other = tmp_path / "other.key"
    option = "-algorithm RSA" if kind.startswith("ec") else "-algorithm ed25519"
    subprocess.run(f"openssl genpkey {option} -out {other}".split(), check=True, capture_output=True)
    other.chmod(0o600)
    words = trouble(context, replace(settings, certificate=str(certificate), key=str(other)))
    assert tells(words, f"key {other}: ", "not the key", f"certificate {certificate}")


@pytest.mark.parametrize("name", ["ca", "certificate", "key"])
@pytest.mark.parametrize("damage", ["half", "no end", "begin only", "another line", "begun again"])
def test_pem_file_that_is_damaged_is_refused_as_damaged(settings, tmp_path, name, damage):
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
    assert tells(words, f"{name} {path}: ", "damaged", "copy")


@pytest.mark.parametrize("name", ["ca", "certificate", "key"])
@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
def test_a_pem_file_in_utf_16_is_named(settings, tmp_path, name, encoding):
    path = tmp_path / "wide"
    with open(getattr(settings, name)) as file:
        path.write_bytes(file.read().encode(encoding))
    path.chmod(0o600)
    words = trouble(context, replace(settings, **{name: str(path)}))
    assert words == f"{name} {path}: is UTF-16\n  (save it as UTF-8)"


def test_certificate_request_is_refused_as_another_content(settings, tmp_path):
    path = tmp_path / "a.csr"
    made = f"openssl req -new -key {settings.key} -subj /CN=a -out {path}"
    subprocess.run(made.split(), check=True, capture_output=True)
    words = trouble(context, replace(settings, certificate=str(path)))
    assert tells(words, f"certificate {path}: ", *FOREIGN["certificate"])


def test_certificate_and_key_that_are_exchanged_are_refused_as_another_content(settings, tmp_path):
    path = tmp_path / "a.key"
    shutil.copy(settings.certificate, path)
    path.chmod(0o600)
    words = trouble(context, replace(settings, certificate=settings.key))
    assert tells(words, f"certificate {settings.key}: ", *FOREIGN["certificate"])
    words = trouble(context, replace(settings, key=str(path)))
    assert tells(words, f"key {path}: ", *FOREIGN["key"])


def test_an_encrypted_key_is_refused_and_nobody_is_asked_for_its_password(settings, tmp_path):
    path = tmp_path / "encrypted"
    command = ["openssl", "pkey", "-in", settings.key, "-aes128", "-passout", "pass:secret", "-out", str(path)]
    subprocess.run(command, check=True, capture_output=True)
    path.chmod(0o600)
    words = trouble(context, replace(settings, key=str(path)))
    assert words.startswith(f"key {path}: is encrypted\n")
    assert f"openssl pkey -in {path} -out" in words


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o666])
def test_key_and_password_that_others_may_read_are_refused_with_chmod(settings, tmp_path, mode):
    path = written(tmp_path / "secret", "word", mode)
    for of, name in ((context, "key"), (password, "password_file")):
        words = trouble(of, replace(settings, **{name: path}))
        assert tells(words, f"{name} {path}: ", f"mode {mode:04o}", f"chmod 600 {path}")


def test_a_password_is_the_first_line_as_it_is(settings, tmp_path):
    for text, expected in (("word", b"word"), ("word\nmore\n", b"word"), ("w ö\r\n", "w ö".encode()), (" x ", b" x ")):
        assert password(replace(settings, password_file=written(tmp_path / "p", text))) == expected


@pytest.mark.parametrize("text", ["", "\n", "\nword", "x" * 65536])
def test_password_file_without_a_password_is_refused(settings, tmp_path, text):
    path = written(tmp_path / "p", text)
    assert tells(trouble(password, replace(settings, password_file=path)), f"password_file {path}: ", *NO_PASSWORD)


def test_password_behind_a_byte_order_mark_is_read_without_it(settings, tmp_path):
    path = written(tmp_path / "p", "\ufeffword\n")
    assert password(replace(settings, password_file=path)) == b"word"
    path = written(tmp_path / "p", "\ufeff\n")
    assert tells(trouble(password, replace(settings, password_file=path)), f"password_file {path}: ", *NO_PASSWORD)


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_a_password_in_utf_16_is_named(settings, tmp_path, encoding):
    path = tmp_path / "p"
    path.write_bytes("\ufeffword\n".encode(encoding))
    path.chmod(0o600)
    assert "is UTF-16" in trouble(password, replace(settings, password_file=str(path)))


def test_a_folder_is_no_password(settings, tmp_path):
    assert "not a regular file" in trouble(password, replace(settings, password_file=str(tmp_path)))
