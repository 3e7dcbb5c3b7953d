"""Lines of authorized_keys: those that sshd takes, and what else people paste."""

import base64
import random
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as some

from tests.firmware.box.conftest import KEY, Look, keys_of, mistakes, remarks


def rsa(bits: int) -> str:
    fields = (b"ssh-rsa", b"\1\0\1", b"\0" + b"\xff" * (bits // 8))
    return "ssh-rsa " + base64.b64encode(b"".join(len(each).to_bytes(4) + each for each in fields)).decode()


def made_by_ssh_keygen(folder: Path, kind: str, *more: str) -> str:
    command = ["ssh-keygen", "-q", "-t", kind, *more, "-N", "", "-C", "me at home", "-f", str(folder / "key")]
    subprocess.run(command, check=True)
    return (folder / "key.pub").read_text().strip()


@pytest.mark.parametrize("kind", ["ed25519", "ecdsa", "rsa"])
def test_what_ssh_keygen_writes_is_taken(tmp_path: Path, kind: str):
    line = made_by_ssh_keygen(tmp_path, kind)
    assert keys_of(f"{line}\n") == ([line], [])


def test_options_comments_and_empty_lines_are_sshds(tmp_path: Path):
    lines = ["# of the workshop", "", f'from="10.0.0.*,!10.0.0.7",command="echo \\"a b\\"" {KEY}', f"restrict {KEY}"]
    assert keys_of("\n".join(lines)) == (lines[2:], [])


BETWEEN = [" ", "\t", "  ", "\t \t", "\v", "\f", "\xa0", "\u2003"]


@pytest.mark.parametrize("between", BETWEEN)
@pytest.mark.parametrize("place", [1, 2])
def test_words_of_a_key_are_parted_as_openssh_parts_them(tmp_path: Path, between: str, place: int):
    words = KEY.split(" ")
    line = between.join((" ".join(words[:place]), " ".join(words[place:])))
    (tmp_path / "key").write_text(f"{line}\n")
    ended = subprocess.run(["ssh-keygen", "-l", "-f", tmp_path / "key"], capture_output=True, check=False)
    assert keys_of(line)[0] == ([line] if ended.returncode == 0 else [])


@pytest.mark.parametrize("between", BETWEEN)
def test_behind_options_any_blanks_and_tabs_may_stand_and_nothing_else(between: str):
    # OpenSSH, auth2-pubkeyfile.c: auth_check_authkey_line() skips them; ssh-keygen -l takes one alone.
    line = f"restrict{between}{KEY}"
    assert keys_of(line)[0] == ([] if between.strip(" \t") else [line])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (KEY[:40], "authorized_keys:1: the key AAAAC3Nz...AAIG5Q is cut off or damaged"),
        (KEY.replace("AAAAC3", "AAAAC4", 1), "authorized_keys:1: the key AAAAC4Nz...SxVTpF is cut off or damaged; copy the whole line once more, without breaks"),
        ("ssh-ed25519", 'authorized_keys:1: the key "" is cut off or damaged'),
        ("hello world", 'authorized_keys:1: "hello world" begins no public key; is the line broken, or cut off?'),
        ("ssh-dss AAAA me", "authorized_keys:1: ssh-dss is no longer taken by sshd; make another key: ssh-keygen -t ed25519"),
        (rsa(768), "authorized_keys:1: an RSA key of 768 bits is refused by sshd"),
        ("-----BEGIN OPENSSH PRIVATE KEY-----\nb3BlbnNzaC1rZXktdjE\n", "authorized_keys:1: is a private key, which belongs on your own computer only"),
        ("PuTTY-User-Key-File-3: ssh-ed25519\nEncryption: none\n", "authorized_keys:1: is a private key"),
        ("---- BEGIN SSH2 PUBLIC KEY ----\nComment: x\n", "authorized_keys:1: is a public key in PuTTY's form; turn it into one line: ssh-keygen -i -f FILE"),
    ],
)  # fmt: skip
def test_what_is_no_key_is_named(text: str, said: str):
    keys, told = keys_of(text)
    assert keys == []
    assert len(told) == 1
    assert said in told[0]


def key(kind: str, *fields: bytes) -> str:
    octets = b"".join(len(each).to_bytes(4) + each for each in (kind.encode(), *fields))
    return f"{kind} {base64.b64encode(octets).decode()}"


@pytest.mark.parametrize(
    "line",
    [
        f"foobar {KEY}",
        f"restrict,foobar {KEY}",
        f"from=10.0.0.1 {KEY}",
        f'pty="x" {KEY}',
        key("ssh-ed25519", bytes(10)),
        key("ssh-ed25519", bytes(32), b"more"),
        key("ssh-rsa", b"\1\0\1"),
        key("ecdsa-sha2-nistp256", b"nistp384", b"\4" + bytes(96)),
        key("ecdsa-sha2-nistp256", b"nistp256", b"\4" + bytes(63)),
        " ".join([*KEY.split()[:1], KEY.split()[1] * 2]),
    ],
)
def test_what_sshd_would_pass_over_is_named(line: str):
    keys, told = keys_of(line)
    assert keys == []
    assert len(told) == 1


# G of P-256. Source: NIST SP 800-186, clause 3.2.1.3.
BASE_POINT = bytes.fromhex(
    "046b17d1f2e12c4247f8bce6e563a440f277037d812deb33a0f4a13945d898c296"
    "4fe342e2fe1a7f9b8ee7eb4a7c0f9e162bce33576b315ececbb6406837bf51f5"
)


