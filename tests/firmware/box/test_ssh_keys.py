"""Lines of authorized_keys: those that sshd takes, and what else people paste."""

import base64
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as some

from firmware.box.note import Note
from firmware.box.ssh_keys import shut, sound_keys
from tests.firmware.box.conftest import KEY, Look, remarks


def looked(text: str) -> tuple[list[str], list[str]]:
    notes: list[Note] = []
    keys = sound_keys("authorized_keys", text, notes)
    assert all(note.is_mistake for note in notes)
    return keys, [note.text for note in notes]


def rsa(bits: int) -> str:
    fields = (b"ssh-rsa", b"\1\0\1", b"\0" + b"\xff" * (bits // 8))
    return "ssh-rsa " + base64.b64encode(b"".join(len(each).to_bytes(4) + each for each in fields)).decode()


@pytest.mark.parametrize("kind", ["ed25519", "ecdsa", "rsa"])
def test_what_ssh_keygen_writes_is_taken(tmp_path: Path, kind: str):
    subprocess.run(["ssh-keygen", "-q", "-t", kind, "-N", "", "-C", "me at home", "-f", tmp_path / "key"], check=True)
    line = (tmp_path / "key.pub").read_text()
    assert looked(line) == ([line.strip()], [])


def test_options_comments_and_empty_lines_are_sshds(tmp_path: Path):
    lines = ["# of the workshop", "", f'from="10.0.0.*,!10.0.0.7",command="echo \\"a b\\"" {KEY}', f"restrict {KEY}"]
    assert looked("\n".join(lines)) == (lines[2:], [])


BETWEEN = [" ", "\t", "  ", "\t \t", "\v", "\f", "\xa0", "\u2003"]


@pytest.mark.parametrize("between", BETWEEN)
@pytest.mark.parametrize("place", [1, 2])
def test_words_of_a_key_are_parted_as_openssh_parts_them(tmp_path: Path, between: str, place: int):
    words = KEY.split(" ")
    line = between.join((" ".join(words[:place]), " ".join(words[place:])))
    (tmp_path / "key").write_text(f"{line}\n")
    ended = subprocess.run(["ssh-keygen", "-l", "-f", tmp_path / "key"], capture_output=True, check=False)
    assert looked(line)[0] == ([line] if ended.returncode == 0 else [])


@pytest.mark.parametrize("between", BETWEEN)
def test_behind_options_any_blanks_and_tabs_may_stand_and_nothing_else(between: str):
    # OpenSSH, auth2-pubkeyfile.c: auth_check_authkey_line() skips them; ssh-keygen -l takes one alone.
    line = f"restrict{between}{KEY}"
    assert looked(line)[0] == ([] if between.strip(" \t") else [line])


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
    keys, told = looked(text)
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
        f"restrict, {KEY}",
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
    keys, told = looked(line)
    assert keys == []
    assert len(told) == 1


@pytest.mark.parametrize("kind", ["sk-ssh-ed25519@openssh.com", "sk-ecdsa-sha2-nistp256@openssh.com"])
def test_keys_of_a_token_are_taken(kind: str):
    fields = (bytes(32),) if "ed25519" in kind else (b"nistp256", b"\4" + bytes(64))
    assert looked(key(kind, *fields, b"ssh:")) == ([key(kind, *fields, b"ssh:")], [])


def test_a_line_that_was_broken_in_two_spoils_no_other_line():
    keys, told = looked(f"{KEY}\n{KEY[:30]}\n{KEY[30:]}\n{KEY}")
    assert keys == [KEY, KEY]
    assert [text.split(": ")[0] for text in told] == ["authorized_keys:2", "authorized_keys:3"]


def test_a_private_key_is_not_shown():
    _, told = looked("-----BEGIN OPENSSH PRIVATE KEY-----\nc2VjcmV0\n-----END OPENSSH PRIVATE KEY-----\n")
    assert "c2VjcmV0" not in told[0]


@given(text=some.text(max_size=200))
def test_any_text_is_taken_or_named(text: str):
    keys, told = looked(text)
    lines = [line.strip() for line in text.split("\n")]
    assert len(keys) + len(told) <= len([line for line in lines if line and not line.startswith("#")])


NOON = 1_764_072_000.0  # 2025-11-25T12:00:00Z


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ("restrict ", ""),
        ("", ""),
        ('expiry-time="20251126Z" ', ""),
        ('expiry-time="20251125Z" ', "has expired: expiry-time is 20251125"),
        ('expiry-time="202511251200Z" ', "has expired: expiry-time is 202511251200"),
        ('expiry-time="20251125120001Z" ', ""),
        # The box's own time may be twelve hours behind.
        ('expiry-time="202511250001" ', ""),
        ('expiry-time="99991231235959" ', ""),
        ('expiry-time="20300101",expiry-time="20200101" ', "has expired: expiry-time is 20200101"),
        ('no-pty,Expiry-Time="202511250000" ', "has expired: expiry-time is 202511250000"),
        ("cert-authority ", "is an authority's: only a certificate that it has signed for operator gets in"),
        ('no-pty,CERT-AUTHORITY,principals="operator" ', "is an authority's: only a certificate that it has signed for operator gets in"),
        ('command="a,cert-authority,b \\"expiry-time=\\"20010101\\"\\"" ', ""),
    ],
)  # fmt: skip
def test_a_key_by_which_nobody_gets_in_is_told(options: str, why: str):
    line = f"{options}{KEY}"
    assert looked(line) == ([line], [])
    assert shut(line, NOON) == why


@pytest.mark.parametrize("time", ["tomorrow", "2025-11-25", "20251325", "202511250", "20301231246000", ""])
def test_an_expiry_time_that_sshd_cannot_read_is_a_mistake(time: str):
    written = f'expiry-time="{time}"'
    keys, (said,) = looked(f"{written} {KEY}")
    assert keys == []
    assert said.startswith(f"authorized_keys:1: {written} is no time; write YYYYMMDD")


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
    _, (said,) = looked(f"ssh-ed25519-cert-v01@openssh.com {KEY.split()[1]}")
    assert said.startswith("authorized_keys:1: is a certificate, which belongs beside your private key; put the .pub")