@pytest.mark.parametrize("size", [256, 384, 521])
def test_a_letter_of_a_key_that_is_another_is_seen(tmp_path: Path, size: int):
    line = made_by_ssh_keygen(tmp_path, "ecdsa", "-b", str(size))
    assert keys_of(line) == ([line], [])
    kind, written, *_ = line.split()
    place = len(written) - 20
    other = "A" if written[place] != "A" else "B"
    keys, (said,) = keys_of(f"{kind} {written[:place]}{other}{written[place + 1 :]} me")
    assert keys == []
    assert "is cut off or damaged" in said


@pytest.mark.parametrize("more", ["=", "=="])
def test_what_base64_does_not_end_with_is_seen(more: str):
    kind, written, *_ = KEY.split()
    assert keys_of(f"{kind} {written}{more}")[0] == []


def test_bits_of_base64_that_mean_nothing_are_none(tmp_path: Path):
    line = made_by_ssh_keygen(tmp_path, "ecdsa", "-b", "256")
    kind, written, *_ = line.split()
    assert written.endswith("=")
    letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"
    last = letters[letters.index(written[-2]) + 1]
    assert keys_of(f"{kind} {written[:-2]}{last}=")[0] == []


@pytest.mark.parametrize("second", [KEY, f"restrict {KEY}"])
def test_two_keys_in_one_line_are_told(second: str):
    keys, (said,) = keys_of(f"{KEY}{second}")
    assert keys == []
    assert said == (
        "authorized_keys:1: a second key begins in its comment, AAAAC3Nz...SxVTpF, which sshd does not see; write each "
        "key into a line of its own"
    )


def test_a_letter_that_looks_like_a_blank_is_shown():
    _, (said,) = keys_of(KEY.replace(" ", "\xa0", 1))
    assert said.startswith(r'authorized_keys:1: "ssh-ed25519\xa0AAAAC3NzaC1l" begins no public key')


@pytest.mark.parametrize("kind", ["sk-ssh-ed25519@openssh.com", "sk-ecdsa-sha2-nistp256@openssh.com"])
def test_keys_of_a_token_are_taken(kind: str):
    fields = (bytes(32),) if "ed25519" in kind else (b"nistp256", BASE_POINT)
    assert keys_of(key(kind, *fields, b"ssh:")) == ([key(kind, *fields, b"ssh:")], [])


def test_a_line_that_was_broken_in_two_spoils_no_other_line():
    keys, told = keys_of(f"{KEY}\n{KEY[:30]}\n{KEY[30:]}\n{KEY}")
    assert keys == [KEY, KEY]
    assert [text.split(": ")[0] for text in told] == ["authorized_keys:2", "authorized_keys:3"]


def test_a_private_key_is_not_shown():
    _, told = keys_of("-----BEGIN OPENSSH PRIVATE KEY-----\nc2VjcmV0\n-----END OPENSSH PRIVATE KEY-----\n")
    assert "c2VjcmV0" not in told[0]


@given(text=some.text(max_size=200))
def test_any_text_is_taken_or_named(text: str):
    keys, told = keys_of(text)
    lines = [line.strip() for line in text.split("\n")]
    assert len(keys) + len(told) <= len([line for line in lines if line and not line.startswith("#")])


def test_keys_by_which_nobody_gets_in_do_not_count(look: Look):
    old = f'expiry-time="20010101Z" {KEY}'
    assert remarks(look({"authorized_keys": f"{old}\n"})) == [
        "authorized_keys: the key AAAAC3Nz...SxVTpF has expired: expiry-time is 20010101",
        "authorized_keys: there is no other ssh key: nobody else can log in by ssh; put the line of your .pub file into "
        "authorized_keys",
    ]
    assert len(remarks(look({"authorized_keys": f"{old}\n{old}\n"}))) == 2
    assert remarks(look({"authorized_keys": f"{old}\n{KEY}\n"})) == [
        "authorized_keys: the key AAAAC3Nz...SxVTpF has expired: expiry-time is 20010101",
    ]


def test_a_certificate_is_told_as_one():
    _, (said,) = keys_of(f"ssh-ed25519-cert-v01@openssh.com {KEY.split()[1]}")
    assert said.startswith("authorized_keys:1: is a certificate, which belongs beside your private key; put the .pub")


def test_a_comment_of_another_encoding_spoils_no_key(look: Look):
    other = KEY.replace("me", "m\xfcller").encode("latin-1")
    found = look({"authorized_keys": b"# m\xfcnchen\n" + other + f"\n{KEY}\n".encode()})
    assert mistakes(found) == []
    assert [key.split()[:2] for key in found.keys] == [KEY.split()[:2]] * 2


def test_what_is_no_text_is_told_once(look: Look):
    octets = bytes(octet for octet in random.Random(4).randbytes(4000) if octet)
    assert len(mistakes(look({"authorized_keys": octets}))) == 1


@pytest.mark.parametrize("place", [3, 20])
def test_a_key_of_another_encoding_is_told_in_its_line(look: Look, place: int):
    octets = bytearray(KEY.encode())
    octets[place] = 0xFC
    (said,) = mistakes(look({"authorized_keys": f"{KEY}\n".encode() + octets}))
    assert said.startswith("authorized_keys:2: ")


def test_a_key_that_has_expired_is_told_where_it_stands(look: Look):
    old = f'expiry-time="20010101Z" {KEY}'
    said = remarks(look({"user-data": f"#cloud-config\nssh_authorized_keys:\n- '{old}'\n"}))
    assert said[0] == "user-data: the key AAAAC3Nz...SxVTpF has expired: expiry-time is 20010101"
